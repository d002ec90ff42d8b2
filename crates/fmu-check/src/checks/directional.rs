//! Checks that directional and adjoint derivatives are consistent, and that they equal differences.

use super::derivatives::{
    MOST_KNOWNS, declared, knowns, names, numbers_if_ok, references, request_derivatives, to_middle, unknowns,
};
use super::differences::differences;
use crate::call_sequence::Run;
use crate::checker::Checker;
use crate::finding::Criterion;
use crate::values::other_numbers;
use crate::writer::Trajectory;
use fmi_abi::Causality;

/// Checks partial derivatives in the middle of a simulation. Requesting them must not change a variable. Directional derivatives
/// must be linear in the seed and independent of the order of the variables, and adjoint derivatives must be the transposed
/// directional ones. The directional derivatives, or the adjoint ones if there are no others, must equal differences.
pub fn directional(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let [has_directional, has_adjoint] = declared(checker, trajectory.interface);
    let unknowns = unknowns(&checker.description, trajectory.interface);
    let mut all_knowns = knowns(&checker.description, trajectory.interface);
    all_knowns.truncate(MOST_KNOWNS);
    let knowns = &all_knowns[..all_knowns.len().min(checker.at_most(40))];
    if !has_directional && !has_adjoint || unknowns.is_empty() || knowns.is_empty() {
        return Ok(());
    }
    let mut writer = checker.writer(trajectory);
    writer.write(0, &to_middle(trajectory));
    let before = writer.read(0);
    let [unknown_references, known_references] =
        [&unknowns[..], knowns].map(|indices| references(&checker.description, indices));
    let mut request = |function: &str, seed: &[f64], count: usize| {
        request_derivatives(&mut writer, function, &unknown_references, &known_references, seed, count)
    };
    let unit = |index: usize, count: usize| -> Vec<f64> {
        (0..count).map(|position| f64::from(u8::from(position == index))).collect()
    };
    let columns: Vec<u32> = (0..knowns.len() * usize::from(has_directional))
        .map(|index| request("GetDirectionalDerivative", &unit(index, knowns.len()), unknowns.len()))
        .collect();
    let sum = has_directional
        .then(|| request("GetDirectionalDerivative", &vec![1.0; knowns.len()], unknowns.len()));
    let rows: Vec<u32> = (0..unknowns.len() * usize::from(has_adjoint))
        .map(|index| request("GetAdjointDerivative", &unit(index, unknowns.len()), knowns.len()))
        .collect();
    let after = writer.read(0);
    let sequence = writer.sequence.clone();
    let message = "{} was {}, after derivatives were requested it is {}";
    let is_unchanged = checker.differ(&before, &after, message);
    let run = checker.evaluate("derivatives.changed", sequence.clone(), is_unchanged)?;
    if run.end != crate::call_sequence::End::Done {
        return Ok(());
    }
    let names = [&unknowns[..], knowns].map(|indices| names(&checker.description, indices));
    if let Some(sum) = sum {
        let criterion = is_linear(columns.clone(), sum, names[0].clone());
        checker.record("derivatives.linear", &run, &sequence, criterion);
        let rules = [("derivatives.adjoint", 1e-6), ("derivatives.adjoint-digits", 1e-11)];
        rules.into_iter().filter(|_| has_adjoint).any(|(name, tolerance)| {
            let criterion = is_transposed(columns.clone(), rows.clone(), names.clone(), tolerance);
            checker.record(name, &run, &sequence, criterion)
        });
        order(checker, trajectory, &unknown_references, &known_references)?;
    }
    // Mistakes may show only with other parameters, for example if two of them start with the same value.
    let parameters = other_numbers(&checker.description, &[Causality::Parameter]);
    differences(checker, trajectory, &unknowns, &all_knowns, has_directional, &[])?;
    if parameters.is_empty() {
        return Ok(());
    }
    differences(checker, trajectory, &unknowns, &all_knowns, has_directional, &parameters)
}

/// Returns the criterion that the derivatives for unit seeds (`columns`) add up to the derivative for a seed of ones (`sum`).
fn is_linear(columns: Vec<u32>, sum: u32, names: Vec<String>) -> impl Criterion {
    move |run: &Run| {
        let columns: Vec<Vec<f64>> =
            columns.iter().map(|id| numbers_if_ok(run, *id)).collect::<Option<_>>()?;
        let together = numbers_if_ok(run, sum)?;
        (0..names.len()).find_map(|row| {
            let added: f64 = columns.iter().map(|column| column[row]).sum();
            let scale: f64 = columns.iter().map(|column| column[row].abs()).sum();
            let off = (added - together[row]).abs() > 1e-6 * scale.max(1e-12);
            off.then(|| {
                format!(
                    "the derivatives of {} add up to {added:?}, requested together they are {:?}",
                    names[row], together[row]
                )
            })
        })
    }
}

/// Returns the criterion that the adjoint derivatives (`rows`) are the transposed directional derivatives (`columns`), up to this relative
/// tolerance.
fn is_transposed(
    columns: Vec<u32>,
    rows: Vec<u32>,
    names: [Vec<String>; 2],
    tolerance: f64,
) -> impl Criterion {
    move |run: &Run| {
        let matrix = |ids: &[u32]| ids.iter().map(|id| numbers_if_ok(run, *id)).collect::<Option<Vec<_>>>();
        let (columns, rows) = (matrix(&columns)?, matrix(&rows)?);
        let [unknowns, knowns] = &names;
        for (row, name) in unknowns.iter().enumerate() {
            for (column, known) in knowns.iter().enumerate() {
                let (one, other) = (columns[column][row], rows[row][column]);
                if (one - other).abs() > tolerance * one.abs().max(other.abs()).max(1e-300) {
                    return Some(format!(
                        "the derivative of {name} with respect to {known} is {one:?}, the adjoint one {other:?}"
                    ));
                }
            }
        }
        None
    }
}

/// Checks that directional derivatives do not depend on the order in which unknowns and knowns are listed.
fn order(checker: &Checker, trajectory: &Trajectory, unknowns: &[u32], knowns: &[u32]) -> anyhow::Result<()> {
    let reversed = |list: &[u32]| list.iter().rev().copied().collect::<Vec<_>>();
    let seed: Vec<f64> = (1..=knowns.len()).map(|number| number as f64).collect();
    let reversed_seed: Vec<f64> = seed.iter().rev().copied().collect();
    let mut writer = checker.writer(trajectory);
    writer.write(0, &to_middle(trajectory));
    let name = "GetDirectionalDerivative";
    let one = request_derivatives(&mut writer, name, unknowns, knowns, &seed, unknowns.len());
    let other = request_derivatives(
        &mut writer,
        name,
        &reversed(unknowns),
        &reversed(knowns),
        &reversed_seed,
        unknowns.len(),
    );
    checker.check("derivatives.order", writer.sequence, move |run| {
        let (one, other) = (numbers_if_ok(run, one)?, numbers_if_ok(run, other)?);
        let scale = one.iter().fold(0.0_f64, |greatest, number| greatest.max(number.abs()));
        let off = |(one, other): (&f64, &f64)| (one - other).abs() > 1e-6 * scale;
        let at = one.iter().zip(other.iter().rev()).position(off)?;
        let (is, reversed, number) = (one[at], other[other.len() - 1 - at], at + 1);
        Some(format!(
            "derivative {number} is {is:?}, and {reversed:?} when variables are named in reverse order"
        ))
    })
}
