//! Writes call sequences of an importer that follows the standard, except in calls that are marked as forbidden.

mod parts;
mod reads;
mod variables;

use crate::call_sequence::{Action, Arg, CallSequence, Integration, Kind, Make, Numbered, Values};
use crate::description::Description;
use crate::legal::Modes;
use fmi_abi::calls::signatures;
use fmi_abi::{Interface, Standard};
pub use parts::{Calls, Part};
pub use reads::{MAX_READ, Read, difference, not_finite, number_of, sample, value_of, values_of};

/// Point of a trajectory.
#[derive(Clone, Debug, Default)]
pub struct Point {
    /// Time at which the step begins; in Model Exchange the time that is set.
    pub time: f64,
    /// Step size; in Model Exchange the time since the previous point.
    pub size: f64,
    /// Inputs that are set before the step: the index of each variable, and its values.
    pub inputs: Vec<(usize, Values)>,
    /// Continuous states that are set in Model Exchange.
    pub states: Vec<f64>,
    /// Whether there is an event at this point.
    pub event: bool,
}

/// Times, inputs and states of a successful simulation.
#[derive(Clone, Debug)]
pub struct Trajectory {
    pub interface: Interface,
    pub points: Vec<Point>,
    /// Time at the end.
    pub end: f64,
}

impl Trajectory {
    /// Returns whether the interface type is Co-Simulation.
    pub fn is_stepped(&self) -> bool {
        self.interface == Interface::CoSimulation
    }
}

/// Writes a call sequence action by action.
pub struct Writer<'a> {
    pub description: &'a Description,
    /// Simulation on which the sequence is based.
    pub trajectory: &'a Trajectory,
    /// Indices of the variables that are read.
    pub readable: &'a [usize],
    /// Actions that were written.
    pub sequence: CallSequence,
    pub next: u32,
    /// Whether the standard forbids the next actions.
    pub forbidden: bool,
    /// Modes of the instances after the last action.
    pub modes: Modes,
}

impl<'a> Writer<'a> {
    pub fn new(description: &'a Description, trajectory: &'a Trajectory, readable: &'a [usize]) -> Self {
        let (sequence, modes) = (Vec::new(), Modes::default());
        Self { description, trajectory, readable, sequence, next: 0, forbidden: false, modes }
    }

    pub fn fmi3(&self) -> bool {
        self.description.standard == Standard::Fmi3
    }

    /// Adds an action; returns its number.
    pub fn add(&mut self, action: Action) -> u32 {
        let id = self.next;
        self.next += 1;
        let numbered = Numbered { id, forbidden: self.forbidden, action };
        self.modes.add(self.description, &numbered);
        self.sequence.push(numbered);
        id
    }

    /// Returns the full name of a function in the spelling of the FMI version, such as `fmi2GetFMUstate` or `fmi3GetFMUState`.
    fn named(&self, function: &str) -> String {
        let mut all = signatures(self.description.standard).iter().map(|signature| signature.rule.name);
        let name = all.find(|name| name[4..].eq_ignore_ascii_case(function));
        name.map_or_else(|| function.to_owned(), str::to_owned)
    }

    /// Adds a call of a function, which is named without `fmi2` or `fmi3`.
    pub fn call(&mut self, instance: usize, function: &str, args: Vec<Arg>) -> u32 {
        self.add(Action::Call { instance: Some(instance), function: self.named(function), args })
    }

    /// Adds a call that the standard forbids, or whose arguments it forbids.
    pub fn forbidden(&mut self, instance: Option<usize>, function: &str, args: Vec<Arg>) -> u32 {
        let before = std::mem::replace(&mut self.forbidden, true);
        let id = self.add(Action::Call { instance, function: self.named(function), args });
        self.forbidden = before;
        id
    }

    /// Returns the usual arguments of an instantiation, which a check may change.
    pub fn how(&self) -> Make {
        let stepped = self.trajectory.is_stepped();
        Make {
            co_simulation: stepped,
            name: "instance".to_owned(),
            token: self.description.token.clone(),
            visible: false,
            logging: true,
            event_mode: stepped && self.description.event_mode(),
            early_return: false,
        }
    }

    /// Instantiates with the usual arguments.
    pub fn make(&mut self, instance: usize) -> u32 {
        self.make_with(instance, |_| {})
    }

    /// Instantiates with arguments that `change` changes.
    pub fn make_with(&mut self, instance: usize, change: impl FnOnce(&mut Make)) -> u32 {
        let mut how = self.how();
        change(&mut how);
        self.add(Action::Make(instance, how))
    }

    pub fn free(&mut self, instance: usize) -> u32 {
        self.add(Action::Free(instance))
    }

