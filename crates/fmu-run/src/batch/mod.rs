//! Batches: many runs of an FMU or a system.

mod event_plan;
mod events;
mod exact;
mod input_rows;
mod inputs;
mod measure;
mod model_exchange;
mod model_exchange_plan;
mod plan;
mod pulse;
mod resampling;
mod run;
mod series;
mod watch;
mod worker;

pub use measure::Measure;
pub use watch::Watch;

use crate::continuous::Integration;
use crate::error::Error;
use crate::instance::Tolerance;
use crate::start::Start;
use crate::system::System;
use fmi_abi::{BaseType, Interface, Value};

/// Specification of one or several runs. If an input or a start value has a separate value or time series for each run, the number
/// of these determines the number of runs; otherwise there is one run.
///
/// In each run, start values are set before Initialization Mode, and the first values of the inputs in Initialization Mode. Then,
/// in Co-Simulation, at each time inputs are set, outputs are read, and a step to the next time is performed.
///
/// In Model Exchange, the states are integrated between events. Continuous inputs are interpolated between their values by lines, or
/// by cubics if their [derivatives](Self::input_derivatives) are given. All other inputs change in Event Mode.
#[derive(Clone, Debug, Default)]
pub struct Batch<'a> {
    /// Communication points, s. They must be finite and increasing, and at least two.
    pub time: &'a [f64],
    /// Inputs and their values. Inputs that are not listed keep their start values. But in Model Exchange, an input that is
    /// declared as the time derivative of a listed input follows that input, unless it has a value in `start`.
    pub inputs: Vec<(&'a str, Trajectory<'a>)>,
    /// First time derivatives of inputs. In Co-Simulation they are set together with the inputs (only FMI 2.0). In Model Exchange
    /// they belong to a continuous input, and are constant or given at the same times as its values.
    pub input_derivatives: Vec<(&'a str, Trajectory<'a>)>,
    /// Start values of parameters, states, inputs and so on.
    pub start: Vec<(&'a str, Start<'a>)>,
    /// Variables to read. Strings, bytes and 64-bit integers are returned in [`Runs::exact`], all others in
    /// [`Runs::trajectories`], each in this order.
    pub outputs: Vec<&'a str>,
    /// Stores the outputs at every `every`-th time, beginning with the first; `None` stores no trajectories.
    pub every: Option<usize>,
    /// Statistics of each numeric output, over all times.
    pub measures: Vec<Measure>,
    /// Maximum number of threads; `None` means one for each processor.
    pub threads: Option<usize>,
    /// Whether outputs are read directly after a step, before the next inputs are set. This is the order of section 4.2.4 of FMI 2.0
    /// and of FMPy. Outputs that depend directly on inputs then lag by one step.
    pub read_before_set: bool,
    /// Whether a run may reset the instance of an earlier run instead of creating one, which is faster if creating one takes long. Use it
    /// only for FMUs whose reset removes everything: in many FMUs a parameter, a state or a calculated value survives, and then a run
    /// depends on earlier ones. With logging on, each run has a new instance all the same.
    pub reuse: bool,
    /// Relative tolerance for solvers inside the FMU; in Model Exchange also the default of [`Integration::rtol`].
    pub tolerance: Tolerance,
    /// Interface type; `None` means Co-Simulation, or Model Exchange if the FMU has only that.
    pub interface: Option<Interface>,
    /// Solver and tolerances, in Model Exchange.
    pub integration: Integration,
    /// Whether the outputs before and after each event are kept in [`Runs::events`], in Model Exchange, and in Co-Simulation of an FMU
    /// with event mode (FMI 3.0). Steps of Co-Simulation then end at events.
    pub events: bool,
    /// Times of the ticks of triggered input clocks, s. They must increase. All other input clocks tick at the times that follow from
    /// their intervals.
    pub clocks: Vec<(&'a str, &'a [f64])>,
    /// Whether an output with a clock keeps the value of the last tick at the communication points until the next tick. Otherwise it is
    /// NaN, unless the clock ticks at the communication point.
    pub hold: bool,
}

