//! Looks for parameters that have no effect, or none after the initialization, which are usually mistakes of the author of a model.

use crate::call_sequence::{CallSequence, End, Run, Values};
use crate::checker::Checker;
use crate::description::{Description, Variable};
use crate::values::{near, other_values};
use crate::writer::Part::{Enter, Free, Leave, Make, ReadAll};
use crate::writer::{MAX_READ, Part, Read, Trajectory, Writer, difference, value_of};
use fmi_abi::{BaseType, Causality, Variability};

/// Parameter, or elements of an array that are separate parameters in FMI 2.0. They are changed together, because a table may have to
/// rise, and a simulation may need only some of its elements.
struct Group {
    name: String,
    indices: Vec<usize>,
    /// Values other than the start values: near values first, then distant ones and the limits of the range.
    others: Vec<Vec<(usize, Values)>>,
}

/// Returns the name of the array of an element, or the name of a scalar.
fn array_of(name: &str) -> &str {
    name.strip_suffix(']').and_then(|name| name.split_once('[')).map_or(name, |(array, _)| array)
}

/// Returns all parameters that are numbers, Booleans or items, and strings if they are wanted.
fn groups(description: &Description, with_strings: bool) -> Vec<Group> {
    let mut groups: Vec<Group> = Vec::new();
    for (index, variable) in description.variables.iter().enumerate() {
        let is_number = variable.is_number() && variable.size == Some(variable.starts().len());
        let is_tried = is_number || with_strings && variable.base == Some(BaseType::String);
        if variable.causality != Causality::Parameter || variable.clocked || !is_tried {
            continue;
        }
        let name = array_of(&variable.name);
        match groups.last_mut().filter(|group| group.name == name) {
            Some(group) => group.indices.push(index),
            None => groups.push(Group { name: name.to_owned(), indices: vec![index], others: Vec::new() }),
        }
    }
    for group in &mut groups {
        group.others = other_values_of(description, &group.indices);
    }
    groups
}

fn other_values_of(description: &Description, indices: &[usize]) -> Vec<Vec<(usize, Values)>> {
    if description.variables[indices[0]].base == Some(BaseType::String) {
        let others = indices.iter().map(|index| Some((*index, other_values(description, *index)?)));
        return others.collect::<Option<Vec<_>>>().into_iter().collect();
    }
    let start = |variable: &Variable, index| Values::new(description.kind(index), variable.starts());
    let all = |change: &dyn Fn(&Variable, f64) -> Option<f64>| -> Option<Vec<(usize, Values)>> {
        let changed = indices.iter().map(|index| {
            let variable = &description.variables[*index];
            let numbers = variable.starts().into_iter().map(|start| change(variable, start));
            Some((*index, Values::new(description.kind(*index), numbers.collect::<Option<Vec<f64>>>()?)))
        });
        changed.collect()
    };
    let is_float = indices.iter().all(|index| description.variables[*index].is_float());
    let mut found = Vec::new();
    if is_float {
        found.extend(
            [1.0 / 64.0, 0.5, -0.5].map(|by| all(&|variable, start| Some(near(variable, start, by)))),
        );
    } else if let Some(items) = items(description, indices[0]) {
        let all_items = |item: f64| all(&move |_, _| Some(item));
        found.extend(items.into_iter().take(MOST_ITEMS).map(all_items));
    } else {
        let others = indices.iter().map(|index| Some((*index, other_values(description, *index)?)));
        found.push(others.collect());
    }
    found.extend([all(&|variable, _| variable.min()), all(&|variable, _| variable.max())]);
    let mut found: Vec<_> = found.into_iter().flatten().collect();
    found.retain(|values| {
        values
            .iter()
            .any(|(index, value)| value.differ(&start(&description.variables[*index], *index)).is_some())
    });
    found
}

/// Maximum number of items of an enumeration that are tried.
const MOST_ITEMS: usize = 8;

/// Returns the numbers of the items, if the variable is an enumeration.
fn items(description: &Description, index: usize) -> Option<Vec<f64>> {
    let variable = &description.variables[index];
    let items = description.items_of(variable.declared_type.as_deref())?;
    (variable.base == Some(BaseType::Enumeration))
        .then(|| items.iter().map(|item| item.value as f64).collect())
}

