//! Checks the clocks and clocked variables of a batch, and what else it needs to handle events in Co-Simulation.

use super::Batch;
use super::inputs::{Inputs, checked, input_of};
use super::series::Series;
use crate::clocks::{Clock, Clocks, Fraction, Group, Held, Source};
use crate::description::Description;
use crate::error::{Error, request};
use crate::lookup::{Found, is_exact};
use crate::selection::Assigned;
use crate::system::System;
use fmi_abi::description::{Timing, Variable as Declared};
use fmi_abi::{Causality, Interface, IntervalVariability};
use std::collections::HashSet;

/// The part of a plan for an FMU with clocks, and for events in Co-Simulation.
pub(super) struct EventPlan<'a> {
    pub clocks: Clocks<'a>,
    /// Values of the clocked inputs.
    values: Vec<Series<'a, f64>>,
    /// In Co-Simulation, numeric inputs that are not continuous, which change only in Event Mode.
    pub held: Inputs<'a>,
    pub keeps_events: bool,
}

impl<'a> EventPlan<'a> {
    /// Checks the clocks of a batch. Returns `None` if the FMU runs without them: it has none, and in Co-Simulation the caller does not
    /// want events either, or it has only triggered clocks, but no event mode.
    pub fn of(system: &System, batch: &'a Batch, interface: Interface) -> Result<Option<Self>, Error> {
        let Some(fmu) = system.sole() else {
            system.check_unclocked()?;
            return unused(system, batch).map(|()| None);
        };
        let description = &*fmu.description;
        let has_event_mode = description.offer(interface).is_some_and(|offer| offer.can(&["hasEventMode"]));
        let handles_events = interface == Interface::ModelExchange || has_event_mode;
        let uses_clocks = || {
            let is_clocked = |(name, _): &(&str, _)| system.is_clocked(name);
            unused(system, batch).is_err() || batch.inputs.iter().any(is_clocked)
        };
        let mut clocks = description.written_clocks();
        match clocks.next() {
            Some(_) if handles_events => {}
            None if batch.events && has_event_mode => unused(system, batch)?,
            Some(clock) if description.needed_clock().is_some() || uses_clocks() => {
                return Err(Error::Fmu(format!(
                    "{} is a clock, but in Co-Simulation {} has no event mode (hasEventMode), which clocks need",
                    description.needed_clock().unwrap_or(&clock.name),
                    description.model_name
                )));
            }
            _ => return unused(system, batch).map(|()| None),
        }
        if batch.read_before_set {
            return request(format!(
                "read_before_set is not for runs with events, and {} has clocks",
                system.name()
            ));
        }
        let keeps_events = batch.events;
        let clocks = Clocks { all: clocks_of(description, batch)?, hold: batch.hold, ..Clocks::default() };
        let mut plan = Self { clocks, values: Vec::new(), held: Inputs::default(), keeps_events };
        plan.find_inputs(system, batch)?;
        Ok(Some(plan))
    }

    /// Adds a clocked output, with its index among all outputs of the batch.
    pub fn add_output(&mut self, name: &str, found: Found, index: usize, batch: &Batch) -> Result<(), Error> {
        check_number(name, found)?;
        if !batch.measures.is_empty() {
            return request(format!("{name} has a value only while its clock ticks, so it has no measures"));
        }
        add(&mut self.clocks.outputs, &self.clocks.all, (name, found), index)
    }

    fn find_inputs(&mut self, system: &System, batch: &'a Batch) -> Result<(), Error> {
        let mut known = Assigned::default();
        for (name, trajectory) in &batch.inputs {
            let Some(found) = system.find_clocked(name) else { continue };
            known.add(name, &[found]);
            input_of(name, &[found])?;
            check_number(name, found)?;
            let base = (found.variable.base, found.description.standard);
            add(&mut self.clocks.inputs, &self.clocks.all, (name, found), self.values.len())?;
            self.values.push(checked(name, base, *trajectory, true, batch.time)?);
        }
        known.check("inputs")
    }

    /// Returns the clocked inputs of a run.
    pub fn inputs(&'a self, run: usize, points: &'a [f64]) -> Vec<Held<'a>> {
        self.values.iter().map(|series| (series.times(points), series.of_run(run))).collect()
    }
}

/// Fails if a batch has settings for clocks.
fn unused(system: &System, batch: &Batch) -> Result<(), Error> {
    match batch.clocks.first() {
        None if !batch.hold => Ok(()),
        None => request(format!("hold is for outputs that have clocks, and {} has no clocks", system.name())),
        Some((name, _)) => request(format!("{name} is not a triggered input clock")),
    }
}

/// Fails if the values of a clocked variable are strings, bytes or 64-bit integers.
fn check_number(name: &str, found: Found) -> Result<(), Error> {
    if !is_exact(found.variable.base) {
        return Ok(());
    }
    request(format!("{name} is {} with a clock, which is not supported; FMPy reads it", found.variable.base))
}

