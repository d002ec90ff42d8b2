//! Clocks of FMI 3.0: ticks them in Event Mode, and sets and reads clocked variables while their clocks are active.
//!
//! [`fraction`] represents times of ticks exactly, and [`schedule`] calculates the next tick of a clock. [`Clocks`] are the clocks of an
//! FMU, with the clocked variables of a batch, and [`Ticking`] ticks them in a run. Both interface types begin it at the end of
//! Initialization Mode. In Event Mode they call it instead of updating the discrete states, because clocks are only active there.

mod fraction;
mod schedule;

pub(crate) use fraction::Fraction;

use crate::continuous::{Chatter, MOST_EVENTS};
use crate::selection::Selection;
use crate::system_instance::SystemInstance;
use fmi_abi::client::{Event, MOST_ITERATIONS, Rejection};
use fmi_abi::{IntervalVariability, shown_number};
use schedule::Schedule;

/// A clock.
pub(crate) struct Clock<'a> {
    pub name: String,
    pub reference: u32,
    pub source: Source<'a>,
    /// Indices of the clocks of which one must be active if this one is; empty if it is not a clocked variable.
    pub parents: Vec<usize>,
}

/// What determines the ticks of a clock.
#[derive(Clone, Copy)]
pub(crate) enum Source<'a> {
    /// The model description: the first tick is this long after the start.
    Declared { shift: Fraction, interval: Fraction },
    /// The FMU returns the interval, as a fraction or as a decimal number.
    Asked { variability: IntervalVariability, is_fraction: bool },
    /// Times that the caller gives, s.
    Given(&'a [f64]),
    /// The FMU activates the clock in Event Mode.
    Fmu,
}

/// Clocked variables that have the same clocks.
#[derive(Default)]
pub(crate) struct Group {
    /// Indices of the clocks.
    pub clocks: Vec<usize>,
    pub variables: Selection,
    /// For inputs, their indices among all clocked inputs; for outputs, their indices among all outputs of the batch.
    pub indices: Vec<usize>,
}

/// The clocks of an FMU, and the clocked variables of a batch.
#[derive(Default)]
pub(crate) struct Clocks<'a> {
    pub all: Vec<Clock<'a>>,
    pub inputs: Vec<Group>,
    pub outputs: Vec<Group>,
    /// Whether a clocked output keeps its value until the next tick; otherwise it is NaN between ticks.
    pub hold: bool,
}

/// Times and values of a clocked input, of which each holds until the next. A constant has one value.
pub(crate) type Held<'a> = (&'a [f64], &'a [f64]);

/// The clocks of an instance during a run.
pub(crate) struct Ticking<'a> {
    clocks: &'a Clocks<'a>,
    /// Values of the clocked inputs.
    inputs: Vec<Held<'a>>,
    /// Communication points, s.
    points: &'a [f64],
    schedules: Vec<Schedule>,
    /// Next tick of each clock, s.
    next: Vec<Option<f64>>,
    chatter: Vec<Chatter>,
    /// For each clock, whether it is active in the current iteration of the event.
    active: Vec<bool>,
    /// Indices of the clocks that have ticked in the last event.
    pub ticked: Vec<usize>,
    /// Index among all outputs, value and time of the last tick of each clocked output, in the order of the groups.
    last: Vec<(usize, f64, f64)>,
    row: Vec<f64>,
}

impl<'a> Ticking<'a> {
    pub fn new(clocks: &'a Clocks<'a>, inputs: Vec<Held<'a>>, points: &'a [f64]) -> Self {
        let count = clocks.all.len();
        let outputs = clocks.outputs.iter().flat_map(|group| &group.indices);
        Self {
            clocks,
            inputs,
            points,
            schedules: vec![Schedule::default(); count],
            next: vec![None; count],
            chatter: (0..count).map(|_| Chatter::since(points[0])).collect(),
            active: vec![false; count],
            ticked: Vec::new(),
            last: outputs.map(|index| (*index, f64::NAN, f64::NAN)).collect(),
            row: Vec::new(),
        }
    }

