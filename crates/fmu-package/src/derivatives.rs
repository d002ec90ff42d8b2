//! The partial derivatives that a model offers, compared with differences of its values.

use crate::check::Starts;
use crate::sample::{Sampler, model_at};
use anyhow::{Result, bail};
use fmu_export::fmi3::independent;
use fmu_export::{Attributes, BaseType, Exported, Interface, Value, Variable};

/// So many points are tried; a derivative must be wrong at two of them, one may lie at a kink.
const POINTS: usize = 16;

/// Refuses a model whose partial derivatives are not those of its values, at a communication point or in Continuous-Time
/// Mode if `running`, else in Initialization Mode.
pub(crate) fn check<M: Exported>(
    starts: &Starts,
    running: bool,
    unknowns: &[u32],
    knowns: &[u32],
) -> Result<()> {
    if !M::PARTIALS {
        return Ok(());
    }
    let mut sampler = Sampler::<M>::new(starts.clone(), false);
    sampler.running = running;
    let mut points = Vec::new();
    for _ in 0..POINTS {
        let (mut point, mut model) = sampler.draw(None, true, |_| true)?;
        // What is set in Co-Simulation may act in the step that follows.
        if running && M::MODEL_EXCHANGE.is_some() && point.interface != Interface::ModelExchange {
            point.interface = Interface::ModelExchange;
            let Ok(same) = model_at::<M>(&point, running) else { continue };
            model = same;
        }
        points.push((model, point.time));
    }
    let is_real = |vr: &&u32| M::TABLE.get(**vr as usize).is_none_or(|of| of.base() == BaseType::Real);
    for unknown in unknowns.iter().filter(is_real) {
        for known in knowns.iter().filter(is_real) {
            check_pair(&points, running, *unknown, *known)?;
        }
    }
    Ok(())
}

fn check_pair<M: Exported>(points: &[(M, f64)], running: bool, unknown: u32, known: u32) -> Result<()> {
    let (time, of_time) = independent::<M>();
    let of = &M::TABLE[unknown as usize];
    let nominal = match of.variable_type().attributes {
        Attributes::Real { nominal, .. } => nominal.unwrap_or_default(),
        _ => 0.0,
    };
    let size = points.iter().filter_map(|(model, _)| real(of, model)).fold(nominal, |a, b| a.max(b.abs()));
    let mut wrong = Vec::new();
    for (model, now) in points {
        let by = (known != time).then(|| M::element(known));
        let Some(said) = model.exported_partials(by, !running)(M::element(unknown)) else {
            return Ok(());
        };
        let variable = M::TABLE.get(known as usize).filter(|_| known != time);
        let Some(at) = variable.map_or(Some(*now), |known| real(known, model)) else { continue };
        let scale = if at == 0.0 {
            variable.map_or(1.0, |known| known.variable_type().nominal_or_one())
        } else {
            at.abs()
        };
        let value = |offset: f64| {
            let mut model = model.clone();
            let time = match variable {
                Some(known) => {
                    known.set(&mut model, &Value::Real(at + offset));
                    model.calculate_start();
                    model.update().ok()?;
                    *now
                }
                None => now + offset,
            };
            model.calculate(time);
            real(of, &model).filter(|value| value.is_finite())
        };
        // Central differences of two widths: how far they are apart tells what they are worth.
        let slope = |width: f64| Some((value(width)? - value(-width)?) / (2.0 * width));
        let (Some(wide), Some(narrow)) = (slope(1e-3 * scale), slope(5e-4 * scale)) else { continue };
        let tolerance =
            1e-5 * said.abs().max(narrow.abs()) + 10.0 * (wide - narrow).abs() + 1e-7 * size / scale;
        if said.is_nan() || (said - narrow).abs() > tolerance {
            wrong.push((said, narrow));
        }
    }
    if let [(said, found), _, ..] = wrong[..] {
        let known = M::TABLE.get(known as usize).unwrap_or(of_time).name();
        let (function, mode) = match (known == of_time.name(), running) {
            (true, _) => ("partial_by_time", ""),
            (_, true) => ("partial", ""),
            (_, false) => ("initial_partial", " in Initialization Mode"),
        };
        bail!(
            "the derivative of {} with respect to {known}{mode} is {said:.6e} by Partials::{function}, but {found:.6e} by \
             differences of the values",
            of.name()
        );
    }
    Ok(())
}

fn real<M>(of: &Variable<M>, model: &M) -> Option<f64> {
    match of.value(model) {
        Some(Value::Real(value)) => Some(value),
        _ => None,
    }
}