/// Adds a clocked variable to the group with the same clocks.
fn add(
    groups: &mut Vec<Group>,
    clocks: &[Clock],
    (name, found): (&str, Found),
    index: usize,
) -> Result<(), Error> {
    let own = indices(clocks, &found.variable.clocks, name)?;
    let known = groups.iter().position(|group| group.clocks == own);
    let number = known.unwrap_or(groups.len());
    if known.is_none() {
        groups.push(Group { clocks: own, ..Group::default() });
    }
    groups[number].variables.push(name, &[found]);
    groups[number].indices.push(index);
    Ok(())
}

/// Returns the indices of clocks by their value references.
fn indices(clocks: &[Clock], references: &[u32], name: &str) -> Result<Vec<usize>, Error> {
    let index = |reference: &u32| {
        let found = clocks.iter().position(|clock| clock.reference == *reference);
        found.ok_or_else(|| {
            Error::Fmu(format!(
                "modelDescription.xml: {name} has the clock {reference}, which does not exist"
            ))
        })
    };
    references.iter().map(index).collect()
}

/// Returns the clocks of an FMU. Triggered input clocks have the times that the caller gives.
fn clocks_of<'a>(description: &Description, batch: &'a Batch) -> Result<Vec<Clock<'a>>, Error> {
    let mut given = HashSet::new();
    for (name, times) in &batch.clocks {
        if !given.insert(name) {
            return request(format!("{name} is twice among the clocks"));
        }
        let is_own =
            |of: &Declared| of.name == *name && !of.is_time_based() && of.causality == Causality::Input;
        if !description.written_clocks().any(is_own) {
            return request(format!("{name} is not a triggered input clock"));
        }
        check_times(name, times, batch.time)?;
    }
    let all = description.written_clocks().map(|of| {
        let (name, reference) = (of.name.clone(), of.reference);
        Ok(Clock { name, reference, source: source(of, batch)?, parents: Vec::new() })
    });
    let mut all = all.collect::<Result<Vec<_>, Error>>()?;
    for (index, of) in description.written_clocks().enumerate() {
        all[index].parents = indices(&all, &of.clocks, &of.name)?;
    }
    Ok(all)
}

/// Fails unless the times of a clock's ticks are finite, increase, and are not before the run.
fn check_times(name: &str, times: &[f64], points: &[f64]) -> Result<(), Error> {
    let increases = times.windows(2).all(|pair| pair[0] < pair[1]);
    if increases
        && times.iter().all(|time| time.is_finite() && points.first().is_some_and(|first| time >= first))
    {
        return Ok(());
    }
    request(format!(
        "the times of {name} must be finite, increase and not be before the first communication point"
    ))
}

/// Returns what determines the ticks of a clock.
fn source<'a>(of: &Declared, batch: &Batch<'a>) -> Result<Source<'a>, Error> {
    use IntervalVariability::*;
    let clock = of.clock.as_deref();
    let variability = clock.and_then(|clock| clock.interval_variability);
    let is_fraction = clock.is_some_and(|clock| clock.supports_fraction);
    match (of.causality, variability, clock.and_then(|clock| clock.timing)) {
        (_, None, _) => fault(of, "has no intervalVariability"),
        (Causality::Input, Some(Triggered), _) => {
            let times =
                batch.clocks.iter().find(|(name, _)| *name == of.name).map_or(&[][..], |(_, times)| times);
            Ok(Source::Given(times))
        }
        (Causality::Input, Some(Constant | Fixed | Tunable), Some(timing)) => declared(of, timing),
        (Causality::Input, Some(Constant), None) => {
            fault(of, "has no interval, although it is a constant clock")
        }
        (Causality::Input, Some(variability), _) => Ok(Source::Asked { variability, is_fraction }),
        _ => Ok(Source::Fmu),
    }
}

/// Checks the interval and the shift in the model description.
fn declared<'a>(of: &Declared, timing: Timing) -> Result<Source<'a>, Error> {
    let (interval, shift) = match timing {
        Timing::Decimal { interval, shift } => (Fraction::of_decimal(interval), Fraction::of_decimal(shift)),
        Timing::Fraction { interval, shift, resolution } => {
            let fraction = |counter: u64| Fraction::of(counter.into(), resolution.into());
            (fraction(interval), fraction(shift))
        }
    };
    let interval = interval.filter(|interval| interval.is_positive());
    match (interval, shift.filter(|shift| !shift.is_negative())) {
        (Some(interval), Some(shift)) => Ok(Source::Declared { shift, interval }),
        (None, _) => fault(of, "must have an interval from 1e-18 s to 1e18 s"),
        (_, None) => fault(of, "must have a shift of 0 or from 1e-18 s to 1e18 s"),
    }
}

fn fault<T>(of: &Declared, what: &str) -> Result<T, Error> {
    Err(Error::Fmu(format!("modelDescription.xml: the clock {} {what}", of.name)))
}