    /// Schedules the first ticks, in Initialization Mode.
    pub fn begin(&mut self, instance: &mut SystemInstance) -> Result<(), Rejection> {
        let start = exact(self.points[0])?;
        for (index, clock) in self.clocks.all.iter().enumerate() {
            self.schedules[index] = Schedule::begin(clock, instance, start)?;
            self.find_next(index)?;
        }
        Ok(())
    }

    /// Returns the communication points, s.
    pub fn points(&self) -> &'a [f64] {
        self.points
    }

    /// Returns whether a clock ticks at this time, s.
    pub fn is_due(&self, time: f64) -> bool {
        self.next.iter().flatten().any(|next| *next <= time)
    }

    /// Returns the communication point that equals this time within rounding error, or else the time itself. Communication points are
    /// often sums of floating-point numbers, and a tick should not be just before or after one.
    pub fn near_point(&self, time: f64) -> f64 {
        /// Relative to the distance of the communication points.
        const NEAR: f64 = 1e-9;
        let after = self.points.partition_point(|point| *point < time).clamp(1, self.points.len() - 1);
        let [one, other] = [self.points[after - 1], self.points[after]];
        let near = NEAR * (other - one);
        [one, other].into_iter().find(|point| (time - point).abs() <= near).unwrap_or(time)
    }

    /// Performs an event at this time, s: activates the clocks that are due, sets and reads clocked variables, and updates the discrete
    /// states until the event is complete. The instance must be in Event Mode. The next event is also the next tick, if that is earlier.
    pub fn update(&mut self, instance: &mut SystemInstance, time: f64) -> Result<Event, Rejection> {
        self.ticked.clear();
        let now = self.activate(instance, time)?;
        let mut event = Event::default();
        for _ in 0..MOST_ITERATIONS {
            self.find_active(instance)?;
            self.read(instance, time)?;
            let again = instance.sole().update_discrete_states(&mut event)?;
            self.active.fill(false);
            if !again {
                if !event.terminate {
                    self.schedule(instance, now)?;
                }
                let ticks = self.next.iter().flatten().copied();
                // NaN remains, because it is an error.
                event.next = event
                    .next
                    .into_iter()
                    .chain(ticks)
                    .reduce(|one, other| if other < one { other } else { one });
                return Ok(event);
            }
        }
        Err(instance.sole().endless_event())
    }

    /// Returns the names of the clocks that have ticked in the last event.
    pub fn names(&self) -> impl Iterator<Item = String> {
        self.ticked.iter().map(|index| self.clocks.all[*index].name.clone())
    }

    /// Writes the values of clocked outputs at this time, s, to a row of all outputs.
    pub fn show(&self, time: f64, row: &mut [f64]) {
        for (index, value, tick) in &self.last {
            row[*index] = if self.clocks.hold || *tick == time { *value } else { f64::NAN };
        }
    }

    /// Activates the clocks that are due, and sets their clocked inputs. Returns the exact time of the event.
    fn activate(&mut self, instance: &mut SystemInstance, time: f64) -> Result<Fraction, Rejection> {
        let due = |index: &usize| self.next[*index].is_some_and(|next| next <= time);
        self.ticked.extend((0..self.next.len()).filter(due));
        let Some(first) = self.ticked.first().copied() else { return exact(time) };
        let references: Vec<_> = self.ticked.iter().map(|index| self.clocks.all[*index].reference).collect();
        instance.sole().activate_clocks(&references)?;
        self.ticked.iter().for_each(|index| self.active[*index] = true);
        for Group { clocks, variables, indices } in &self.clocks.inputs {
            if clocks.iter().any(|clock| self.active[*clock]) {
                self.row.clear();
                self.row.extend(indices.iter().map(|index| value_at(self.inputs[*index], time)));
                instance.set(variables, &self.row)?;
            }
        }
        let exactly = self.schedules[first].next(&self.clocks.all[first])?;
        exactly.map_or_else(|| exact(time), Ok)
    }

    /// Finds the clocks that the FMU has activated. A clock is only asked for while one of its own clocks is active, and once in an
    /// iteration, because some FMUs deactivate it then.
    fn find_active(&mut self, instance: &mut SystemInstance) -> Result<(), Rejection> {
        let all = &self.clocks.all;
        let mut left: Vec<_> =
            (0..all.len()).filter(|index| matches!(all[*index].source, Source::Fmu)).collect();
        loop {
            let active = &self.active;
            let may = |parents: &[usize]| parents.is_empty() || parents.iter().any(|parent| active[*parent]);
            let (asked, rest): (Vec<_>, Vec<_>) =
                left.into_iter().partition(|index| may(&all[*index].parents));
            let mut is_new = false;
            for index in asked {
                if instance.sole().is_clock_active(all[index].reference)? {
                    (self.active[index], is_new) = (true, true);
                    if !self.ticked.contains(&index) {
                        self.ticked.push(index);
                    }
                }
            }
            if !is_new || rest.is_empty() {
                return Ok(());
            }
            left = rest;
        }
    }

    /// Reads the clocked outputs of active clocks.
    fn read(&mut self, instance: &mut SystemInstance, time: f64) -> Result<(), Rejection> {
        let mut rest = &mut *self.last;
        for Group { clocks, variables, .. } in &self.clocks.outputs {
            let (own, others) = rest.split_at_mut(variables.len());
            rest = others;
            if clocks.iter().any(|clock| self.active[*clock]) {
                self.row.resize(own.len(), 0.0);
                instance.get(variables, &mut self.row)?;
                own.iter_mut().zip(&self.row).for_each(|(last, value)| (last.1, last.2) = (*value, time));
            }
        }
        Ok(())
    }

    /// Schedules the next ticks at the end of an event at the exact time `now`.
    fn schedule(&mut self, instance: &mut SystemInstance, now: Fraction) -> Result<(), Rejection> {
        for (index, clock) in self.clocks.all.iter().enumerate() {
            if !matches!(clock.source, Source::Fmu) {
                let has_ticked = self.ticked.contains(&index);
                let before = self.schedules[index].clone();
                self.schedules[index].advance(clock, instance, now, has_ticked)?;
                if has_ticked || before != self.schedules[index] {
                    self.find_next(index)?;
                }
            }
        }
        Ok(())
    }

    /// Finds the next tick of a clock. Fails if the clock ticks too often.
    fn find_next(&mut self, index: usize) -> Result<(), Rejection> {
        let clock = &self.clocks.all[index];
        let next = match clock.source {
            Source::Given(times) => times.get(self.schedules[index].index as usize).copied(),
            _ => self.schedules[index].next(clock)?.map(Fraction::to_f64),
        };
        self.next[index] = next.map(|next| self.near_point(next));
        let Some(next) = self.next[index] else { return Ok(()) };
        let (first, last) = (self.points[0], self.points[self.points.len() - 1]);
        let scale = (last - first).max(first.abs()).max(last.abs());
        match self.chatter[index].count(next, scale) {
            None => Ok(()),
            Some(since) => {
                let [since, next] = [since, next].map(shown_number);
                Err(clock.error(&format!(
                    "ticks without end: {MOST_EVENTS} ticks from t = {since} s to t = {next} s"
                )))
            }
        }
    }
}

/// Returns the exact time of an event that is not a tick.
fn exact(time: f64) -> Result<Fraction, Rejection> {
    let why = || {
        Rejection::without_fmu("clocks", &format!("the time {} s is too large or small", shown_number(time)))
    };
    Fraction::of_decimal(time).ok_or_else(why)
}

/// Returns the last value that is not after this time, s; before the first time, the first value.
fn value_at((times, values): Held, time: f64) -> f64 {
    let after = times.partition_point(|of| *of <= time);
    values[after.saturating_sub(1).min(values.len() - 1)]
}
