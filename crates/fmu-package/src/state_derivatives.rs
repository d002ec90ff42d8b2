//! Checks that the continuous states of a model follow their derivatives, and that states, parameters and exact outputs do not change when
//! values are calculated.
//!
//! The author writes the steps of Co-Simulation and the derivatives of Model Exchange separately, and the compiler cannot detect that
//! one of them has a wrong sign or factor, or uses the wrong state. So the change of each state in short steps is compared with its
//! derivative.

use crate::check::Starts;
use crate::instance::{Instance, Saved};
use crate::model::LoadedModel;
use crate::sample::Sampler;
use crate::table::{Table, Unit, Variable};
use anyhow::{Result, bail, ensure};
use fmi_abi::{Causality, Interface, Value};

/// Number of instances with random values that are checked.
const INSTANCES: usize = 8;
/// Numbers of steps after which each instance is checked.
const CHECKED_AFTER: [usize; 3] = [0, 1, 4];
/// Sizes of steps, as fractions of the default step size. The smallest are for models with very fast states. The second one detects a
/// model that ignores the size of the step and always uses the default step size.
const SIZES: [f64; 8] = [1.0, 0.618, 0.25, 1e-2, 1e-3, 1e-4, 1e-6, 1e-8];
/// Largest relative difference at which the change of a state agrees with its derivative. They must agree in the shortest step that can be
/// compared, or in two steps.
const TOLERANCE: f64 = 0.01;
/// Number of points at which a state must disagree to be rejected. It is accepted if it agrees at any point.
const DISAGREEMENTS: usize = 3;

/// Rejects a model whose states do not follow their derivatives, have derivatives in another unit, or change when values are calculated.
pub(crate) fn check(model: &LoadedModel, starts: &Starts) -> Result<()> {
    let table = &model.table;
    check_units(table)?;
    let (states, rates): (Vec<u32>, Vec<u32>) = table.states.iter().copied().unzip();
    let mut found = vec![Found::default(); states.len()];
    let mut sampler = Sampler::new(model, starts.clone(), false);
    for number in 0..INSTANCES {
        model.monitor.progress("compares steps with the derivatives of the states", number, INSTANCES);
        // A model that rejects its start values is reported later.
        let Ok((point, mut instance)) = sampler.draw(None, true, |_| true) else { return Ok(()) };
        if instance.initialized().and_then(|()| instance.run()).is_err() {
            continue;
        }
        if point.interface == Interface::ModelExchange {
            check_setting(table, &mut instance)?;
            check_reading(table, &mut instance)?;
            continue;
        }
        for steps in 0..=CHECKED_AFTER[CHECKED_AFTER.len() - 1] {
            if CHECKED_AFTER.contains(&steps) {
                check_reading(table, &mut instance)?;
                let Ok(saved) = instance.save() else { break };
                compare(&mut instance, saved, [&states, &rates], &mut found);
                if instance.restore(saved).is_err() {
                    break;
                }
            }
            if !matches!(instance.step(table.info.step_size), Ok(true)) {
                break;
            }
        }
    }
    let wrong = (0..).zip(&found).find(|(_, found)| found.agreed == 0 && found.disagreed >= DISAGREEMENTS);
    if let Some((number, Found { example: [change, rate], .. })) = wrong {
        let (state, rate_of) = table.states[number as usize];
        bail!(
            "{} changes by {change:.6e} per second in a step, but its derivative {} is {rate:.6e}; compare `step` with `by` of the \
             derivative, its `derivative_of`, and the size of the inner steps",
            table.name(state),
            table.name(rate_of)
        );
    }
    Ok(())
}

/// Results of the comparisons of a state with its derivative.
#[derive(Clone, Default)]
struct Found {
    agreed: usize,
    disagreed: usize,
    /// The change per second and the derivative in the first disagreement.
    example: [f64; 2],
}

/// Compares the change of each state in steps of several sizes with the mean of its derivatives before and after the step. Adds the
/// results to `found`.
fn compare(instance: &mut Instance, saved: Saved, [states, rates]: [&[u32]; 2], found: &mut [Found]) {
    let default = instance.default_step_size();
    let sizes = &SIZES[..if instance.has_variable_step_size() { SIZES.len() } else { 1 }];
    // Whether the shortest step that can be compared agrees. It decides for very fast states.
    let mut shortest = vec![false; states.len()];
    let [before, slopes] = [states, rates].map(|of| instance.reals(of));
    let mut agreed = vec![0; states.len()];
    let mut examples = vec![None; states.len()];
    for size in sizes.iter().map(|part| part * default) {
        if instance.restore(saved).is_err() || !matches!(instance.step(size), Ok(true)) {
            continue;
        }
        // The sum of time and step size is rounded, so the step may have another size.
        let size = instance.time - saved.time;
        let [after, later] = [states, rates].map(|of| instance.reals(of));
        for number in 0..states.len() {
            let change = (after[number] - before[number]) / size;
            let rate = 0.5 * (slopes[number] + later[number]);
            let scale = change.abs().max(slopes[number].abs()).max(later[number].abs());
            let rounding = 8.0 * f64::EPSILON * before[number].abs().max(after[number].abs()) / size;
            // Rounding errors hide very small changes, so these cannot be compared. The negation also skips NaN.
            if !(rounding < 0.1 * TOLERANCE * scale && scale.is_finite()) {
                continue;
            }
            shortest[number] = (change - rate).abs() <= TOLERANCE * scale;
            if shortest[number] {
                agreed[number] += 1;
            } else {
                examples[number] = Some([change, rate]);
            }
        }
    }
    for (number, found) in found.iter_mut().enumerate() {
        if agreed[number] > 1 || shortest[number] {
            found.agreed += 1;
        } else if let Some(example) = examples[number] {
            if found.disagreed == 0 {
                found.example = example;
            }
            found.disagreed += 1;
        }
    }
}