/// Calls of a simulation with other values of a parameter.
struct Variation {
    /// Calls that set the values.
    sets: Vec<u32>,
    /// Other calls, in the same order in each simulation.
    calls: Vec<u32>,
    first: Vec<Read>,
    reads: Vec<Read>,
}

impl Variation {
    fn write(writer: &mut Writer, values: &[(usize, Values)], inputs: &[(usize, Values)]) -> Self {
        let mut calls = writer.write(0, &[Make]).ids;
        let sets = writer.set(0, values);
        calls.extend(writer.set(0, inputs));
        calls.extend(writer.write(0, &[Enter, Leave]).ids);
        Self::run(writer, sets, calls)
    }

    /// Sets the values after the initialization; in Model Exchange in Event Mode.
    fn write_late(writer: &mut Writer, values: &[(usize, Values)], inputs: &[(usize, Values)]) -> Self {
        let mut calls = writer.write(0, &[Make]).ids;
        calls.extend(writer.set(0, inputs));
        calls.extend(writer.write(0, &[Enter, Leave]).ids);
        let in_event = !writer.trajectory.is_stepped();
        if in_event {
            calls.extend(writer.write(0, &[Part::Call("EnterEventMode")]).ids);
        }
        let sets = writer.set(0, values);
        if in_event {
            calls.extend(writer.leave_event(0));
        }
        Self::run(writer, sets, calls)
    }

    /// Writes the rest of the simulation.
    fn run(writer: &mut Writer, sets: Vec<u32>, mut calls: Vec<u32>) -> Self {
        let first = writer.write(0, &[ReadAll]).reads;
        let rest = writer.write(0, &[Part::Run(0)]);
        calls.extend(rest.ids);
        writer.write(0, &[Free]);
        Self { sets, calls, first, reads: rest.reads }
    }

    /// Returns whether the model accepts the values and all calls succeed.
    fn succeeds(&self, run: &Run) -> bool {
        self.sets.iter().chain(&self.calls).all(|id| run.succeeds(*id))
    }

    /// Returns whether any result differs: a value, or a status, time or event that a call returns.
    fn differs(&self, run: &Run, description: &Description, other: &Self) -> bool {
        let result = |id: &u32| run.outcome(*id).map(|outcome| (outcome.status, &outcome.written));
        let differ = |one: &[Read], other: &[Read]| difference(description, run, one, other, 0.0).is_some();
        differ(&self.first, &other.first)
            || differ(&self.reads, &other.reads)
            || self.calls.iter().zip(&other.calls).any(|(one, other)| result(one) != result(other))
    }

    /// Returns whether a variable that the model calculates changes over time.
    fn moves(&self, run: &Run, description: &Description) -> bool {
        let last = &self.reads[self.reads.len().saturating_sub(self.first.len())..];
        (0..description.variables.len()).any(|index| {
            let causality = description.variables[index].causality;
            let given = [Causality::Input, Causality::Independent, Causality::Parameter].contains(&causality);
            let values = || Some((value_of(run, &self.first, index)?, value_of(run, last, index)?));
            !given && values().is_some_and(|(first, last)| first.differ(&last).is_some())
        })
    }
}

/// Returns a different value of each floating-point input.
fn other_inputs(description: &Description) -> Vec<(usize, Values)> {
    let is_wanted = |(_, variable): &(usize, &Variable)| {
        variable.causality == Causality::Input
            && variable.is_float()
            && !variable.clocked
            && !variable.once_per_instant
            && variable.size == Some(variable.starts_count())
    };
    let inputs = description.variables.iter().enumerate().filter(is_wanted).take(1000).enumerate();
    let value = |(number, (index, variable)): (usize, (usize, &Variable))| {
        let numbers = variable
            .starts()
            .into_iter()
            .map(|start| near(variable, start, 0.5 + 0.3 * (number as f64).sin()));
        (index, Values::new(description.kind(index), numbers))
    };
    inputs.map(value).collect()
}

/// Simulations without change, then with each of the other values; the same again with other discrete inputs and Booleans, and again with
/// other floating-point inputs, because a controller whose inputs are all 0 has nothing to control.
struct Variations(Vec<(Variation, Vec<Variation>)>);

