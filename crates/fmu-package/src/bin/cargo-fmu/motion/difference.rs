//! Compares the results of Co-Simulation with those of Model Exchange.

use super::Run;
use fmi_abi::Causality;
use fmu_run::{BaseType, Description, Occurrence, Variable};
use std::fmt;

/// Result of a comparison.
pub enum Comparison {
    /// The largest difference: a variable with its unit, the difference and the time.
    Agree(Option<(String, f64, f64)>),
    /// Differences that are larger, but not larger than the errors of the steps.
    Coarse(String),
    /// What differs first, and a possible reason.
    Differ(String),
}

impl fmt::Display for Comparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let equal = "Co-Simulation and Model Exchange agree";
        match self {
            Self::Agree(None) => f.write_str(equal),
            Self::Agree(Some((name, difference, time))) => {
                write!(f, "{equal}: {name} differs most, by {difference:.1e} at {time} s")
            }
            Self::Coarse(text) | Self::Differ(text) => {
                write!(f, "Co-Simulation and Model Exchange differ {text}")
            }
        }
    }
}

/// Largest difference, relative to the range of a variable, that may be an error of a solver.
const TOLERANCE: f64 = 1e-3;

/// Results of the runs of both interface types.
pub(super) struct Judged<'a> {
    pub time: &'a [f64],
    pub compared: &'a [&'a Variable],
    pub stepped: Run,
    /// Model Exchange with the inputs of Co-Simulation, which are held between communication points.
    pub integrated: Run,
    /// Model Exchange with continuous inputs that follow lines.
    pub lines: Run,
    /// Co-Simulation with half the step size.
    pub half: Run,
    pub description: &'a Description,
    /// The numeric inputs in the table.
    pub moved: &'a [&'a str],
    /// Whether two runs with the same inputs differ.
    pub is_random: bool,
}

