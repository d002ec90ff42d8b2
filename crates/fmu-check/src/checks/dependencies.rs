//! Checks that ModelStructure lists the dependencies that the FMU has, and that the declared kinds of dependencies are right.

use super::derivatives::{middle_values, set_known};
use crate::call_sequence::{Run, Values};
use crate::checker::Checker;
use crate::description::{Description, Unknown};
use crate::values::{LAST_DIGITS, near, other_values, start_values};
use crate::writer::Part::{Begin, Enter, Make};
use crate::writer::{Read, Trajectory, Writer, number_of, value_of};
use fmi_abi::{Causality, DependencyKind};
use std::collections::HashSet;

/// Returns the variables of the unknowns whose `dependencies` attribute lists neither the known nor an alias of it. An unknown
/// without the attribute is left out, because it is declared to depend on every known. The known and its aliases are left out,
/// too.
fn undeclared<'a>(
    checker: &Checker,
    unknowns: impl IntoIterator<Item = &'a Unknown>,
    known: usize,
) -> Vec<usize> {
    let aliases: HashSet<usize> = checker.description.aliases(known).collect();
    let omits_known = |unknown: &&Unknown| {
        let lists = |list: &Vec<usize>| list.iter().any(|index| aliases.contains(index));
        unknown.dependencies.as_ref().is_some_and(|list| !lists(list))
    };
    let variables = unknowns.into_iter().filter(omits_known).map(|unknown| unknown.variable);
    variables.filter(|index| !aliases.contains(index)).collect()
}

/// Reads of unknowns while a known has a value, another value, and the first value again.
struct Perturbed([Vec<Read>; 3]);

impl Perturbed {
    /// Writes the calls. `set` sets the known to the first value if its argument is 0, and to the other value if it is 1.
    fn write(writer: &mut Writer, unknowns: &[usize], mut set: impl FnMut(&mut Writer, usize)) -> Self {
        Self([0, 1, 0].map(|which| {
            set(writer, which);
            writer.read_these(0, unknowns)
        }))
    }

    /// Describes the first unknown that changes with the known and regains its first value together with the known. An unknown that does
    /// not regain it may have changed for another reason.
    fn dependency(
        &self,
        run: &Run,
        description: &Description,
        unknowns: &[usize],
        known: usize,
    ) -> Option<String> {
        unknowns.iter().find_map(|unknown| {
            let [one, other, again] = [0, 1, 2].map(|which| value_of(run, &self.0[which], *unknown));
            let (one, other, again) = (one?, other?, again?);
            let differ = |to: &Values| {
                one.differ_beyond(to, LAST_DIGITS, |_| description.variables[*unknown].nominal())
            };
            let at = differ(&other)?;
            let [name, known] = [*unknown, known].map(|index| &description.variables[index].name);
            let (from, to) = (one.show(at), other.show(at));
            let message =
                || format!("{name} goes from {from} to {to} when {known} changes, and does not list it");
            differ(&again).is_none().then(message)
        })
    }
}

/// Returns the indices of the points before which dependencies are tried: the second, the middle and the last point, in a quick
/// check only the middle one. The first point is not tried, because before the first step the initialization may still depend on
/// the inputs.
fn tried_points(checker: &Checker, trajectory: &Trajectory) -> Vec<usize> {
    let count = trajectory.points.len();
    let mut indices = vec![1.min(count), count / 2, count.saturating_sub(1)];
    indices.sort_unstable();
    indices.dedup();
    if checker.quick {
        indices = vec![count / 2];
    }
    indices
}

/// Writes a simulation, and calls `body` before each of the points with these indices.
fn simulate_with(
    writer: &mut Writer,
    trajectory: &Trajectory,
    indices: &[usize],
    mut body: impl FnMut(&mut Writer),
) {
    writer.write(0, &[Begin]);
    let mut next = 0;
    for index in indices {
        trajectory.points[next..*index].iter().for_each(|point| drop(writer.point(0, point)));
        next = *index;
        body(writer);
    }
}

/// Returns the outputs and, in Model Exchange, the state derivatives.
fn unknowns<'a>(checker: &'a Checker, trajectory: &Trajectory) -> impl Iterator<Item = &'a Unknown> {
    let derivatives = if trajectory.is_stepped() { &[][..] } else { &checker.description.derivatives };
    checker.description.outputs.iter().chain(derivatives)
}

