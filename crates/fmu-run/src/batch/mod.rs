//! Many runs of an FMU or a system.

mod measure;
mod plan;
mod run;

pub use measure::Measure;
pub use run::Watch;

use crate::error::Error;
use crate::start::Start;
use crate::system::System;

/// What is to be run. A value for each run is what makes it many runs; without one it is a single run.
///
/// In each run all start values are set before the initialization, inputs of the first time in it. At each time the inputs
/// are set, the outputs read, and the step to the next time is taken.
#[derive(Clone, Debug, Default)]
pub struct Batch<'a> {
    /// The communication points, s: finite, each after the one before, two at least.
    pub time: &'a [f64],
    /// Inputs and what they do. Others stay at their start values.
    pub inputs: Vec<(&'a str, Course<'a>)>,
    /// Time derivatives of order 1 of inputs, set with them (FMI 2.0 alone has these).
    pub input_derivatives: Vec<(&'a str, Course<'a>)>,
    /// Start values of parameters, states, inputs and so on.
    pub start: Vec<(&'a str, Start<'a>)>,
    /// What is read; any variable that is a number.
    pub outputs: Vec<&'a str>,
    /// Outputs are kept at the first time and at each of this many from there; `None` keeps no courses.
    pub every: Option<usize>,
    /// What is calculated on the way, of each output, over all times.
    pub measures: Vec<Measure>,
    /// How many threads; `None` takes as many as the machine has processors.
    pub threads: Option<usize>,
    /// Read outputs as each step leaves them, before the next inputs are set, as section 4.2.4 of FMI 2.0 has it to the
    /// letter, and FMPy. What depends on inputs at once, without a step, is then late by a step.
    pub read_before_set: bool,
}

/// What an input does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Course<'a> {
    /// The same value always.
    Constant(f64),
    /// A value for each time, the same in each run.
    Shared(&'a [f64]),
    /// A course for each run, one after the other: runs times times.
    EachRun(&'a [f64]),
}

/// How much comes of a [`Batch`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Size {
    /// The number of runs.
    pub runs: usize,
    /// The number of outputs.
    pub outputs: usize,
    /// How many times are [kept](Batch::every): the length of a course.
    pub kept: usize,
    /// The number of measures.
    pub measures: usize,
}

impl Size {
    /// The number of all values of all courses; `None` if no memory holds so many.
    pub fn courses(&self) -> Option<usize> {
        self.values(self.kept)
    }

    /// The number of all measures; `None` if no memory holds so many.
    pub fn measures(&self) -> Option<usize> {
        self.values(self.measures)
    }

    fn values(&self, each: usize) -> Option<usize> {
        let count = self.runs.checked_mul(self.outputs)?.checked_mul(each)?;
        (count <= isize::MAX as usize / size_of::<f64>()).then_some(count)
    }
}

/// What came of a [`Batch`].
#[derive(Clone, Debug, Default)]
pub struct Runs {
    /// The shape of what follows.
    pub size: Size,
    /// Courses: runs, outputs, times, the last fastest. What a run has not reached is not a number.
    pub courses: Vec<f64>,
    /// Measures: runs, outputs, measures, the last fastest. Those of runs that were refused are not a number, those of runs
    /// that the FMU itself has ended are of the times until then.
    pub measures: Vec<f64>,
    /// The runs that have not reached the last time, in their order, how far they got and why, in the words of the FMU:
    /// those it has refused, and those it has ended. Where it gave no reason, the run is made once more with logging on,
    /// after all others, unless that takes much longer than these.
    pub errors: Vec<(usize, String)>,
    /// What is to be said of runs that have reached the last time: that the FMU ended there by itself, or refused to be
    /// terminated.
    pub notes: Vec<(usize, String)>,
}

impl System {
    /// Carries out the runs.
    ///
    /// # Errors
    /// [`Error::Request`] when what is asked for does not fit the FMU or itself, [`Error::Memory`], [`Error::Fmu`] when there are
    /// no threads, [`Error::Cancelled`]. A run that the FMU refuses, or makes no instance for, is no error here, see
    /// [`Runs::errors`].
    pub fn run(&self, batch: &Batch, watch: &Watch) -> Result<Runs, Error> {
        let planned = self.plan(batch)?;
        let size = planned.size();
        let [mut courses, mut measures] = [zeros(size.courses())?, zeros(size.measures())?];
        let [errors, notes] = planned.run(watch, &mut courses, &mut measures)?;
        Ok(Runs { size, courses, measures, errors, notes })
    }

    /// Checks a batch, for who has memory for its results.
    ///
    /// # Errors
    /// [`Error::Request`], as [`run`](Self::run).
    pub fn plan<'a>(&'a self, batch: &'a Batch) -> Result<Planned<'a>, Error> {
        Ok(Planned { system: self, plan: plan::Plan::of(self, batch)? })
    }
}

/// A [`Batch`] that fits its system, which stays loaded for it.
///
/// ```compile_fail,E0505
/// fn close_too_early(fmu: fmu_run::Fmu, batch: fmu_run::Batch) {
///     let planned = fmu.plan(&batch).unwrap();
///     drop(fmu);
///     planned.size();
/// }
/// ```
pub struct Planned<'a> {
    system: &'a System,
    plan: plan::Plan<'a>,
}

impl Planned<'_> {
    /// How much comes of it.
    pub fn size(&self) -> Size {
        let plan = &self.plan;
        Size {
            runs: plan.runs,
            outputs: plan.outputs.len(),
            kept: plan.kept(),
            measures: plan.measures.len(),
        }
    }

    /// Carries out the runs, into memory of the caller, as [`Runs`] has it; returns [`Runs::errors`] and [`Runs::notes`].
    ///
    /// # Errors
    /// As [`System::run`].
    ///
    /// # Panics
    /// When there is too little room.
    pub fn run(
        &self,
        watch: &Watch,
        courses: &mut [f64],
        measures: &mut [f64],
    ) -> Result<[Vec<(usize, String)>; 2], Error> {
        run::run(self.system, &self.plan, watch, [courses, measures])
    }
}

fn zeros(count: Option<usize>) -> Result<Vec<f64>, Error> {
    match count {
        Some(count) if Vec::<f64>::new().try_reserve_exact(count).is_ok() => Ok(vec![0.0; count]),
        _ => Err(Error::too_much()),
    }
}