impl Judged<'_> {
    pub fn comparison(&self) -> Comparison {
        for (run, name) in [(&self.stepped, "Co-Simulation"), (&self.integrated, "Model Exchange")] {
            if let Some(error) = &run.error {
                return Comparison::Differ(format!("because {name} fails: {error}"));
            }
        }
        let first = (0..self.compared.len()).filter_map(|of| Some((self.parts(of)?, of)));
        // Several variables may differ from the same time on.
        let first = first.min_by(|(one, a), (other, b)| {
            one.cmp(other).then(self.share(*other, *b).total_cmp(&self.share(*one, *a)))
        });
        if let Some((at, of)) = first {
            return self.parted(at, of);
        }
        let [stepped, integrated] = [&self.stepped, &self.integrated].map(|run| run.ended);
        let step = self.time[1] - self.time[0];
        if stepped.unwrap_or(f64::INFINITY) != integrated.unwrap_or(f64::INFINITY)
            && !matches!((stepped, integrated), (Some(one), Some(other)) if (one - other).abs() <= step)
        {
            let end =
                |end: Option<f64>| end.map_or("does not end".to_owned(), |end| format!("ends at {end} s"));
            return Comparison::Differ(format!(
                "in the end of the simulation: Co-Simulation {}, Model Exchange {}; compare `Stepped::Terminate` in `step` with \
                 `terminate` in `event`",
                end(stepped),
                end(integrated)
            ));
        }
        let most = (0..self.compared.len()).filter_map(|of| {
            let times: Vec<usize> = self.indices(of).collect();
            let lasting = times.windows(2).map(|pair| (self.lasting(pair, of), pair[1]));
            let (difference, at) = lasting.max_by(|one, other| one.0.total_cmp(&other.0))?;
            Some((difference / self.range(of), of, difference, at))
        });
        let most = most.max_by(|one, other| one.0.total_cmp(&other.0)).filter(|most| most.0 > 0.0);
        match most {
            Some((share, of, difference, at)) if share > TOLERANCE => match self.converges(at, of) {
                true => Comparison::Coarse(format!(
                    "by up to {difference:.1e} in {}, at {} s, which is {:.1} % of its range, and by less with half the step size; choose \
                     shorter steps to compare",
                    self.compared[of].name,
                    self.time[at],
                    100.0 * share
                )),
                false => self.parted(self.first(of).unwrap_or(at), of),
            },
            _ => {
                Comparison::Agree(most.map(|(_, of, difference, at)| {
                    (self.compared[of].name.clone(), difference, self.time[at])
                }))
            }
        }
    }

    /// Returns the index of the first time at which a variable differs by more than [`TOLERANCE`] of its range.
    fn first(&self, of: usize) -> Option<usize> {
        self.indices(of).find(|at| self.share(*at, of) > TOLERANCE)
    }

    /// Describes the difference of a variable at a time.
    fn parted(&self, at: usize, of: usize) -> Comparison {
        let [stepped, integrated] =
            [&self.stepped, &self.integrated].map(|run| self.shown(of, run.values[of][at]));
        let (name, time) = (&self.compared[of].name, self.time[at]);
        Comparison::Differ(format!(
            "from {time} s on: {name} is {stepped} in Co-Simulation and {integrated} in Model Exchange; {}",
            self.reason(at, of)
        ))
    }

    /// Returns whether half the step size reduces the differences of a variable as much as a method of first order does, or more. A model
    /// may reject half the step size, so a run that ends before the index `at` shows nothing.
    fn converges(&self, at: usize, of: usize) -> bool {
        let of_half = |at: usize| self.distance(at, of, self.half.values[of].get(2 * at).copied());
        let both = self.indices(of).filter_map(|at| Some((self.difference(at, of), of_half(at)?)));
        let (whole, half) = both.fold((0.0, 0.0), |(whole, half), (one, other)| (whole + one, half + other));
        of_half(at).is_some() && half <= 0.75 * whole
    }

    /// Returns the difference that lasts from one time to the next. At a single time, an event near it may be handled before it in one
    /// interface type and after it in the other.
    fn lasting(&self, pair: &[usize], of: usize) -> f64 {
        self.difference(pair[0], of).min(self.difference(pair[1], of))
    }

    /// Returns the indices of the times at which a variable has a value in both runs.
    fn indices(&self, of: usize) -> impl Iterator<Item = usize> + '_ {
        let [stepped, integrated] = [&self.stepped, &self.integrated].map(|run| &run.values[of]);
        (0..self.time.len()).filter(move |at| stepped[*at].is_finite() && integrated[*at].is_finite())
    }

    fn difference(&self, at: usize, of: usize) -> f64 {
        self.distance(at, of, Some(self.stepped.values[of][at])).unwrap_or(f64::NAN)
    }

    /// Returns the distance of a value from the nearest result of Model Exchange.
    fn distance(&self, at: usize, of: usize, value: Option<f64>) -> Option<f64> {
        let value = value.filter(|value| value.is_finite())?;
        let results = [&self.integrated, &self.lines].map(|run| (value - run.values[of][at]).abs());
        results.into_iter().filter(|distance| distance.is_finite()).min_by(f64::total_cmp)
    }

    /// Returns the range of a variable in both runs.
    fn range(&self, of: usize) -> f64 {
        let values =
            || [&self.stepped, &self.integrated].into_iter().flat_map(|run| &run.values[of]).copied();
        let (low, high) =
            (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
        (high - low).max(1e-6 * high.abs().max(low.abs())).max(f64::MIN_POSITIVE)
    }

    /// Returns a difference as a share of the range.
    fn share(&self, at: usize, of: usize) -> f64 {
        self.difference(at, of) / self.range(of)
    }

    /// Returns the index of the time from which on a variable differs by more than the errors of solvers explain, at two times or more.
    fn parts(&self, of: usize) -> Option<usize> {
        let is_number = self.compared[of].base.is_float();
        let allowed = if is_number { TOLERANCE * self.range(of) } else { 0.0 };
        let (mut error, mut before) = (0.0_f64, None);
        for at in self.indices(of) {
            let half = self.half.values[of].get(2 * at).copied().filter(|half| half.is_finite());
            if is_number && let Some(half) = half {
                error = error.max((half - self.stepped.values[of][at]).abs());
            }
            match before {
                _ if self.difference(at, of) <= allowed + 2.0 * error => before = None,
                Some(first) => return Some(first),
                None => before = Some(at),
            }
        }
        None
    }

    /// Returns a possible reason of a difference, as an instruction.
    fn reason(&self, at: usize, of: usize) -> String {
        if self.is_random {
            return "two runs of Co-Simulation differ as well".to_owned();
        }
        let from = self.time[at.saturating_sub(2)];
        let [stepped, integrated] = [&self.stepped, &self.integrated].map(|run| &run.values[of]);
        // The times at which the results differ, and those of them at which Co-Simulation has the value that Model Exchange has a step
        // earlier.
        let tolerance = TOLERANCE * self.range(of);
        let differing: Vec<usize> =
            self.indices(of).skip(1).filter(|at| self.difference(*at, of) > tolerance).collect();
        let late = differing.iter().filter(|at| (stepped[**at] - integrated[**at - 1]).abs() <= tolerance);
        if 10 * late.count() >= 9 * differing.len() {
            return "Co-Simulation returns the value of the step before, so `calculate` or the end of `step` must update it".to_owned();
        }
        for (run, other, name) in [
            (&self.stepped, &self.integrated, "Co-Simulation"),
            (&self.integrated, &self.stepped, "Model Exchange"),
        ] {
            if let Some(end) = run.ended
                && end <= self.time[at]
                && other.ended.is_none_or(|other| other > end)
            {
                return format!("{name} has ended at {end} s");
            }
        }
        let is_effect = |event: &&Occurrence| {
            event.time >= from
                && event.time <= self.time[at]
                && event.time > self.time[0]
                && event.before != event.after
        };
        if let Some(event) = self.lines.events.iter().find(is_effect) {
            return format!(
                "Model Exchange has an event at {} s, which `step` misses, or handles at another time or in another way: compare its condition and the direction \
                 of the crossing with `event`",
                event.time
            );
        }
        // In the other run, each step of a held input is an event.
        let events = || self.lines.events.iter().filter(|event| event.time > self.time[0]);
        if events().next().is_none() && self.description.event_indicators == 0 && self.description.states == 0
        {
            return "Model Exchange has no event after the start: without indicators, `event` must return the time of the next event in \
                    `next`"
                .to_owned();
        }
        let near = events().filter(|event| (from..=self.time[at]).contains(&event.time)).count();
        if near > 0 {
            return format!(
                "the {near} events of Model Exchange from {from} s to then change no output and no state: compare what `event` does with `step`"
            );
        }
        let change = |values: &[f64], at: usize| (values[at] - values[at.saturating_sub(1)]).abs();
        if at > 1 && change(stepped, at) > 10.0 * change(stepped, at - 1).max(change(integrated, at)) {
            return "Co-Simulation jumps there, and Model Exchange has no event: compare the event in `step` with `indicators`, whose \
                    sign must change, and with the time `next` that `event` returns"
                .to_owned();
        }
        let is_missing = |of: &&Variable| {
            of.causality == Causality::Input
                && of.base == BaseType::Real
                && !self.moved.contains(&of.name.as_str())
        };
        let missing: Vec<&str> =
            self.description.variables.iter().filter(is_missing).map(|of| of.name.as_str()).collect();
        let missing = match missing.is_empty() {
            true => String::new(),
            false => {
                format!("; the table has no column for {}, which one of them may need", missing.join(", "))
            }
        };
        let compare = match self.description.states {
            0 => "compare what `step` sets with what `event` and `calculate` set",
            _ => "compare the equations of `step` with the derivatives",
        };
        format!("no event is near, so {compare}{missing}")
    }

    fn shown(&self, of: usize, value: f64) -> String {
        let unit = self.compared[of]
            .unit
            .as_deref()
            .filter(|unit| *unit != "1")
            .map_or(String::new(), |unit| format!(" {unit}"));
        format!("{value}{unit}")
    }
}