/// Checks the dependencies of outputs and state derivatives on inputs and, in Model Exchange, on states. The states are set to their values
/// in the middle of the simulation, also at the other points.
pub fn missing(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let (knowns, states) = continuous_knowns(checker, trajectory);
    let (values, vector) = middle_values(checker, trajectory, &knowns, &states, &[])?;
    for (known, value) in knowns.into_iter().zip(values) {
        if value.is_empty() {
            continue;
        }
        let variable = &checker.description.variables[known];
        let other: Vec<f64> = value.iter().map(|value| near(variable, *value, 1.0 / 16.0)).collect();
        missing_of(checker, trajectory, known, false, &|writer, which| {
            set_known(writer, &states, &vector, known, [&value, &other][which]);
        })?;
    }
    discrete(checker, trajectory)
}

/// Checks the dependencies on one known, which `set` sets to a first value if its argument is 0, and to another value if it is 1. Sets it in
/// Event Mode if `in_event` is true.
fn missing_of(
    checker: &Checker,
    trajectory: &Trajectory,
    known: usize,
    in_event: bool,
    set: &dyn Fn(&mut Writer, usize),
) -> anyhow::Result<()> {
    let unknowns = undeclared(checker, unknowns(checker, trajectory), known);
    if unknowns.is_empty() {
        return Ok(());
    }
    let (mut writer, mut perturbed) = (checker.writer(trajectory), Vec::new());
    simulate_with(&mut writer, trajectory, &tried_points(checker, trajectory), |writer| {
        if in_event {
            writer.call(0, "EnterEventMode", vec![]);
        }
        perturbed.push(Perturbed::write(writer, &unknowns, set));
        if in_event {
            writer.leave_event(0);
        }
    });
    let description = checker.description.clone();
    checker.check("dependencies.missing", writer.sequence, move |run| {
        perturbed.iter().find_map(|perturbed| perturbed.dependency(run, &description, &unknowns, known))
    })
}

/// Returns two lists: at most 60 continuous knowns, which are inputs and, in Model Exchange, states; and all states, even those
/// beyond the first 60 knowns. States are left out if one of them is an array, so that each state is an element of the state
/// vector.
fn continuous_knowns(checker: &Checker, trajectory: &Trajectory) -> (Vec<usize>, Vec<usize>) {
    let description = &checker.description;
    let scalar = !trajectory.is_stepped() && description.states_count() == description.states().len();
    let states = if scalar { description.states() } else { Vec::new() };
    let inputs = (0..description.variables.len()).filter(|index| {
        let variable = &description.variables[*index];
        variable.causality == Causality::Input
            && description.is_continuous(*index)
            && !variable.once_per_instant
    });
    (inputs.chain(states.iter().copied()).take(checker.at_most(60)).collect(), states)
}

/// Checks the dependencies on discrete inputs of any type that have no aliases. They are set in Event Mode, except in
/// Co-Simulation without Event Mode.
fn discrete(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let description = &checker.description;
    let inputs = (0..description.variables.len()).filter(|index| {
        let variable = &description.variables[*index];
        let excluded = description.is_continuous(*index) || variable.once_per_instant || variable.clocked;
        variable.causality == Causality::Input && !excluded && description.aliases(*index).count() == 1
    });
    for known in inputs.take(checker.at_most(60)) {
        let Some(values) = start_and_other_values(description, known) else { continue };
        let in_event = !trajectory.is_stepped() || description.event_mode();
        missing_of(checker, trajectory, known, in_event, &|writer, which| {
            writer.set(0, &[(known, values[which].clone())]);
        })?;
    }
    Ok(())
}

/// Returns the start values of a variable, and values that differ from them; `None` if it lacks one of them.
fn start_and_other_values(description: &Description, index: usize) -> Option<[Values; 2]> {
    Some([start_values(description, index)?, other_values(description, index)?])
}

/// Checks the dependencies of initial unknowns on numeric inputs and numeric variables with `initial` = `exact`, such as
/// parameters.
pub fn initial(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let description = &checker.description;
    let knowns = (0..description.variables.len()).filter(|index| {
        let variable = &description.variables[*index];
        variable.is_settable() && !variable.starts().is_empty() && !variable.clocked && variable.is_number()
    });
    for known in knowns.take(checker.at_most(100)) {
        let unknowns = undeclared(checker, &description.initial_unknowns, known);
        let Some([value, other]) =
            start_and_other_values(description, known).filter(|_| !unknowns.is_empty())
        else {
            continue;
        };
        let other = match &value {
            Values::Numbers(kind, _) if kind.is_float() => {
                let variable = &description.variables[known];
                let starts = variable.starts().into_iter();
                Values::new(*kind, starts.map(|start| near(variable, start, 1.0 / 16.0)))
            }
            _ => other,
        };
        let mut writer = checker.writer(trajectory);
        writer.write(0, &[Make, Enter]);
        let perturbed = Perturbed::write(&mut writer, &unknowns, |writer, which| {
            writer.set(0, &[(known, [&value, &other][which].clone())]);
        });
        let description = checker.description.clone();
        checker.check("dependencies.initial", writer.sequence, move |run| {
            perturbed.dependency(run, &description, &unknowns, known)
        })?;
    }
    Ok(())
}

