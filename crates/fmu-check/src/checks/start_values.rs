//! Checks start values and value ranges, that getters return the values that were set, and that constants and inputs keep their
//! values.

use crate::call_sequence::{Run, Values};
use crate::checker::Checker;
use crate::description::Variable;
use crate::finding::{Criterion, any};
use crate::values::{LAST_DIGITS, other_values};
use crate::worker::FILL;
use crate::writer::Part::{Begin, Enter, Free, Leave, Make, Points};
use crate::writer::{Part, Read, Trajectory, Writer, sample, value_of, values_of};
use fmi_abi::{BaseType, Causality, Initial, Variability};
use std::sync::Arc;

/// Checks the start values of variables, then the values during the simulation and the constants.
pub fn starts(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let model = Arc::clone(&checker.description);
    // FMI 2.0 forbids getters before Initialization Mode, and allows only those of some variables in it (note 2 of the tables in
    // sections 3.2.3 and 4.2.4 of FMI 2.0.5). The others are read after it, if they still have their start values. FMI 3.0 allows
    // getters in the Instantiated state, where they return the start values (section 2.3.2).
    let states: [&[Part]; 2] = match checker.fmi3() {
        true => [&[Make, Enter], &[Make]],
        false => [&[Make, Enter], &[Make, Enter, Part::Call("ExitInitializationMode")]],
    };
    for (number, parts) in states.into_iter().enumerate() {
        let (after, mut writer) = (number == 1 && !checker.fmi3(), checker.writer(trajectory));
        writer.write(0, parts);
        let mut indices = sample(&model, 10_000);
        indices.retain(|index| {
            let early = model.is_readable_while_initializing(*index);
            if after { !early && !may_change(&model.variables[*index]) } else { early }
        });
        let (reads, model) = (writer.read_anyway(0, &indices), Arc::clone(&model));
        checker.check("start_values.start", writer.sequence, move |run| {
            values_of(run, &reads).find_map(|(index, value)| {
                let variable =
                    Some(&model.variables[index]).filter(|variable| !is_start(variable, &value))?;
                let (name, starts) = (&variable.name, variable.start.join(" "));
                Some(format!("{name} starts with {}, the model description has {starts}", value.show(0)))
            })
        })?;
    }
    values(checker, trajectory)?;
    constants(checker, trajectory)
}

/// Returns whether a variable may change at the end of the initialization.
fn may_change(variable: &Variable) -> bool {
    variable.causality != Causality::Input
        && [Variability::Discrete, Variability::Continuous].contains(&variable.variability)
}

/// Returns whether a value equals the start value. Returns true for a variable that may have other values.
fn is_start(variable: &Variable, value: &Values) -> bool {
    let must_be_start = variable.initial == Some(Initial::Exact) || variable.causality == Causality::Input;
    if !must_be_start || variable.start.is_empty() || variable.clocked || variable.base.is_none() {
        return true;
    }
    match value {
        Values::Strings(texts) => {
            let mut pairs =
                texts.iter().enumerate().map_while(|(index, text)| Some((text, variable.start_of(index)?)));
            variable.base != Some(BaseType::String)
                || pairs.all(|(text, start)| text.as_deref() == Some(start.as_bytes()))
        }
        Values::Numbers(kind, bits) => {
            let starts = variable.starts();
            let wrong = |(bits, start): (&u64, &f64)| {
                let (actual, expected) = (kind.number(*bits), kind.number(kind.bits(*start)));
                // The model description may have fewer digits than the value.
                (actual - expected).abs() > 1e-9 * expected.abs() || actual.is_nan() != expected.is_nan()
            };
            starts.len() != bits.len() || !bits.iter().zip(&starts).any(wrong)
        }
    }
}

/// Tests a value of a variable. Returns a description of the error, which continues a sentence after the name of the variable.
type ValueTest = fn(&Variable, &Values) -> Option<String>;

