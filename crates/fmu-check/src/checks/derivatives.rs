//! Unknowns and knowns of partial derivatives, and calls that request partial derivatives.

use crate::call_sequence::{Arg, Kind, Run, Values};
use crate::checker::Checker;
use crate::description::Description;
use crate::writer::{Part, Trajectory, Writer, value_of};
use fmi_abi::{BaseType, Causality, Interface};

/// Maximum number of knowns with respect to which derivatives are compared with differences.
pub const MOST_KNOWNS: usize = 400;

/// Returns whether a variable is a continuous scalar with double precision.
pub fn is_continuous_scalar(description: &Description, index: usize) -> bool {
    let variable = &description.variables[index];
    variable.base == Some(BaseType::Real) && variable.size == Some(1) && description.is_continuous(index)
}

/// Returns at most 200 continuous scalar outputs and, in Model Exchange, state derivatives.
pub fn unknowns(description: &Description, interface: Interface) -> Vec<usize> {
    let derivatives: &[_] =
        if interface == Interface::ModelExchange { &description.derivatives } else { &[] };
    let listed = description.outputs.iter().chain(derivatives).map(|unknown| unknown.variable);
    let mut found: Vec<usize> = listed.filter(|index| is_continuous_scalar(description, *index)).collect();
    found.dedup();
    found.truncate(200);
    found
}

/// Returns the continuous scalar inputs and, in Model Exchange, the continuous scalar states.
pub fn knowns(description: &Description, interface: Interface) -> Vec<usize> {
    let inputs = (0..description.variables.len())
        .filter(|index| description.variables[*index].causality == Causality::Input);
    let states = if interface == Interface::ModelExchange { description.states() } else { Vec::new() };
    inputs.chain(states).filter(|index| is_continuous_scalar(description, *index)).collect()
}

/// Returns a continuous scalar unknown, and a continuous scalar known on which it may depend.
pub fn unknown_and_known(description: &Description, interface: Interface) -> Option<(usize, usize)> {
    let unknowns = unknowns(description, interface);
    let knowns = knowns(description, interface);
    let mut listed = description.outputs.iter().chain(&description.derivatives);
    listed.find_map(|unknown| {
        let depends = |known: &&usize| unknown.dependencies.as_ref().is_none_or(|list| list.contains(known));
        let known = knowns.iter().find(depends).filter(|_| unknowns.contains(&unknown.variable))?;
        Some((unknown.variable, *known))
    })
}

/// Returns the first half of the simulation, after which partial derivatives are requested.
pub fn to_middle(trajectory: &Trajectory) -> [Part; 2] {
    [Part::Begin, Part::Points(trajectory.points.len() / 2)]
}

/// Writes the first half of the simulation with these parameters.
pub fn write_to_middle(writer: &mut Writer, parameters: &[(usize, Values)]) {
    writer.begin_with(0, parameters);
    writer.write(0, &[Part::Points(writer.trajectory.points.len() / 2)]);
}

/// Returns whether the FMU declares that it provides directional derivatives, and whether it declares adjoint derivatives.
pub fn declared(checker: &Checker, interface: Interface) -> [bool; 2] {
    let directional = ["providesDirectionalDerivative", "providesDirectionalDerivatives"];
    [&directional[..], &["providesAdjointDerivatives"]].map(|names| checker.can(interface, names))
}

/// Writes a call of `function`, which returns `count` directional or adjoint derivatives for this seed. Returns the number of the call.
pub fn request_derivatives(
    writer: &mut Writer,
    function: &str,
    unknowns: &[u32],
    knowns: &[u32],
    seed: &[f64],
    count: usize,
) -> u32 {
    // Only FMI 3.0 has arguments for the sizes of the seed and of the result.
    let fmi3 = writer.fmi3();
    let size = |size: usize| fmi3.then_some(Arg::Integer(size as i64));
    let mut args = Vec::new();
    for references in [unknowns, knowns] {
        args.push(Arg::In(Kind::U32, references.iter().map(|reference| u64::from(*reference)).collect()));
        args.push(Arg::Integer(references.len() as i64));
    }
    args.push(Arg::In(Kind::F64, seed.iter().map(|number| number.to_bits()).collect()));
    args.extend(size(seed.len()));
    args.push(Arg::Out(Kind::F64, count));
    args.extend(size(count));
    writer.call(0, function, args)
}

pub fn references(description: &Description, indices: &[usize]) -> Vec<u32> {
    indices.iter().map(|index| description.variables[*index].reference).collect()
}

pub fn names(description: &Description, indices: &[usize]) -> Vec<String> {
    indices.iter().map(|index| description.variables[*index].name.clone()).collect()
}

/// Returns the numbers that a call wrote; `None` if the call did not return OK.
pub fn numbers_if_ok(run: &Run, id: u32) -> Option<Vec<f64>> {
    run.written(id).filter(|_| run.status(id) == Some(0)).map(Values::numbers)
}

/// Sets a known to `numbers`. If it is one of `states`, sets the state vector to `vector`, in which the first of `numbers` replaces the
/// value of this state. Otherwise sets an input.
pub fn set_known(writer: &mut Writer, states: &[usize], vector: &[f64], known: usize, numbers: &[f64]) {
    match states.iter().position(|index| *index == known) {
        Some(at) => {
            let mut vector = vector.to_vec();
            vector[at] = numbers[0];
            writer.set_states(0, &vector);
        }
        None => {
            writer.set_numbers(0, known, numbers);
        }
    }
}

/// Returns the values of each known, and the state vector, in the middle of a simulation with these parameters. A list of values is empty
/// if they cannot be read.
pub fn middle_values(
    checker: &Checker,
    trajectory: &Trajectory,
    knowns: &[usize],
    states: &[usize],
    parameters: &[(usize, Values)],
) -> anyhow::Result<(Vec<Vec<f64>>, Vec<f64>)> {
    let mut writer = checker.writer(trajectory);
    write_to_middle(&mut writer, parameters);
    let read = writer.read_these(0, knowns);
    let vector = (!states.is_empty()).then(|| writer.vector(0, "GetContinuousStates", states.len()));
    let run = checker.execute(&writer.sequence)?;
    let numbers = |values: Option<Values>| values.map(|values| values.numbers()).unwrap_or_default();
    let values = knowns.iter().map(|known| numbers(value_of(&run, &read, *known))).collect();
    Ok((values, numbers(vector.and_then(|id| run.written(id)).cloned())))
}