/// Reads of unknowns at one point for three equidistant values of a known.
struct Line {
    reads: [Vec<Read>; 3],
    /// Distance between adjacent values of the known.
    distance: f64,
}

impl Line {
    /// Returns the factor of the known in both intervals, and the size of their rounding errors. Returns `None` if a value was not read or
    /// is not finite.
    fn factors(&self, run: &Run, unknown: usize) -> Option<([f64; 2], f64)> {
        let value = |which: usize| number_of(run, &self.reads[which], unknown);
        let values = [value(0)?, value(1)?, value(2)?];
        let size = values.iter().fold(0.0_f64, |size, value| size.max(value.abs()));
        let factors = [values[1] - values[0], values[2] - values[1]].map(|change| change / self.distance);
        values.iter().all(|value| value.is_finite()).then_some((factors, 1e-4 * size / self.distance.abs()))
    }
}

/// Checks the kinds in `dependenciesKind`, which declare when the factor of a known in an unknown may change. If the kind is constant,
/// fixed or tunable, the factor must be equal for all values of the known and at all points, because the check changes no tunable
/// parameter. If the kind is discrete, the factor may change at events and communication points, so it must only be equal for all values of
/// the known at one point of Model Exchange.
pub fn kinds(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let description = &checker.description;
    let (mut knowns, states) = continuous_knowns(checker, trajectory);
    let declared_kind = |unknown: &Unknown, known: usize| {
        let list = unknown.dependencies.as_ref()?;
        let kind = *unknown.kinds.get(list.iter().position(|index| *index == known)?)?;
        let scalar = description.variables[unknown.variable].size == Some(1);
        let real = description.variables[unknown.variable].is_float();
        (scalar && real && kind != DependencyKind::Dependent).then_some((unknown.variable, kind))
    };
    let declared = |known: usize| -> Vec<(usize, DependencyKind)> {
        unknowns(checker, trajectory).filter_map(|unknown| declared_kind(unknown, known)).collect()
    };
    knowns.retain(|known| description.variables[*known].size == Some(1) && !declared(*known).is_empty());
    let (values, vector) = middle_values(checker, trajectory, &knowns, &states, &[])?;
    for (known, value) in knowns.into_iter().zip(values) {
        let variable = &description.variables[known];
        let Some(value) = value.first().copied().filter(|value| value.is_finite()) else { continue };
        let distance = (near(variable, value, 1.0 / 16.0) - value) / 2.0;
        if distance == 0.0 {
            continue;
        }
        let declared = declared(known);
        let indices: Vec<usize> = declared.iter().map(|(index, _)| *index).collect();
        let (mut writer, mut lines) = (checker.writer(trajectory), Vec::new());
        simulate_with(&mut writer, trajectory, &tried_points(checker, trajectory), |writer| {
            let reads = [0.0, 1.0, 2.0].map(|times| {
                set_known(writer, &states, &vector, known, &[value + times * distance]);
                writer.read_these(0, &indices)
            });
            set_known(writer, &states, &vector, known, &[value]);
            lines.push(Line { reads, distance });
        });
        let (description, stepped) = (checker.description.clone(), trajectory.is_stepped());
        checker.check("dependencies.kind", writer.sequence, move |run| {
            declared.iter().find_map(|(unknown, kind)| {
                let [name, known] = [*unknown, known].map(|index| &description.variables[index].name);
                let [one, other] = unequal_factors(run, &lines, *unknown, *kind, stepped)?;
                Some(format!(
                    "{known} enters {name} with a factor of {one:?} and of {other:?}, which is declared as {kind}"
                ))
            })
        })?;
    }
    Ok(())
}

/// Returns two factors that must be equal but differ.
fn unequal_factors(
    run: &Run,
    lines: &[Line],
    unknown: usize,
    kind: DependencyKind,
    stepped: bool,
) -> Option<[f64; 2]> {
    let differ =
        |one: f64, other: f64, error: f64| (one - other).abs() > 1e-2 * one.abs().max(other.abs()) + error;
    let found: Vec<_> = lines.iter().filter_map(|line| line.factors(run, unknown)).collect();
    let is_discrete = kind == DependencyKind::Discrete;
    if !(is_discrete && stepped) {
        let not_straight = found.iter().find(|([one, other], error)| differ(*one, *other, *error));
        if let Some((factors, _)) = not_straight {
            return Some(*factors);
        }
    }
    let ([first, _], error) = found.first()?;
    let other = found.iter().find(|([one, _], other)| differ(*first, *one, error.max(*other)));
    other.filter(|_| !is_discrete).map(|([one, _], _)| [*first, *one])
}
