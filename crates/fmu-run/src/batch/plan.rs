//! From names to value references: a batch that fits the FMU.

use super::{Batch, Course, Measure, Start};
use crate::error::Error;
use crate::fmu::Fmu;
use crate::selection::{Selection, fits, number, request, text_of_start};
use fmi_abi::{BaseType, Interface};
use std::ffi::CString;

/// A batch after all checks.
pub(super) struct Plan<'a> {
    pub time: &'a [f64],
    pub runs: usize,
    pub real_inputs: Inputs<'a>,
    pub other_inputs: Vec<(BaseType, u32, Values<'a>)>,
    pub derivatives: Inputs<'a>,
    pub start: Vec<(BaseType, u32, Values<'a>)>,
    pub texts: Vec<(u32, CString)>,
    pub outputs: Selection,
    pub every: Option<usize>,
    pub measures: &'a [Measure],
    pub threads: usize,
    pub read_before_set: bool,
}

/// Inputs that are set by one call.
#[derive(Default)]
pub(super) struct Inputs<'a> {
    pub references: Vec<u32>,
    pub values: Vec<Values<'a>>,
}

/// Values by run and time.
#[derive(Clone, Copy)]
pub(super) struct Values<'a> {
    values: &'a [f64],
    constant: f64,
    /// From one run to the next, and from one time to the next; 0 where it makes no difference.
    of_run: usize,
    of_time: usize,
}

impl<'a> Values<'a> {
    /// Those of a run, by time.
    pub fn of_run(&self, run: usize) -> ByTime<'a> {
        let values = &self.values[(run * self.of_run).min(self.values.len())..];
        match self.of_time {
            0 => ByTime { values: &[], constant: values.first().copied().unwrap_or(self.constant) },
            _ => ByTime { values, constant: self.constant },
        }
    }
}

/// Values of one run.
#[derive(Clone, Copy)]
pub(super) struct ByTime<'a> {
    values: &'a [f64],
    constant: f64,
}

impl ByTime<'_> {
    /// The value at the time of this number.
    #[inline]
    pub fn at(&self, time: usize) -> f64 {
        self.values.get(time).copied().unwrap_or(self.constant)
    }
}

impl<'a> Plan<'a> {
    pub fn of(fmu: &Fmu, batch: &'a Batch) -> Result<Self, Error> {
        fmu.library(Interface::CoSimulation)?;
        let time = checked_time(batch.time)?;
        let runs = runs(batch)?;
        let mut plan = Self {
            time,
            runs,
            real_inputs: Inputs::default(),
            other_inputs: Vec::new(),
            derivatives: Inputs::default(),
            start: Vec::new(),
            texts: Vec::new(),
            outputs: Selection::default(),
            every: batch.every,
            measures: &batch.measures,
            threads: fmu.threads(Interface::CoSimulation, batch.threads)?.min(runs.max(1)),
            read_before_set: batch.read_before_set,
        };
        if batch.every == Some(0) {
            return request("every must be at least 1".to_owned());
        }
        plan.find_inputs(fmu, batch)?;
        plan.find_start(fmu, batch)?;
        plan.outputs = fmu.select(&batch.outputs)?;
        Ok(plan)
    }

    /// How many times are kept.
    pub fn kept(&self) -> usize {
        self.every.map_or(0, |every| self.time.len().div_ceil(every))
    }

    fn find_inputs(&mut self, fmu: &Fmu, batch: &'a Batch) -> Result<(), Error> {
        let description = fmu.description();
        let mut seen = Vec::new();
        for (name, course) in &batch.inputs {
            let of = number(fmu, name)?;
            let settable = matches!(of.causality.as_str(), "input" | "parameter");
            if !settable || of.variability.as_deref() == Some("fixed") {
                return request(format!(
                    "{name} is no input but {} {}; give it a start value",
                    article(of.variability.as_deref().unwrap_or(&of.causality)),
                    of.causality
                ));
            }
            once(&mut seen, name, "inputs")?;
            let values = self.course(name, of.base, *course)?;
            match of.base {
                BaseType::Real => {
                    self.real_inputs.references.push(of.reference);
                    self.real_inputs.values.push(values);
                }
                base => self.other_inputs.push((base, of.reference, values)),
            }
        }
        if !batch.input_derivatives.is_empty()
            && description.co_simulation.as_ref().is_none_or(|offer| !offer.input_derivatives)
        {
            return request(format!(
                "{} takes no input derivatives (canInterpolateInputs of FMI 2.0)",
                description.model_name
            ));
        }
        let mut seen = Vec::new();
        for (name, course) in &batch.input_derivatives {
            let of = number(fmu, name)?;
            if of.base != BaseType::Real || of.causality != "input" {
                return request(format!("{name} is no Real input; only these have input derivatives"));
            }
            once(&mut seen, name, "input derivatives")?;
            self.derivatives.references.push(of.reference);
            self.derivatives.values.push(self.course(name, of.base, *course)?);
        }
        Ok(())
    }

