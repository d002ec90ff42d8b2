//! Checks the vectors of continuous states, their derivatives and their nominal values.

use super::derivatives::numbers_if_ok;
use crate::checker::Checker;
use crate::writer::{Trajectory, value_of};

/// Checks that the vectors of states and of state derivatives equal the variables in the order of ModelStructure, and that the nominal
/// values of states are positive and finite.
pub fn vectors(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let description = &checker.description;
    let count = description.states_count();
    let derivatives: Vec<usize> = description.derivatives.iter().map(|unknown| unknown.variable).collect();
    let states = description.states();
    if count == 0 || states.len() != derivatives.len() {
        return Ok(());
    }
    let mut writer = checker.writer(trajectory);
    writer.begin(0);
    let derivatives_name = writer.derivatives_name();
    let (mut vectors, mut nominals) = (Vec::new(), None);
    for point in &trajectory.points {
        writer.point(0, point);
        nominals = Some(writer.vector(0, "GetNominalsOfContinuousStates", count));
        for (name, indices) in [("GetContinuousStates", &states), (derivatives_name, &derivatives)] {
            vectors.push((writer.vector(0, name, count), writer.read_these(0, indices), indices.clone()));
        }
    }
    let description = description.clone();
    let run = checker.evaluate("derivatives.vectors", writer.sequence.clone(), move |run| {
        vectors.iter().filter(|(vector, ..)| run.succeeds(*vector)).find_map(|(vector, reads, indices)| {
            let numbers = run.written(*vector)?.numbers();
            let values = indices.iter().filter_map(|index| value_of(run, reads, *index));
            let values: Vec<f64> = values.flat_map(|value| value.numbers()).collect();
            let differ = |(one, other): (&f64, &f64)| one.to_bits() != other.to_bits() && one != other;
            let at = numbers.iter().zip(&values).position(differ);
            let at = at.filter(|_| numbers.len() == values.len())?;
            let name = &description.variables[indices[at.min(indices.len() - 1)]].name;
            let (one, other) = (numbers[at], values[at]);
            Some(format!("number {} of the vector is {one:?}, {name} is {other:?}", at + 1))
        })
    })?;
    checker.record("derivatives.nominals", &run, &writer.sequence, move |run| {
        let numbers = numbers_if_ok(run, nominals?)?;
        let bad = numbers.iter().find(|number| !(**number > 0.0 && number.is_finite()))?;
        Some(format!("a nominal value is {bad:?}"))
    });
    Ok(())
}