impl Variations {
    fn write(writer: &mut Writer, group: &Group, count: usize) -> Self {
        let description = writer.description;
        // Another parameter may switch the effect of this one off, for example whether a start value is used.
        let is_switch = |index: &usize| {
            let variable = &description.variables[*index];
            let is_input =
                variable.causality == Causality::Input && !variable.is_float() && variable.is_number();
            let is_boolean =
                variable.causality == Causality::Parameter && variable.base == Some(BaseType::Boolean);
            (is_input || is_boolean) && !variable.clocked && !group.indices.contains(index)
        };
        let switches = (0..description.variables.len()).filter(is_switch);
        let switches: Vec<_> =
            switches.filter_map(|index| Some((index, other_values(description, index)?))).collect();
        let mut inputs = vec![Vec::new()];
        if count > 1 {
            let numbers = other_inputs(description);
            if !switches.is_empty() {
                inputs.push(switches.clone());
            }
            if !numbers.is_empty() {
                inputs.push([switches, numbers].concat());
            }
        }
        let with = |inputs: &Vec<(usize, Values)>| {
            let base = Variation::write(writer, &[], inputs);
            let others = group.others.iter().take(count);
            (base, others.map(|values| Variation::write(writer, values, inputs)).collect())
        };
        Self(inputs.iter().map(with).collect())
    }

    /// Returns whether no value has an effect, although the model accepts at least one of them and moves.
    fn show_no_effect(&self, run: &Run, description: &Description) -> bool {
        let (base, others) = &self.0[0];
        let accepted = others.iter().any(|other| other.succeeds(run));
        let has_effect = |(base, others): &(Variation, Vec<Variation>)| {
            let mut accepted = others.iter().filter(|other| other.sets.iter().all(|id| run.succeeds(*id)));
            accepted.any(|other| other.differs(run, description, base))
        };
        accepted && base.succeeds(run) && base.moves(run, description) && !self.0.iter().any(has_effect)
    }
}

/// Looks for a parameter that changes nothing in the simulations of all interface types: no value, no derivative and no event. Models with
/// more variables than a check reads are left out.
pub fn parameters(checker: &Checker) -> anyhow::Result<()> {
    let description = &checker.description;
    let Some(first) = checker.trajectories.first().filter(|_| description.variables.len() <= MAX_READ) else {
        return Ok(());
    };
    // Strings are left out, because many are only labels.
    for group in groups(description, false).iter().take(checker.at_most(400)) {
        // The first value suffices for most parameters.
        let counts = [1, group.others.len()];
        let mut has_effect = group.others.is_empty();
        for (count, trajectory) in
            counts.iter().flat_map(|count| checker.trajectories.iter().map(move |of| (*count, of)))
        {
            has_effect = has_effect || !without_effect(checker, trajectory, group, count)?;
        }
        if !has_effect {
            let (sequence, variations) = simulations(checker, first, group, group.others.len());
            let (description, name) = (description.clone(), group.name.clone());
            checker.check("start_values.no-effect", sequence, move |run| {
                let message = || format!("in the simulations of this check, {name} changes no value, no derivative and no event");
                variations.show_no_effect(run, &description).then(message)
            })?;
        }
    }
    Ok(())
}

/// Looks for a tunable parameter that acts if it is set before the initialization, but not if it is set after it.
pub fn tunable_parameters(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let description = &checker.description;
    if trajectory.is_stepped() && description.event_mode() || description.variables.len() > MAX_READ {
        return Ok(());
    }
    let is_tunable = |index: &usize| description.variables[*index].variability == Variability::Tunable;
    let mut groups = groups(description, false);
    groups.retain(|group| group.indices.iter().all(is_tunable));
    for group in groups.iter().take(checker.at_most(400)) {
        let Some(values) = group.others.first() else { continue };
        let readable = others(checker, group);
        let mut writer = Writer::new(description, trajectory, &readable);
        let inputs = other_inputs(description);
        let usual = Variation::write(&mut writer, &[], &inputs);
        let early = Variation::write(&mut writer, values, &inputs);
        let unchanged = Variation::write_late(&mut writer, &[], &inputs);
        let late = Variation::write_late(&mut writer, values, &inputs);
        let (description, name) = (description.clone(), group.name.clone());
        checker.check("start_values.tunable", writer.sequence, move |run| {
            let all_succeed = [&usual, &early, &unchanged, &late].iter().all(|of| of.succeeds(run));
            let acts = |one: &Variation, other: &Variation| other.differs(run, &description, one);
            let is_late = all_succeed && acts(&usual, &early) && !acts(&unchanged, &late);
            is_late
                .then(|| format!("{name} is tunable, but acts only if it is set before the initialization"))
        })?;
    }
    Ok(())
}