    fn find_start(&mut self, fmu: &Fmu, batch: &'a Batch) -> Result<(), Error> {
        let mut seen = Vec::new();
        for (name, start) in &batch.start {
            once(&mut seen, name, "start values")?;
            let values = match *start {
                Start::Text(text) => {
                    self.texts.push(text_of_start(fmu, name, text)?);
                    continue;
                }
                Start::Same(value) => Values { values: &[], constant: value, of_run: 0, of_time: 0 },
                Start::EachRun(values) => Values { values, constant: 0.0, of_run: 1, of_time: 0 },
            };
            let of = number(fmu, name)?;
            let all = if values.of_run == 0 { std::slice::from_ref(&values.constant) } else { values.values };
            fits(name, of.base, all)?;
            self.start.push((of.base, of.reference, values));
        }
        Ok(())
    }

    fn course(&self, name: &str, base: BaseType, course: Course<'a>) -> Result<Values<'a>, Error> {
        let times = self.time.len();
        let shared = Values { values: &[], constant: 0.0, of_run: 0, of_time: 0 };
        match course {
            Course::Constant(value) => {
                fits(name, base, &[value])?;
                Ok(Values { constant: value, ..shared })
            }
            Course::Shared(values) => {
                if values.len() != times {
                    return request(format!("{name} has {} values for {times} times", values.len()));
                }
                fits(name, base, values)?;
                Ok(Values { values, of_time: 1, ..shared })
            }
            Course::EachRun(values) => {
                fits(name, base, values)?;
                Ok(Values { values, of_run: times, of_time: 1, ..shared })
            }
        }
    }
}

fn checked_time(time: &[f64]) -> Result<&[f64], Error> {
    if time.len() < 2 {
        return request(format!(
            "time has {} values; a run goes from one time to another at least",
            time.len()
        ));
    }
    if let Some(place) = time.iter().position(|time| !time.is_finite()) {
        return request(format!("time[{place}] is {}; times must be finite", time[place]));
    }
    if let Some(place) = time.windows(2).position(|pair| pair[1] <= pair[0]) {
        let [before, after] = [time[place], time[place + 1]];
        return request(format!(
            "time[{}] is {after}, which is not after time[{place}], {before}",
            place + 1
        ));
    }
    Ok(time)
}

/// The number of runs, which all that have a value for each run agree on.
fn runs(batch: &Batch) -> Result<usize, Error> {
    let mut found: Option<(&str, usize)> = None;
    let courses =
        batch.inputs.iter().chain(&batch.input_derivatives).filter_map(|(name, course)| match course {
            Course::EachRun(values) => Some((*name, values.len(), batch.time.len())),
            _ => None,
        });
    let starts = batch.start.iter().filter_map(|(name, start)| match start {
        Start::EachRun(values) => Some((*name, values.len(), 1)),
        _ => None,
    });
    for (name, length, times) in courses.chain(starts) {
        if length % times != 0 {
            return request(format!("{name} has {length} values, which is no multiple of the {times} times"));
        }
        let runs = length / times;
        match found {
            Some((other, count)) if count != runs => {
                return request(format!("{other} is given for {count} runs, {name} for {runs}"));
            }
            _ => found = Some((name, runs)),
        }
    }
    Ok(found.map_or(1, |(_, runs)| runs))
}

fn once<'a>(seen: &mut Vec<&'a str>, name: &'a str, where_: &str) -> Result<(), Error> {
    if seen.contains(&name) {
        return request(format!("{name} is twice among the {where_}"));
    }
    seen.push(name);
    Ok(())
}

fn article(word: &str) -> String {
    let vowel = word.starts_with(['a', 'e', 'i', 'o', 'u']);
    format!("{} {word}", if vowel { "an" } else { "a" })
}
