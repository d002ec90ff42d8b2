//! Checks that an FMU does not store numbers of double precision with single precision.

use crate::call_sequence::{Run, Values};
use crate::checker::Checker;
use crate::finding::{Criterion, any};
use crate::values::near;
use crate::writer::Part::{Begin, Enter, Free, Make, Points};
use crate::writer::{Part, Read, Trajectory, Writer, value_of};
use fmi_abi::{BaseType, Causality, Variability};

/// Minimum number of different values of an output. Fewer values may have single precision by coincidence.
const MIN_VALUES: usize = 8;

/// Changes of the values that are set. There are two, because a getter may return one rounded value by coincidence.
const CHANGES: [f64; 2] = [1.0 / 7.0, 1.0 / 11.0];

/// Rounds a number to single precision.
fn rounded(number: f64) -> f64 {
    f64::from(number as f32)
}

/// Values that were set, and the reads of their variables.
struct SetAndRead {
    values: Vec<(usize, Values)>,
    reads: Vec<Read>,
}

impl SetAndRead {
    /// Returns the number that was set and the number that was read, if a number of this variable was rounded.
    fn rounded(&self, run: &Run, variable: usize) -> Option<(f64, f64)> {
        let (_, set) = self.values.iter().find(|(index, _)| *index == variable)?;
        first_rounded(&set.numbers(), &value_of(run, &self.reads, variable)?.numbers())
    }
}

/// Checks numbers that are set. A variable is stored with single precision if a getter returns two of its values rounded to single
/// precision. A conversion of units is not mistaken for this, because it changes only the last digits of double precision.
pub fn set(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let description = checker.description.clone();
    let mut indices = checker.readable.clone();
    indices.retain(|index| {
        let of = &description.variables[*index];
        of.is_settable() && !of.clocked && of.base == Some(BaseType::Real) && !of.start.is_empty()
    });
    let mut writer = checker.writer(trajectory);
    let all = write_values(&mut writer, &indices);
    let of_variables = move |run: &Run| {
        indices.iter().find_map(|variable| {
            let found: Vec<(f64, f64)> = all.iter().filter_map(|of| of.rounded(run, *variable)).collect();
            let (set, read) = *found.first().filter(|_| found.len() > 1)?;
            let name = &description.variables[*variable].name;
            Some(format!(
                "{name} was set to {set:?} and reads {read:?}, the same number with single precision"
            ))
        })
    };
    let criteria =
        std::iter::once(Box::new(of_variables) as Box<_>).chain(states(checker, trajectory, &mut writer));
    checker.check("start_values.single", writer.sequence, any(criteria.collect::<Vec<_>>()))?;
    outputs(checker, trajectory)
}

/// Sets variables to numbers that single precision cannot represent: all of them in Initialization Mode, and continuous inputs after two
/// points.
fn write_values(writer: &mut Writer, indices: &[usize]) -> Vec<SetAndRead> {
    let description = writer.description;
    let mut all = Vec::new();
    for by in CHANGES {
        let value = |index: &usize| {
            let of = &description.variables[*index];
            let number = |start: f64| Some(near(of, start, by)).filter(|number| rounded(*number) != *number);
            let numbers: Vec<f64> = of.starts().into_iter().map(number).collect::<Option<_>>()?;
            Some((*index, Values::new(description.kind(*index), numbers)))
        };
        let values: Vec<(usize, Values)> = indices.iter().filter_map(value).collect();
        let is_input = |(index, _): &&(usize, Values)| {
            let of = &description.variables[*index];
            of.causality == Causality::Input
                && of.variability == Variability::Continuous
                && !of.once_per_instant
        };
        let inputs: Vec<(usize, Values)> = values.iter().filter(is_input).cloned().collect();
        for (before, values) in [(&[Make, Enter][..], values), (&[Begin, Points(2)], inputs)] {
            writer.write(0, before);
            writer.set(0, &values);
            let reads = writer.read_anyway(0, &values.iter().map(|(index, _)| *index).collect::<Vec<_>>());
            writer.write(0, &[Free]);
            all.push(SetAndRead { values, reads });
        }
    }
    all
}