/// Values of an input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Trajectory<'a> {
    /// One constant value.
    Constant(f64),
    /// A value for each time, the same in all runs.
    Shared(&'a [f64]),
    /// A time series for each run, concatenated; the index of the time varies fastest.
    EachRun(&'a [f64]),
    /// Values at the input's own times, which must not decrease: one time series for all runs, or one for each run, concatenated.
    /// Between two times, a continuous variable is interpolated linearly and any other keeps the earlier value. Two equal times
    /// make a jump. Before the first and after the last time, the value is constant.
    Sampled {
        /// Times, s.
        times: &'a [f64],
        /// Values.
        values: &'a [f64],
    },
    /// One constant value of any type.
    Value(&'a Value),
    /// Values of any type: one time series for all runs, or one for each run, concatenated. Each value holds until the next time.
    Values(&'a [Value]),
    /// The time derivative of the input with this name, in Model Exchange.
    RateOf(&'a str),
    /// Values of any type at the input's own times, otherwise as [`Values`](Self::Values).
    SampledValues {
        /// Times, s.
        times: &'a [f64],
        /// Values.
        values: &'a [Value],
    },
}

impl Trajectory<'_> {
    /// Returns the number of values and the number of times of a run; `None` if there are no separate values for single times.
    fn counts(&self, times: usize) -> Option<(usize, usize)> {
        match self {
            Self::Constant(_) | Self::Value(_) | Self::RateOf(_) => None,
            Self::Shared(values) | Self::EachRun(values) => Some((values.len(), times)),
            Self::Values(values) => Some((values.len(), times)),
            Self::Sampled { times, values } => Some((values.len(), times.len())),
            Self::SampledValues { times, values } => Some((values.len(), times.len())),
        }
    }
}

/// Size of the results of a [`Batch`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Size {
    /// Number of runs.
    pub runs: usize,
    /// Number of outputs in [`Runs::trajectories`].
    pub outputs: usize,
    /// Number of [kept](Batch::every) times: the length of a trajectory.
    pub kept: usize,
    /// Number of statistics of each output.
    pub measures: usize,
    /// Number of outputs in [`Runs::exact`], which are not among `outputs`.
    pub exact: usize,
}

impl Size {
    /// Returns the number of values in [`Runs::trajectories`]; `None` if they exceed the address space.
    pub fn trajectories(&self) -> Option<usize> {
        self.values(self.kept)
    }

    /// Returns the number of values in [`Runs::measures`]; `None` if they exceed the address space.
    pub fn measures(&self) -> Option<usize> {
        self.values(self.measures)
    }

    fn values(&self, each: usize) -> Option<usize> {
        let count = self.runs.checked_mul(self.outputs)?.checked_mul(each)?;
        (count <= isize::MAX as usize / size_of::<f64>()).then_some(count)
    }
}

/// Where the values of an output are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Column {
    /// Index of the output in [`Runs::trajectories`] and [`Runs::measures`].
    Number(usize),
    /// Index of the output in [`Runs::exact`], and its type.
    Exact(usize, BaseType),
}

/// Results of a [`Batch`].
#[derive(Clone, Debug, Default)]
pub struct Runs {
    /// Numbers of runs, outputs, times and statistics.
    pub size: Size,
    /// Trajectories, with the indices run, output and time, of which the last varies fastest. Values at times that a run has not
    /// reached are NaN.
    pub trajectories: Vec<f64>,
    /// Statistics, with the indices run, output and statistic, of which the last varies fastest. They are NaN for a failed run. If
    /// the FMU ended a run early, they cover the times until then.
    pub measures: Vec<f64>,
    /// Values of outputs that are strings, bytes or 64-bit integers, with the indices run, output and time, of which the last
    /// varies fastest. They are `None` at times that a run has not reached.
    pub exact: Vec<Option<Value>>,
    /// Runs that did not reach the last time, because a call failed or the FMU ended the simulation. Each has the index of the run,
    /// and a message with the time reached and the reason. A run that failed without a message is repeated with logging on after
    /// all other runs, to get the message, as long as this takes at most 2 s longer than the runs took.
    pub errors: Vec<(usize, String)>,
    /// Notes about runs that reached the last time: the FMU ended the simulation there, or `terminate` failed.
    pub notes: Vec<(usize, String)>,
    /// Events, sorted by run and time, if they were [requested](Batch::events).
    pub events: Vec<Occurrence>,
}

/// An event, with the outputs before and after it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Occurrence {
    /// Index of the run.
    pub run: usize,
    /// Time, s.
    pub time: f64,
    /// Outputs before the event, except those in [`Runs::exact`].
    pub before: Vec<f64>,
    /// The same outputs after the event.
    pub after: Vec<f64>,
    /// Indices of the continuous states that the event has changed.
    pub states: Vec<usize>,
    /// Whether the FMU has reported that states have changed.
    pub states_changed: bool,
    /// Names of the clocks that have ticked.
    pub clocks: Vec<String>,
}