/// Rules for values that are read, each with its test.
const VALUE_TESTS: [(&str, ValueTest); 5] = [
    ("start_values.unwritten", |_, value| {
        let Values::Numbers(kind, bits) = value else { return None };
        let untouched = u64::from_ne_bytes([FILL; 8]) >> (64 - 8 * kind.size());
        // A valid value of fewer bytes may equal the fill bytes.
        (kind.size() >= 4 && bits.contains(&untouched)).then(|| "has not been written".to_owned())
    }),
    ("start_values.boolean", |variable, value| {
        let wrong = variable.base == Some(BaseType::Boolean)
            && value.numbers().iter().any(|number| ![0.0, 1.0].contains(number));
        wrong.then(|| format!("is {}", value.show(0)))
    }),
    ("start_values.range", |variable, value| {
        let ranged = variable.base.is_some_and(|base| !base.is_float())
            && [Causality::Local, Causality::Output].contains(&variable.causality);
        let (min, max) =
            (variable.min().unwrap_or(f64::NEG_INFINITY), variable.max().unwrap_or(f64::INFINITY));
        let wrong = ranged && value.numbers().iter().any(|number| *number < min || *number > max);
        wrong.then(|| format!("is {}, outside of {min} to {max}", value.show(0)))
    }),
    ("start_values.string", |variable, value| {
        let wrong = variable.base == Some(BaseType::String)
            && matches!(value, Values::Strings(texts) if texts.contains(&None));
        wrong.then(|| "is NULL".to_owned())
    }),
    ("results.not-finite", |variable, value| {
        let wrong = variable.is_float() && value.numbers().iter().any(|number| !number.is_finite());
        wrong.then(|| format!("is {}", value.show(0)))
    }),
];

/// Applies `VALUE_TESTS` to the values at each point of the simulation.
fn values(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let mut writer = checker.writer(trajectory);
    writer.begin(0);
    let mut reads = writer.read(0);
    for point in &trajectory.points {
        writer.point(0, point);
        reads.extend(writer.read(0));
    }
    let run = checker.execute(&writer.sequence)?;
    checker.record_always(&writer.sequence, &run);
    for (name, test) in VALUE_TESTS {
        let (model, reads) = (Arc::clone(&checker.description), reads.clone());
        checker.record(name, &run, &writer.sequence, move |run| {
            values_of(run, &reads).find_map(|(index, value)| {
                let variable = Some(&model.variables[index]).filter(|variable| !variable.clocked)?;
                Some(format!("{} {}", variable.name, test(variable, &value)?))
            })
        });
    }
    Ok(())
}

/// Checks that constants and parameters do not change while time advances. Other fixed variables may depend on tunable variables
/// and on fixed inputs (which FMI forbids), so they are checked only if there are none.
fn constants(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let variables = &checker.description.variables;
    let tunable = variables.iter().any(|other| {
        other.variability == Variability::Tunable
            || other.causality == Causality::Input && other.variability == Variability::Fixed
    });
    let mut unchanging = checker.readable.clone();
    unchanging.retain(|index| {
        let variable = &variables[*index];
        variable.variability == Variability::Constant
            || !tunable
                && variable.variability == Variability::Fixed
                && variable.causality != Causality::Input
            || variable.causality == Causality::Parameter
    });
    if unchanging.is_empty() || trajectory.points.is_empty() {
        return Ok(());
    }
    let mut writer = checker.writer(trajectory);
    writer.begin(0);
    let first = writer.read_these(0, &unchanging);
    writer.write(0, &[Points(usize::MAX)]);
    let last = writer.read_these(0, &unchanging);
    let criterion = checker.differ(&first, &last, "{} was {} and has become {}");
    checker.check("start_values.fixed", writer.sequence, criterion)
}

/// Returns the variables that can be set before the initialization and have no aliases.
pub fn settable(checker: &Checker) -> Vec<usize> {
    let description = &checker.description;
    let mut indices = checker.readable.clone();
    indices.retain(|index| {
        let of = &description.variables[*index];
        of.is_settable() && !of.clocked && !of.start.is_empty() && description.aliases(*index).count() == 1
    });
    indices
}

/// Checks that getters return the values that were set in Initialization Mode, before it, and at a communication point. Also
/// checks that values have the same effect whether they are set before or in Initialization Mode, and that inputs keep their values.
pub fn set(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let description = &checker.description;
    let variable = |index: &usize| &description.variables[*index];
    let indices = settable(checker);
    let with_other = |index: &usize| Some((*index, other_values(description, *index)?));
    let (floats, others): (Vec<usize>, Vec<usize>) =
        indices.iter().partition(|index| variable(index).is_float());
    let near: Vec<(usize, Values)> = floats.iter().filter_map(with_other).collect();
    // Floating-point variables are set together, to values near their start values. A model may reject new values of integers, Booleans and
    // strings, so these variables are set one at a time.
    let separate = others.iter().take(checker.at_most(40)).flat_map(|index| {
        // The string has 500 bytes, so it is longer than usual buffers.
        let size = variable(index).size.filter(|_| variable(index).base == Some(BaseType::String));
        let long = size.map(|size| (*index, Values::strings(&b"long ".repeat(100), size)));
        with_other(index).into_iter().chain(long).map(|value| vec![value])
    });
    if !near.is_empty() {
        same_effect(checker, trajectory, &near)?;
    }
    // In reverse order, too, because setting one variable must not change another.
    let backward = near.iter().rev().cloned().collect();
    for values in [near, backward].into_iter().filter(|near| !near.is_empty()).chain(separate) {
        for (before, after) in [(&[Make, Enter][..], &[][..]), (&[Make][..], &[Enter][..])] {
            read_back(checker, trajectory, (before, after, true), values.clone())?;
        }
    }
    // At a communication point, only inputs and tunable variables are set, most of which can be set outside of Event Mode. A rejected
    // call is not a finding.
    for index in indices.iter().take(checker.at_most(400)) {
        let of = variable(index);
        let may_change = of.causality == Causality::Input
            || of.variability == Variability::Tunable && trajectory.is_stepped();
        let without_event =
            of.is_float() || of.variability != Variability::Discrete && trajectory.is_stepped();
        let is_settable = may_change && without_event && !of.once_per_instant;
        if let Some(value) = with_other(index).filter(|_| is_settable) {
            read_back(checker, trajectory, (&[Begin, Points(2)], &[], false), vec![value])?;
        }
    }
    inputs(checker, trajectory)
}