    /// Enters Initialization Mode at the start time of the default experiment.
    pub fn enter(&mut self, instance: usize) -> u32 {
        self.enter_with(instance, None, self.description.start_time, None)
    }

    /// Enters Initialization Mode with a tolerance, a start time and a stop time.
    pub fn enter_with(
        &mut self,
        instance: usize,
        tolerance: Option<f64>,
        start: f64,
        stop: Option<f64>,
    ) -> u32 {
        let defined = |number: Option<f64>| {
            [Arg::Integer(number.is_some().into()), Arg::real(number.unwrap_or_default())]
        };
        let mut experiment = defined(tolerance).to_vec();
        experiment.push(Arg::real(start));
        experiment.extend(defined(stop));
        if self.fmi3() {
            self.call(instance, "EnterInitializationMode", experiment)
        } else {
            self.call(instance, "SetupExperiment", experiment);
            self.call(instance, "EnterInitializationMode", vec![])
        }
    }

    /// Writes an update of the discrete states, which the worker repeats until no further update is needed.
    pub fn update(&mut self, instance: usize) -> u32 {
        let (name, args) = match self.fmi3() {
            true => {
                let mut args = vec![Arg::Out(Kind::U8, 1); 5];
                args.push(Arg::Out(Kind::F64, 1));
                ("UpdateDiscreteStates", args)
            }
            // fmi2EventInfo has five flags and padding of 4 bytes each, and a time of 8 bytes: 32 bytes in total.
            false => ("NewDiscreteStates", vec![Arg::Out(Kind::U64, 4)]),
        };
        self.call(instance, name, args)
    }

    /// Writes an event: enters Event Mode, updates the discrete states and returns to the mode in which time advances.
    pub fn event(&mut self, instance: usize) -> Vec<u32> {
        let mut ids = vec![self.call(instance, "EnterEventMode", vec![])];
        ids.extend(self.leave_event(instance));
        ids
    }

    /// Updates the discrete states and leaves Event Mode.
    pub fn leave_event(&mut self, instance: usize) -> Vec<u32> {
        vec![self.update(instance), self.resume(instance)]
    }

    /// Leaves Event Mode for the mode in which time advances.
    fn resume(&mut self, instance: usize) -> u32 {
        let stepped = self.trajectory.is_stepped();
        self.call(instance, if stepped { "EnterStepMode" } else { "EnterContinuousTimeMode" }, vec![])
    }

    /// Leaves Initialization Mode for the mode in which time advances.
    pub fn leave(&mut self, instance: usize) -> Vec<u32> {
        let mut ids = vec![self.call(instance, "ExitInitializationMode", vec![])];
        if !self.trajectory.is_stepped() || self.description.event_mode() {
            ids.push(self.update(instance));
            ids.push(self.resume(instance));
        }
        ids
    }

    /// Instantiates and initializes, up to the mode in which time advances.
    pub fn begin(&mut self, instance: usize) -> Vec<u32> {
        let mut ids = vec![self.make(instance), self.enter(instance)];
        ids.extend(self.leave(instance));
        ids
    }

    /// Instantiates, sets variables, and initializes, up to the mode in which time advances.
    pub fn begin_with(&mut self, instance: usize, values: &[(usize, Values)]) {
        self.make(instance);
        self.set(instance, values);
        self.enter(instance);
        self.leave(instance);
    }

    pub fn step(&mut self, instance: usize, time: f64, size: f64) -> u32 {
        self.call(instance, "DoStep", step_args(self.description.standard, time, size))
    }

    /// Makes `count` steps of this size; returns the time after them.
    pub fn steps(&mut self, instance: usize, mut time: f64, size: f64, count: usize) -> f64 {
        for _ in 0..count {
            self.step(instance, time, size);
            time += size;
        }
        time
    }

    /// Integrates Model Exchange with four Runge-Kutta steps, or a step of Euler's method if there are no states.
    pub fn integrate(&mut self, instance: usize, begin: f64, end: f64) -> u32 {
        let euler = self.description.states_count() == 0;
        self.integrate_in(instance, begin, end, 4, euler)
    }

    /// Integrates Model Exchange with this number of steps of Euler's or of the classical Runge-Kutta method.
    pub fn integrate_in(&mut self, instance: usize, begin: f64, end: f64, steps: usize, euler: bool) -> u32 {
        let (states, indicators) = (self.description.states_count(), self.description.indicators_count());
        self.add(Action::Integrate(instance, Integration { begin, end, steps, euler, states, indicators }))
    }

