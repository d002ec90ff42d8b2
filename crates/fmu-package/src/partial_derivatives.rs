//! Compares the partial derivatives that a model provides with difference quotients of its values.

use crate::check::Starts;
use crate::instance::{Instance, Saved};
use crate::model::LoadedModel;
use crate::sample::{Point, Sampler, model_at};
use crate::table::Attributes;
use anyhow::{Result, bail};
use fmi_abi::{BaseType, Interface, Standard};
use std::sync::PoisonError;

/// Number of points at which derivatives are compared. A derivative is rejected only if it is wrong at two of them, because one
/// point may happen to be next to a kink.
const POINTS: usize = 16;

/// Rejects a model whose partial derivatives differ from difference quotients of its values. If `running`, they are compared in
/// Continuous-Time Mode, or at communication points if the model offers only Co-Simulation; else in Initialization Mode. Derivatives by a
/// known that were compared for the other FMI version are not compared again.
pub(crate) fn check(
    model: &LoadedModel,
    starts: &Starts,
    running: bool,
    unknowns: &[u32],
    knowns: &[u32],
) -> Result<()> {
    let table = &model.table;
    if !table.partials {
        return Ok(());
    }
    let is_real = |index: &u32| table.variable(*index).is_none_or(|known| known.base() == BaseType::Real);
    let unknowns: Vec<u32> = unknowns.iter().copied().filter(is_real).collect();
    let mut compared = model.compared.lock().unwrap_or_else(PoisonError::into_inner);
    let is_new = |known: &u32| !compared.contains(&(running, *known));
    let knowns: Vec<u32> = knowns.iter().copied().filter(is_real).filter(is_new).collect();
    if unknowns.is_empty() || knowns.is_empty() {
        return Ok(());
    }
    let mut sampler = Sampler::new(model, starts.clone(), false);
    sampler.running = running;
    let mut points = Vec::new();
    for _ in 0..POINTS {
        let (mut point, mut instance) = sampler.draw(None, true, |_| true)?;
        // In Co-Simulation, a value that is set may take effect only in the next step, so Model Exchange is preferred.
        if running && table.model_exchange.is_some() && point.interface != Interface::ModelExchange {
            point.interface = Interface::ModelExchange;
            let Ok(same) = model_at(model, &point, running, Standard::Fmi3) else { continue };
            instance = same;
        }
        if let Ok(saved) = instance.save() {
            points.push(Base { saved, instance, point });
        }
    }
    let sizes = sizes(model, &unknowns, &mut points);
    let mut wrong = Vec::new();
    for (number, known) in knowns.iter().enumerate() {
        model.monitor.progress("compares the partial derivatives by each variable", number, knowns.len());
        let check = Check { model, running, unknowns: &unknowns, known: *known };
        let found = check.wrong(&mut points, &sizes).into_iter().enumerate();
        wrong.extend(found.filter_map(|(unknown, pair)| Some((unknown, number, pair?))));
    }
    let Some((unknown, known, (provided, found))) =
        wrong.into_iter().min_by_key(|(unknown, known, _)| (*unknown, *known))
    else {
        compared.extend(knowns.into_iter().map(|known| (running, known)));
        return Ok(());
    };
    let known = knowns[known];
    let (function, mode) = match (known == table.time(), running) {
        (true, _) => ("partial_by_time", ""),
        (_, true) => ("partial", ""),
        (_, false) => ("initial_partial", " in Initialization Mode"),
    };
    bail!(
        "the derivative of {} with respect to {}{mode} is {provided:.6e} by Partials::{function}, but {found:.6e} by \
         differences of the values",
        table.name(unknowns[unknown]),
        table.name(known)
    );
}

/// An instance at a point, and its saved state, which is restored after each change.
struct Base<'a> {
    point: Point,
    instance: Instance<'a>,
    saved: Saved,
}

/// Returns the largest absolute value of each unknown at the points, or its nominal value if that is larger.
fn sizes(model: &LoadedModel, unknowns: &[u32], points: &mut [Base]) -> Vec<f64> {
    let nominal = |index: &u32| match model.table.variables[*index as usize].variable_type.attributes {
        Attributes::Real { nominal, .. } => nominal.unwrap_or_default(),
        _ => 0.0,
    };
    let mut sizes: Vec<f64> = unknowns.iter().map(nominal).collect();
    for base in points {
        let values = base.instance.reals(unknowns);
        sizes.iter_mut().zip(values).for_each(|(size, value)| *size = size.max(value.abs()));
    }
    sizes
}