/// Finds the first number that is read rounded to single precision. Returns the number that was set, and the number that was read.
fn first_rounded(set: &[f64], read: &[f64]) -> Option<(f64, f64)> {
    set.iter().copied().zip(read.iter().copied()).find(is_rounded)
}

/// Returns whether the second number is the first one rounded to single precision, and differs from it.
fn is_rounded((set, read): &(f64, f64)) -> bool {
    *read == rounded(*set) && read != set
}

/// Sets and reads the states of Model Exchange. Returns the criterion that they are not rounded; `None` if there are no states.
fn states(checker: &Checker, trajectory: &Trajectory, writer: &mut Writer) -> Option<Box<dyn Criterion>> {
    let count = Some(checker.description.states_count()).filter(|count| *count > 0)?;
    let point =
        trajectory.points.get(1).filter(|point| !trajectory.is_stepped() && point.states.len() == count)?;
    writer.write(0, &[Begin, Points(2)]);
    let vectors = CHANGES.map(|by| {
        let vector: Vec<f64> =
            point.states.iter().map(|state| state + by * 1e-3 * state.abs().max(1.0)).collect();
        writer.set_states(0, &vector);
        let read = writer.vector(0, "GetContinuousStates", count);
        (vector, read)
    });
    writer.free(0);
    Some(Box::new(move |run: &Run| {
        let pairs: Vec<Vec<(f64, f64)>> = vectors
            .iter()
            .map(|(set, read)| Some(set.iter().copied().zip(run.written(*read)?.numbers()).collect()))
            .collect::<Option<_>>()?;
        (0..count).find_map(|index| {
            let [one, other] = [pairs[0].get(index)?, pairs[1].get(index)?];
            (is_rounded(one) && is_rounded(other)).then(|| {
                let number = index + 1;
                format!(
                    "state {number} was set to {:?} and is {:?}, the same number with single precision",
                    one.0, one.1
                )
            })
        })
    }))
}

/// Returns whether a number is exact in single precision, but has more digits than numbers that people choose.
fn is_unusual_single(number: f64) -> bool {
    number.is_finite() && rounded(number) == number && number.to_bits().trailing_zeros() < 40
}

/// Checks that no output has only values of single precision.
fn outputs(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let description = &checker.description;
    let mut indices = checker.readable.clone();
    indices.retain(|index| {
        let of = &description.variables[*index];
        of.base == Some(BaseType::Real)
            && of.causality == Causality::Output
            && of.variability == Variability::Continuous
            && !of.clocked
    });
    let mut writer = Writer::new(description, trajectory, &indices);
    writer.begin(0);
    let mut reads = Vec::new();
    for point in &trajectory.points {
        writer.point(0, point);
        reads.push(writer.write(0, &[Part::Read]).reads);
    }
    let description = description.clone();
    checker.check("start_values.single-output", writer.sequence, move |run| {
        indices.iter().find_map(|variable| {
            let numbers = |reads: &Vec<Read>| value_of(run, reads, *variable).map(|value| value.numbers());
            let all: Vec<f64> = reads.iter().filter_map(numbers).flatten().collect();
            let mut unusual: Vec<u64> = all
                .iter()
                .filter(|number| is_unusual_single(**number))
                .map(|number| number.to_bits())
                .collect();
            unusual.sort_unstable();
            unusual.dedup();
            let all_single = all.iter().all(|number| rounded(*number) == *number);
            let number =
                f64::from_bits(*unusual.first().filter(|_| all_single && unusual.len() >= MIN_VALUES)?);
            let name = &description.variables[*variable].name;
            Some(format!("all values of {name} have single precision, for example {number:?}"))
        })
    })
}