/// Returns the variables that are read: all except the parameter and its aliases.
fn others(checker: &Checker, group: &Group) -> Vec<usize> {
    let is_of_group =
        |index: &usize| checker.description.aliases(*index).any(|alias| group.indices.contains(&alias));
    checker.readable.iter().copied().filter(|index| !is_of_group(index)).collect()
}

/// Writes the simulations, which read all variables except the parameter and its aliases.
fn simulations(
    checker: &Checker,
    trajectory: &Trajectory,
    group: &Group,
    count: usize,
) -> (CallSequence, Variations) {
    let description = &checker.description;
    let others = others(checker, group);
    let mut writer = Writer::new(description, trajectory, &others);
    let variations = Variations::write(&mut writer, group, count);
    (writer.sequence, variations)
}

/// Returns whether a parameter has no effect in simulations with the first `count` of its values. Returns false if they do not show it, for
/// example because the model rejects the values.
fn without_effect(
    checker: &Checker,
    trajectory: &Trajectory,
    group: &Group,
    count: usize,
) -> anyhow::Result<bool> {
    let (sequence, variations) = simulations(checker, trajectory, group, count);
    let run = checker.execute(&sequence)?;
    Ok(run.end == End::Done && variations.show_no_effect(&run, &checker.description))
}

/// Looks for a calculated parameter that no parameter changes.
pub fn calculated_parameters(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let description = &checker.description;
    let of = |causality| {
        let is_of = move |index: &usize| description.variables[*index].causality == causality;
        (0..description.variables.len()).filter(is_of)
    };
    let calculated: Vec<usize> =
        of(Causality::CalculatedParameter).filter(|index| checker.readable.contains(index)).collect();
    let groups = groups(description, true);
    // The parameters that are not tried are bytes, clocked or structural.
    let tried: usize =
        groups.iter().filter(|group| !group.others.is_empty()).map(|group| group.indices.len()).sum();
    let all = of(Causality::Parameter).count() + of(Causality::StructuralParameter).count();
    if calculated.is_empty() || tried < all || groups.len() > checker.at_most(400) {
        return Ok(());
    }
    let mut writer = Writer::new(description, trajectory, &calculated);
    let mut write = |values: &[(usize, Values)]| {
        writer.write(0, &[Make]);
        let sets = writer.set(0, values);
        let reads = writer.write(0, &[Enter, Leave, Part::Read, Free]).reads;
        (sets, reads)
    };
    let (_, base) = write(&[]);
    let variations: Vec<Vec<_>> =
        groups.iter().map(|group| group.others.iter().map(|values| write(values)).collect()).collect();
    let (description, sequence) = (description.clone(), writer.sequence);
    checker.check("dependencies.calculated-parameter", sequence, move |run| {
        let is_set = |sets: &Vec<u32>| sets.iter().all(|id| run.succeeds(*id));
        if !variations
            .iter()
            .all(|of_group: &Vec<(Vec<u32>, Vec<Read>)>| of_group.iter().any(|(sets, _)| is_set(sets)))
        {
            return None;
        }
        let set = || variations.iter().flatten().filter(|(sets, _)| is_set(sets));
        calculated.iter().find_map(|index| {
            let start = value_of(run, &base, *index)?;
            let same = |reads: &Vec<Read>| {
                value_of(run, reads, *index).is_some_and(|value| value.differ(&start).is_none())
            };
            let name = &description.variables[*index].name;
            let message =
                || format!("{name} is {} for all values of the parameters that were tried", start.show(0));
            set().all(|(_, reads)| same(reads)).then(message)
        })
    })
}