/// Checks that values have the same effect whether they are set before Initialization Mode, or in it after getters were called.
fn same_effect(checker: &Checker, trajectory: &Trajectory, values: &[(usize, Values)]) -> anyhow::Result<()> {
    let mut writer = checker.writer(trajectory);
    let mut sets = Vec::new();
    let [before, within] =
        [(&[Make][..], &[Enter][..]), (&[Make, Enter, Part::Read][..], &[][..])].map(|(before, after)| {
            writer.write(0, before);
            sets.extend(writer.set(0, values));
            writer.write(0, after);
            writer.write(0, &[Part::Read, Leave, Part::ReadAll, Free]).reads
        });
    let message = "{} is {} with values set before Initialization Mode, {} with values set in it";
    let differ = checker.differ_by(LAST_DIGITS, &before, &within, message);
    checker.check("start_values.when", writer.sequence, move |run| {
        let succeeded = sets.iter().all(|id| run.succeeds(*id));
        if succeeded { differ(run) } else { None }
    })
}

/// Returns a criterion: if the calls `ids` succeeded, the getters `reads` must return `values`. `has` is the verb of the message.
pub fn values_are_kept(
    checker: &Checker,
    ids: Vec<u32>,
    reads: Vec<Read>,
    values: Vec<(usize, Values)>,
    has: &'static str,
) -> Box<dyn Criterion> {
    let description = checker.description.clone();
    Box::new(move |run: &Run| {
        let succeeded = ids.iter().all(|id| run.succeeds(*id));
        values.iter().filter(|_| succeeded).find_map(|(index, value)| {
            let read = value_of(run, &reads, *index)?;
            read.differ_beyond(value, LAST_DIGITS, |_| 0.0)?;
            let name = &description.variables[*index].name;
            Some(format!("{name} was set to {} and {has} {}", value.show(0), read.show(0)))
        })
    })
}

/// Checks that getters return values that were set between the parts `before` and `after`. If these end in Initialization Mode, variables
/// that cannot be read in it are read after it, unless they may change.
fn read_back(
    checker: &Checker,
    trajectory: &Trajectory,
    (before, after, initializing): (&[Part], &[Part], bool),
    values: Vec<(usize, Values)>,
) -> anyhow::Result<()> {
    let description = &checker.description;
    let mut writer = checker.writer(trajectory);
    writer.write(0, before);
    let mut sets = writer.set(0, &values);
    writer.write(0, after);
    let is_early =
        |(index, _): &(usize, Values)| !initializing || description.is_readable_while_initializing(*index);
    let (early, mut late): (Vec<_>, Vec<_>) = values.iter().cloned().partition(is_early);
    let mut reads = read_variables(&mut writer, &early);
    late.retain(|(index, _)| !may_change(&description.variables[*index]));
    if !late.is_empty() {
        sets.extend(writer.write(0, &[Part::Call("ExitInitializationMode")]).ids);
        reads.extend(read_variables(&mut writer, &late));
    }
    checker.check("start_values.set", writer.sequence, values_are_kept(checker, sets, reads, values, "reads"))
}

/// Reads the variables of these values.
fn read_variables(writer: &mut Writer, values: &[(usize, Values)]) -> Vec<Read> {
    writer.read_anyway(0, &values.iter().map(|(index, _)| *index).collect::<Vec<_>>())
}

/// Checks that inputs keep their values through steps and events.
fn inputs(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let mut writer = checker.writer(trajectory);
    writer.begin(0);
    let mut criteria = Vec::new();
    for point in &trajectory.points {
        let ids = writer.point(0, point);
        let reads = read_variables(&mut writer, &point.inputs);
        criteria.push(values_are_kept(checker, ids, reads, point.inputs.clone(), "has become"));
    }
    checker.check("start_values.inputs", writer.sequence, any(criteria))
}
