//! Checks that numbers of double precision are not stored with single precision.

use crate::call_sequence::{Run, Values};
use crate::checker::Checker;
use crate::finding::any;
use crate::values::near;
use crate::writer::Part::{Begin, Enter, Free, Make, Points};
use crate::writer::{Part, Read, Trajectory, value_of};
use fmi_abi::BaseType;

/// Minimum number of different values of an output: with fewer, single precision may be a coincidence.
const VALUES: usize = 8;

fn single(number: f64) -> f64 {
    f64::from(number as f32)
}

/// Checks values that are set: if a getter returns two values of a variable exactly as rounded to single precision, they are stored so. A
/// conversion of units changes only the last digits of double precision, so it is not mistaken for that.
pub fn set(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let description = &checker.description;
    let mut indices = checker.readable.clone();
    indices.retain(|index| {
        let of = &description.variables[*index];
        let settable = of.causality == "input" || of.initial == "exact" && of.variability != "constant";
        settable && !of.clocked && of.base == Some(BaseType::Real) && !of.start.is_empty()
    });
    let mut writer = checker.writer(trajectory);
    let mut all = Vec::new();
    for by in [1.0 / 7.0, 1.0 / 11.0] {
        let value = |index: &usize| {
            let of = &description.variables[*index];
            let number = |start: f64| Some(near(of, start, by)).filter(|number| single(*number) != *number);
            let numbers: Vec<f64> = of.starts().into_iter().map(number).collect::<Option<_>>()?;
            Some((*index, Values::new(description.kind(*index), numbers)))
        };
        let values: Vec<(usize, Values)> = indices.iter().filter_map(value).collect();
        let is_input = |(index, _): &&(usize, Values)| {
            let of = &description.variables[*index];
            of.causality == "input" && of.variability == "continuous" && !of.once_per_instant
        };
        let inputs: Vec<(usize, Values)> = values.iter().filter(is_input).cloned().collect();
        for (before, values) in [(&[Make, Enter][..], values), (&[Begin, Points(2)], inputs)] {
            writer.write(0, before);
            writer.set(0, &values);
            let reads = writer.read_anyway(0, &values.iter().map(|(index, _)| *index).collect::<Vec<_>>());
            writer.write(0, &[Free]);
            all.push((values, reads));
        }
    }
    let model = description.clone();
    let of_variables = move |run: &Run| {
        let is_single = |(values, reads): &(Vec<(usize, Values)>, Vec<Read>), variable: usize| {
            let (_, set) = values.iter().find(|(index, _)| *index == variable)?;
            is_rounded(&set.numbers(), &value_of(run, reads, variable)?.numbers())
        };
        indices.iter().find_map(|variable| {
            let found: Vec<(f64, f64)> = all.iter().filter_map(|of| is_single(of, *variable)).collect();
            let (set, read) = *found.first().filter(|_| found.len() > 1)?;
            let name = &model.variables[*variable].name;
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

/// Returns the number that was set and the number that was read, if the latter is the former, rounded to single precision.
fn is_rounded(set: &[f64], read: &[f64]) -> Option<(f64, f64)> {
    let rounded = |(set, read): &(f64, f64)| *read == single(*set) && read != set;
    set.iter().copied().zip(read.iter().copied()).find(rounded)
}

/// Writes states that are set in Model Exchange; returns the criterion for them.
fn states(
    checker: &Checker,
    trajectory: &Trajectory,
    writer: &mut crate::writer::Writer,
) -> Option<Box<dyn crate::finding::Criterion>> {
    let count = checker.description.states_count().filter(|count| *count > 0)?;
    let point =
        trajectory.points.get(1).filter(|point| !trajectory.is_stepped() && point.states.len() == count)?;
    writer.write(0, &[Begin, Points(2)]);
    let vectors = [1.0 / 7.0, 1.0 / 11.0].map(|by| {
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
            let rounded = |(set, read): &(f64, f64)| *read == single(*set) && read != set;
            (rounded(one) && rounded(other)).then(|| {
                let number = index + 1;
                format!(
                    "state {number} was set to {:?} and is {:?}, the same number with single precision",
                    one.0, one.1
                )
            })
        })
    }))
}

/// Returns whether a number is exact in single precision, although it has more digits than a number that people choose.
fn is_long_single(number: f64) -> bool {
    number.is_finite() && single(number) == number && number.to_bits().trailing_zeros() < 40
}

/// Checks that outputs have digits beyond single precision.
fn outputs(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let description = &checker.description;
    let mut indices = checker.readable.clone();
    indices.retain(|index| {
        let of = &description.variables[*index];
        of.base == Some(BaseType::Real)
            && of.causality == "output"
            && of.variability == "continuous"
            && !of.clocked
    });
    let mut writer = crate::writer::Writer::new(description, trajectory, &indices);
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
            let mut long: Vec<u64> =
                all.iter().filter(|number| is_long_single(**number)).map(|number| number.to_bits()).collect();
            long.sort_unstable();
            long.dedup();
            let only = all.iter().all(|number| single(*number) == *number);
            let number = f64::from_bits(*long.first().filter(|_| only && long.len() >= VALUES)?);
            let name = &description.variables[*variable].name;
            Some(format!("all values of {name} have single precision, for example {number:?}"))
        })
    })
}