/// Rejects a model whose states differ from the values that an importer has set.
fn check_setting(table: &Table, instance: &mut Instance) -> Result<()> {
    let Ok(mut states) = instance.states() else { return Ok(()) };
    for ((index, _), state) in table.states.iter().zip(&mut states) {
        let nominal = table.variables[*index as usize].variable_type.nominal_or_one();
        *state += if *state == 0.0 { 0.5 * nominal } else { 0.5 * state.abs() };
    }
    if instance.set_states(&states).is_err() {
        return Ok(());
    }
    let values = instance.values();
    for ((index, _), set) in table.states.iter().zip(&states) {
        let found = &values[*index as usize];
        ensure!(
            *found == Value::Real(*set) || is_nan(found),
            "the importer sets {} to {}, and reads {found}: `calculate` must not change states",
            table.name(*index),
            Value::Real(*set)
        );
    }
    Ok(())
}

fn is_nan(value: &Value) -> bool {
    matches!(value, Value::Real(value) if value.is_nan())
}

/// Rejects a model whose states, parameters or exact outputs change when values are calculated again.
fn check_reading(table: &Table, instance: &mut Instance) -> Result<()> {
    let before = instance.values();
    // The model calculates its values again after any value is set, even to the same value.
    let is_input = |variable: &Variable| variable.causality == Causality::Input;
    let values: Vec<_> = before.iter().cloned().map(Some).collect();
    if instance.interface == Interface::CoSimulation {
        let _ = instance.set(&values, is_input);
    } else {
        let _ = instance.set_time(instance.time);
    }
    let after = instance.values();
    for ((variable, before), after) in table.variables.iter().zip(&before).zip(&after) {
        ensure!(
            before == after || is_nan(before) || !(variable.state || variable.is_exact()),
            "{} is {before} and, read again without a step or an event, {after}: `calculate` must not change states, parameters \
             or exact outputs",
            variable.name
        );
    }
    Ok(())
}

/// Rejects a derivative whose unit is not the unit of its state per second. A variable without a unit is not checked, and the radian
/// may be left out.
fn check_units(table: &Table) -> Result<()> {
    for &(state, rate) in &table.states {
        let of = |index: u32| table.variable(index).and_then(|variable| variable.variable_type.unit());
        let (Some(unit), Some(unit_of_rate)) = (of(state), of(rate)) else { continue };
        let has_unit = |unit: &Unit| unit.exponents.iter().any(|exponent| *exponent != 0);
        if !has_unit(unit_of_rate) || !has_unit(unit) && unit.factor == 1.0 && unit.name != "1" {
            continue;
        }
        let mut expected = unit.exponents.clone();
        expected[2] -= 1;
        let [expected, found] =
            [&expected, &unit_of_rate.exponents].map(|exponents| with_exponents(exponents));
        let [name, name_of_rate] = [state, rate].map(|index| table.name(index));
        ensure!(
            expected == found,
            "{name_of_rate} is in {} ({found}), but {name} is in {}, so the unit of its derivative has the exponents {expected}",
            unit_of_rate.name,
            unit.name
        );
        ensure!(
            (unit.factor - unit_of_rate.factor).abs() <= 1e-9 * unit.factor.abs(),
            "{name_of_rate} is in {}, whose factor is {}, but {name} is in {}, whose factor is {}; importers integrate the numbers, so \
             both factors must be equal",
            unit_of_rate.name,
            unit_of_rate.factor,
            unit.name,
            unit.factor
        );
    }
    Ok(())
}

/// Returns exponents as they are written in a unit, without the radian: `kg.m2.s-2`.
fn with_exponents(exponents: &[i64]) -> String {
    let names = ["kg", "m", "s", "A", "K", "mol", "cd"];
    let factors = names.iter().zip(exponents).filter(|(_, exponent)| **exponent != 0);
    let factors = factors.map(|(name, exponent)| match exponent {
        1 => (*name).to_owned(),
        _ => format!("{name}{exponent}"),
    });
    let text = factors.collect::<Vec<_>>().join(".");
    if text.is_empty() { "none".to_owned() } else { text }
}
