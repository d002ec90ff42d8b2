//! Many runs of an FMU or a system.

mod measure;
mod plan;
mod pulse;
mod reuse;
mod run;

pub use measure::Measure;
pub use run::Watch;

use crate::error::Error;
use crate::instance::Tolerance;
use crate::start::Start;
use crate::system::System;

/// Specification of runs. If an input or a start value is given for each run, there are many runs; otherwise
/// there is one.
///
/// In each run, start values are set before Initialization Mode, and inputs of the first time in it. At each
/// time, inputs are set, outputs are read, and a step to the next time follows.
#[derive(Clone, Debug, Default)]
pub struct Batch<'a> {
    /// Communication points, s: finite, increasing, at least two.
    pub time: &'a [f64],
    /// Inputs and their values. All other inputs keep their start values.
    pub inputs: Vec<(&'a str, Trajectory<'a>)>,
    /// Time derivatives of inputs, of order 1, set together with the inputs (only FMI 2.0).
    pub input_derivatives: Vec<(&'a str, Trajectory<'a>)>,
    /// Start values of parameters, states, inputs and so on.
    pub start: Vec<(&'a str, Start<'a>)>,
    /// Outputs to read: any numeric variables.
    pub outputs: Vec<&'a str>,
    /// Outputs are kept at the first time and then at each `every`-th time; `None` keeps no trajectories.
    pub every: Option<usize>,
    /// Statistics of each output, over all times.
    pub measures: Vec<Measure>,
    /// Number of threads; `None` uses one thread for each processor.
    pub threads: Option<usize>,
    /// Whether outputs are read directly after a step, before the next inputs are set. Section 4.2.4 of FMI
    /// 2.0 describes this order, and FMPy uses it. Outputs that depend directly on inputs then lag by one
    /// step.
    pub read_before_set: bool,
    /// Relative tolerance for solvers inside the FMU.
    pub tolerance: Tolerance,
}

/// Values of an input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Trajectory<'a> {
    /// One constant value.
    Constant(f64),
    /// A value for each time, equal in all runs.
    Shared(&'a [f64]),
    /// A time series for each run, concatenated: runs times x times.
    EachRun(&'a [f64]),
}

impl Trajectory<'_> {
    /// Returns the values of a run.
    fn of_run(self, run: usize, times: usize) -> Self {
        match self {
            Self::EachRun(values) => Self::Shared(&values[run * times..][..times]),
            other => other,
        }
    }

    /// Returns the value at the time with this index, in the values of a run.
    #[inline]
    fn at(&self, time: usize) -> f64 {
        match self {
            Self::Constant(value) => *value,
            Self::Shared(values) | Self::EachRun(values) => values[time],
        }
    }
}

/// Size of the results of a [`Batch`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Size {
    /// Number of runs.
    pub runs: usize,
    /// Number of outputs.
    pub outputs: usize,
    /// Number of [kept](Batch::every) times: the length of a trajectory.
    pub kept: usize,
    /// Number of statistics.
    pub measures: usize,
}

impl Size {
    /// Returns the number of values of all trajectories; `None` if they exceed the address space.
    pub fn trajectories(&self) -> Option<usize> {
        self.values(self.kept)
    }

    /// Returns the number of all statistics; `None` if they exceed the address space.
    pub fn measures(&self) -> Option<usize> {
        self.values(self.measures)
    }

    fn values(&self, each: usize) -> Option<usize> {
        let count = self.runs.checked_mul(self.outputs)?.checked_mul(each)?;
        (count <= isize::MAX as usize / size_of::<f64>()).then_some(count)
    }
}

/// Results of a [`Batch`].
#[derive(Clone, Debug, Default)]
pub struct Runs {
    /// Shape of the results.
    pub size: Size,
    /// Trajectories: runs, outputs, times; the last index varies fastest. Times that a run has not reached
    /// are NaN.
    pub trajectories: Vec<f64>,
    /// Statistics: runs, outputs, statistics; the last index varies fastest. They are NaN for a failed run.
    /// If the FMU ended a run, they cover the times until then.
    pub measures: Vec<f64>,
    /// Runs that did not reach the last time, in ascending order, each with the time reached and the message
    /// of the FMU. Either a call failed or the FMU ended the simulation. If a run failed without a message,
    /// it is repeated with logging on after all other runs, unless this takes much longer.
    pub errors: Vec<(usize, String)>,
    /// Notes about runs that reached the last time: the FMU ended the simulation there, or its termination
    /// failed.
    pub notes: Vec<(usize, String)>,
}

impl System {
    /// Performs the runs.
    ///
    /// # Errors
    /// Returns [`Error::Request`] if the batch is inconsistent or does not fit the FMU. Also returns
    /// [`Error::Memory`], [`Error::Cancelled`], or [`Error::Fmu`] if no threads can be made. A failed run is
    /// not an error here; see [`Runs::errors`].
    pub fn run(&self, batch: &Batch, watch: &Watch) -> Result<Runs, Error> {
        let planned = self.plan(batch)?;
        let size = planned.size();
        let [mut trajectories, mut measures] = [zeros(size.trajectories())?, zeros(size.measures())?];
        let [errors, notes] = planned.run(watch, &mut trajectories, &mut measures)?;
        Ok(Runs { size, trajectories, measures, errors, notes })
    }

    /// Checks a batch, for callers that provide the memory for its results.
    ///
    /// # Errors
    /// Returns [`Error::Request`] as [`run`](Self::run) does.
    pub fn plan<'a>(&'a self, batch: &'a Batch) -> Result<Planned<'a>, Error> {
        Ok(Planned { system: self, plan: plan::Plan::of(self, batch)? })
    }
}

/// A checked [`Batch`]; it keeps its system loaded.
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
    /// Returns the size of the results.
    pub fn size(&self) -> Size {
        let plan = &self.plan;
        Size {
            runs: plan.runs,
            outputs: plan.outputs.len(),
            kept: plan.kept(),
            measures: plan.measures.len(),
        }
    }

    /// Performs the runs and writes the results to memory of the caller, in the layout of [`Runs`]. Returns
    /// [`Runs::errors`] and [`Runs::notes`].
    ///
    /// # Errors
    /// Same errors as [`System::run`].
    ///
    /// # Panics
    /// Panics if a slice is too short.
    pub fn run(
        &self,
        watch: &Watch,
        trajectories: &mut [f64],
        measures: &mut [f64],
    ) -> Result<[Vec<(usize, String)>; 2], Error> {
        run::run(self.system, &self.plan, watch, [trajectories, measures])
    }
}

fn zeros(count: Option<usize>) -> Result<Vec<f64>, Error> {
    match count {
        Some(count) if Vec::<f64>::new().try_reserve_exact(count).is_ok() => Ok(vec![0.0; count]),
        _ => Err(Error::too_much()),
    }
}