    /// Advances by the step of this number, counted from 0, of a simulation in equal steps: by a step of Co-Simulation, or by an
    /// integration of the same duration.
    pub fn advance(&mut self, instance: usize, start: f64, size: f64, number: usize) -> u32 {
        let time = |number: usize| start + number as f64 * size;
        match self.trajectory.is_stepped() {
            true => self.step(instance, time(number), size),
            false => self.integrate(instance, time(number), time(number + 1)),
        }
    }

    /// Completes an integrator step of Model Exchange.
    pub fn complete_step(&mut self, instance: usize) -> u32 {
        let flag = Arg::Out(if self.fmi3() { Kind::U8 } else { Kind::I32 }, 1);
        self.call(instance, "CompletedIntegratorStep", vec![Arg::Integer(0), flag.clone(), flag])
    }

    pub fn set_states(&mut self, instance: usize, states: &[f64]) -> u32 {
        let bits = states.iter().map(|number| number.to_bits()).collect();
        self.call(
            instance,
            "SetContinuousStates",
            vec![Arg::In(Kind::F64, bits), Arg::Integer(states.len() as i64)],
        )
    }

    /// Reads a vector of `count` numbers.
    pub fn vector(&mut self, instance: usize, function: &str, count: usize) -> u32 {
        self.call(instance, function, vec![Arg::Out(Kind::F64, count), Arg::Integer(count as i64)])
    }

    /// Reads the vectors of Model Exchange that have elements: states, derivatives and event indicators.
    pub fn vectors(&mut self, instance: usize) -> [Option<u32>; 3] {
        let (states, indicators) = (self.description.states_count(), self.description.indicators_count());
        [
            ("GetContinuousStates", states),
            (self.derivatives_name(), states),
            ("GetEventIndicators", indicators),
        ]
        .map(|(name, count)| (count > 0).then(|| self.vector(instance, name, count)))
    }

    /// Returns a writer for the actions of a thread, whose numbers follow the ones of this writer.
    pub fn thread(&self) -> Self {
        Self { next: self.next, ..Self::new(self.description, self.trajectory, self.readable) }
    }

    /// Runs the actions of these writers at the same time. Each was made by `thread` of the one before, the first by `thread` of this.
    pub fn join(&mut self, threads: Vec<Self>) {
        self.next = threads.last().map_or(self.next, |thread| thread.next);
        self.add(Action::Parallel(threads.into_iter().map(|thread| thread.sequence).collect()));
    }

    pub fn derivatives_name(&self) -> &'static str {
        if self.fmi3() { "GetContinuousStateDerivatives" } else { "GetDerivatives" }
    }

    /// Serializes a saved state in two calls, for the size and for the bytes; returns the number of each.
    pub fn serialize(&mut self, instance: usize, slot: usize) -> [u32; 2] {
        let bytes = vec![Arg::State(slot), Arg::SavedOut(slot), Arg::SavedSize(slot)];
        [
            self.call(instance, "SerializedFMUStateSize", vec![Arg::State(slot), Arg::SizeOut(slot)]),
            self.call(instance, "SerializeFMUState", bytes),
        ]
    }

    /// Deserializes the bytes at the index `bytes` into the saved state at the index `slot`.
    pub fn deserialize(&mut self, instance: usize, bytes: usize, slot: usize) -> u32 {
        let args = vec![Arg::Saved(bytes), Arg::SavedSize(bytes), Arg::StateOut(slot)];
        self.call(instance, "DeserializeFMUState", args)
    }
}

/// Returns the arguments of a getter or setter that follow the instance.
pub fn access(
    standard: Standard,
    references: Vec<u64>,
    values: impl IntoIterator<Item = Arg>,
    total: usize,
) -> Vec<Arg> {
    let count = Arg::Integer(references.len() as i64);
    let sizes = (standard == Standard::Fmi3).then_some(Arg::Integer(total as i64));
    [Arg::In(Kind::U32, references), count].into_iter().chain(values).chain(sizes).collect()
}

/// Returns the arguments of fmi2DoStep or fmi3DoStep that follow the instance.
pub fn step_args(standard: Standard, time: f64, size: f64) -> Vec<Arg> {
    let mut args = vec![Arg::real(time), Arg::real(size), Arg::Integer(0)];
    if standard == Standard::Fmi3 {
        args.extend([Kind::U8, Kind::U8, Kind::U8, Kind::F64].map(|kind| Arg::Out(kind, 1)));
    }
    args
}

/// Name of an instance, with spaces, characters beyond ASCII and a conversion of printf. An FMU may repeat the name in its
/// messages.
pub const LONG_NAME: &str = "a long name, with Gödel in it %s #1#";