/// The comparison of the derivatives with respect to one known.
struct Check<'a> {
    model: &'a LoadedModel,
    running: bool,
    unknowns: &'a [u32],
    known: u32,
}

impl Check<'_> {
    /// Returns for each unknown the derivative that the model provides and the difference quotient at the first point at which they
    /// differ. Returns `None` if they differ at fewer than two points, or if the model does not provide the derivative at every point.
    fn wrong(&self, points: &mut [Base], sizes: &[f64]) -> Vec<Option<(f64, f64)>> {
        let mut wrong: Vec<Vec<(f64, f64)>> = vec![Vec::new(); self.unknowns.len()];
        let mut is_provided = vec![true; self.unknowns.len()];
        let variable =
            self.model.table.variable(self.known).filter(|_| self.known != self.model.table.time());
        for base in points {
            let partials = base.instance.partials(self.unknowns, self.known);
            is_provided
                .iter_mut()
                .zip(&partials)
                .for_each(|(is_provided, partial)| *is_provided &= partial.is_some());
            if partials.iter().all(Option::is_none) {
                continue;
            }
            let at = match variable {
                Some(known) => base.instance.reals(&self.model.table.array(self.known))[known.element],
                None => base.point.time,
            };
            if at.is_nan() {
                continue;
            }
            let scale = match at.abs() {
                0.0 => variable.map_or(1.0, |known| known.variable_type.nominal_or_one()),
                size => size,
            };
            // Central differences with two widths. How much they differ shows how inaccurate they are.
            let mut slopes = |width: f64| -> Option<Vec<f64>> {
                let pairs = self.values(base, at + width)?.into_iter().zip(self.values(base, at - width)?);
                Some(pairs.map(|(above, below)| (above - below) / (2.0 * width)).collect())
            };
            let (Some(wide), Some(narrow)) = (slopes(1e-3 * scale), slopes(5e-4 * scale)) else { continue };
            for (number, partial) in partials.iter().enumerate() {
                let (Some(partial), wide, narrow) = (*partial, wide[number], narrow[number]) else {
                    continue;
                };
                // In Co-Simulation, only the start time can be varied. If a model depends on the time since the start, this
                // difference is zero, so it proves nothing.
                let is_unknown =
                    variable.is_none() && base.point.interface == Interface::CoSimulation && narrow == 0.0;
                if !(wide - narrow).is_finite() || is_unknown {
                    continue;
                }
                let tolerance = 1e-5 * partial.abs().max(narrow.abs())
                    + 10.0 * (wide - narrow).abs()
                    + 1e-7 * sizes[number] / scale;
                if partial.is_nan() || (partial - narrow).abs() > tolerance {
                    wrong[number].push((partial, narrow));
                }
            }
        }
        let first = |(wrong, is_provided): (Vec<_>, bool)| {
            wrong.first().copied().filter(|_| is_provided && wrong.len() > 1)
        };
        wrong.into_iter().zip(is_provided).map(first).collect()
    }

    /// Returns the unknowns at a point after setting the known to another value; `None` if the model rejects that value, or if the known
    /// cannot be varied at this point.
    fn values(&self, base: &mut Base, value: f64) -> Option<Vec<f64>> {
        let is_time = self.known == self.model.table.time();
        if is_time && base.point.interface == Interface::CoSimulation {
            // An importer can set the time only in Model Exchange, so the derivative is tested there if the FMU supports it.
            // Otherwise, another instance starts at the other time.
            if self.model.table.model_exchange.is_some() {
                return None;
            }
            let point = Point { time: value, ..base.point.clone() };
            let mut instance = model_at(self.model, &point, self.running, Standard::Fmi3).ok()?;
            return Some(instance.reals(self.unknowns));
        }
        let instance = &mut base.instance;
        let changed = match is_time {
            true => instance.set_time(value).ok(),
            false => self.change(instance, value),
        };
        let values = changed.map(|()| instance.reals(self.unknowns));
        instance.restore(base.saved).ok()?;
        values
    }

    fn change(&self, instance: &mut Instance, value: f64) -> Option<()> {
        let table = &self.model.table;
        let variable = table.variable(self.known)?;
        if self.running && instance.interface == Interface::ModelExchange {
            // In Event Mode, any input can be set.
            instance.enter_event_mode().ok()?;
        }
        if self.running && variable.state {
            let mut states = instance.states().ok()?;
            states[table.states.iter().position(|(state, _)| *state == self.known)?] = value;
            return instance.set_states(&states).ok();
        }
        // An array is set as a whole.
        let array = table.array(self.known);
        let mut values = instance.reals(&array);
        values[variable.element] = value;
        instance.set_reals(&array, &values).ok()
    }
}