impl System {
    /// Performs the runs.
    ///
    /// # Errors
    /// Returns [`Error::Request`] if the batch is inconsistent or does not fit the FMU, [`Error::Memory`] if the results do not fit
    /// in memory, [`Error::Cancelled`] if the caller cancels the runs, and [`Error::Fmu`] if the FMU does not support the interface
    /// type, cannot be used with the values of its structural parameters, or no threads can be created. A failed run is not an
    /// error here; see [`Runs::errors`].
    pub fn run(&self, batch: &Batch, watch: &Watch) -> Result<Runs, Error> {
        let planned = self.plan(batch)?;
        let size = planned.size();
        let [mut trajectories, mut measures] = [zeros(size.trajectories())?, zeros(size.measures())?];
        let Finished { errors, notes, exact, events } =
            planned.run(watch, &mut trajectories, &mut measures)?;
        if watch.is_cancelled() && watch.done() < size.runs {
            return Err(Error::Cancelled);
        }
        Ok(Runs { size, trajectories, measures, exact, errors, notes, events })
    }

    /// Checks a batch. Used by callers that provide the memory for its results.
    ///
    /// # Errors
    /// Returns [`Error::Request`] and [`Error::Fmu`] as [`run`](Self::run) does.
    pub fn plan<'a>(&self, batch: &'a Batch) -> Result<Planned<'a>, Error> {
        let (system, start) = self.configured(&batch.start)?;
        Ok(Planned { plan: plan::Plan::of(&system, batch, &start)?, system })
    }
}

/// A checked [`Batch`]. It keeps its system loaded.
pub struct Planned<'a> {
    plan: plan::Plan<'a>,
    system: System,
}

/// Results that [`Planned::run`] returns, in addition to those in the caller's memory.
#[derive(Clone, Debug, Default)]
pub struct Finished {
    /// See [`Runs::errors`].
    pub errors: Vec<(usize, String)>,
    /// See [`Runs::notes`].
    pub notes: Vec<(usize, String)>,
    /// See [`Runs::exact`].
    pub exact: Vec<Option<Value>>,
    /// See [`Runs::events`].
    pub events: Vec<Occurrence>,
}

impl Planned<'_> {
    /// Returns the size of the results.
    pub fn size(&self) -> Size {
        let plan = &self.plan;
        Size {
            runs: plan.runs,
            outputs: plan.outputs.len(),
            kept: plan.stored_times(),
            measures: plan.measures.len(),
            exact: plan.exact_outputs.len(),
        }
    }

    /// Returns where the values of each output are, in the order of [`Batch::outputs`].
    pub fn columns(&self) -> &[Column] {
        &self.plan.columns
    }

    /// Performs the runs. Writes trajectories and statistics to the caller's memory, in the layout of [`Runs`], and returns the other
    /// results.
    ///
    /// If the caller cancels the runs, the unfinished ones are errors of the result, and their values are NaN.
    ///
    /// # Errors
    /// Same errors as [`System::run`], except [`Error::Cancelled`].
    ///
    /// # Panics
    /// Panics if a slice is too short.
    pub fn run(
        &self,
        watch: &Watch,
        trajectories: &mut [f64],
        measures: &mut [f64],
    ) -> Result<Finished, Error> {
        run::run(&self.system, &self.plan, watch, [trajectories, measures])
    }
}

/// Allocates zeros. Fails if memory does not suffice.
fn zeros(count: Option<usize>) -> Result<Vec<f64>, Error> {
    match count {
        Some(count) if Vec::<f64>::new().try_reserve_exact(count).is_ok() => Ok(vec![0.0; count]),
        _ => Err(Error::too_much()),
    }
}
