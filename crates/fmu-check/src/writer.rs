//! Writes call sequences of an importer that follows the standard.

use crate::call_sequence::{Arg, CallSequence, Kind, Make, Numbered, Run, Step, Values};
use crate::description::{Description, kind_of, type_name};
use crate::finding::status_name;
use crate::legal::Modes;
use fmi_abi::calls::signatures;
use fmi_abi::{Interface, Standard};

/// Step that reads variables: its number, and the index and the number of values of each variable.
#[derive(Clone, Debug)]
pub struct Read {
    pub id: u32,
    pub variables: Vec<(usize, usize)>,
}

impl Read {
    /// Returns each variable with the index of its first value and the number of its values.
    pub fn parts(&self) -> impl Iterator<Item = (usize, usize, usize)> {
        self.variables.iter().scan(0, |end, (variable, size)| {
            *end += size;
            Some((*variable, *end - size, *size))
        })
    }
}

/// Point of a trajectory.
#[derive(Clone, Debug, Default)]
pub struct Point {
    /// Time at which the step begins; in Model Exchange the time that is set.
    pub time: f64,
    /// Step size; in Model Exchange the time since the point before.
    pub size: f64,
    /// Inputs that are set before the step, by the indices of their variables.
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

/// Part of a simulation.
#[derive(Clone, Copy, Debug)]
pub enum Part {
    Make,
    Enter,
    /// Leaves Initialization Mode for the mode in which time advances.
    Leave,
    /// Instantiates and initializes.
    Begin,
    /// Simulates the first points of the trajectory, at most this many.
    Points(usize),
    /// Simulates from this point to the end, and reads the variables and vectors after each point.
    Run(usize),
    Read,
    /// Reads the variables and vectors.
    ReadAll,
    /// Calls a function without arguments.
    Call(&'static str),
    /// Updates the discrete states until no further update is needed.
    Update,
    /// Saves the state with this index.
    Save(usize),
    Restore(usize),
    /// Frees the saved state with this index.
    Drop(usize),
    Free,
}

/// Numbers of calls that were written, and the reads.
#[derive(Clone, Default)]
pub struct Calls {
    /// Numbers of the calls that read nothing.
    pub ids: Vec<u32>,
    /// Calls that read variables.
    pub reads: Vec<Read>,
}

/// Writer of a call sequence.
pub struct Writer<'a> {
    pub description: &'a Description,
    /// Simulation that the sequence varies.
    pub trajectory: &'a Trajectory,
    /// Indices of the variables that are read.
    pub readable: &'a [usize],
    /// Steps that were written.
    pub sequence: CallSequence,
    pub next: u32,
    /// Whether the standard forbids the next steps.
    pub forbidden: bool,
    /// Modes of the instances after the last step.
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

    pub fn add(&mut self, step: Step) -> u32 {
        let id = self.next;
        self.next += 1;
        let numbered = Numbered { id, forbidden: self.forbidden, step };
        self.modes.add(self.description, &numbered);
        self.sequence.push(numbered);
        id
    }

    /// Returns the name of a function with its prefix and, for FMI 2.0, with `FMUstate` instead of `FMUState`.
    fn named(&self, function: &str) -> String {
        let mut all = signatures(self.description.standard).iter().map(|signature| signature.rule.name);
        let name = all.find(|name| name[4..].eq_ignore_ascii_case(function));
        name.map_or_else(|| function.to_owned(), str::to_owned)
    }

    /// Adds a call of a function, which is named without `fmi2` or `fmi3`.
    pub fn call(&mut self, instance: usize, function: &str, args: Vec<Arg>) -> u32 {
        self.add(Step::Call { instance: Some(instance), function: self.named(function), args })
    }

    /// Adds a call that the standard forbids, or whose arguments it forbids.
    pub fn forbidden(&mut self, instance: Option<usize>, function: &str, args: Vec<Arg>) -> u32 {
        let before = std::mem::replace(&mut self.forbidden, true);
        let id = self.add(Step::Call { instance, function: self.named(function), args });
        self.forbidden = before;
        id
    }

    pub fn write(&mut self, instance: usize, parts: &[Part]) -> Calls {
        let mut calls = Calls::default();
        let points = &self.trajectory.points;
        for part in parts {
            match *part {
                Part::Make => calls.ids.push(self.make(instance)),
                Part::Enter => calls.ids.push(self.enter(instance)),
                Part::Leave => calls.ids.extend(self.leave(instance)),
                Part::Begin => calls.ids.extend(self.begin(instance)),
                Part::Points(count) => {
                    calls.ids.extend(points.iter().take(count).flat_map(|point| self.point(instance, point)));
                }
                Part::Run(from) => {
                    for point in &points[from..] {
                        calls.ids.extend(self.point(instance, point));
                        calls.reads.extend(self.read_all(instance));
                    }
                }
                Part::Read => calls.reads.extend(self.read(instance)),
                Part::ReadAll => calls.reads.extend(self.read_all(instance)),
                Part::Call(function) => calls.ids.push(self.call(instance, function, vec![])),
                Part::Update => calls.ids.push(self.update(instance)),
                Part::Save(slot) => {
                    calls.ids.push(self.call(instance, "GetFMUState", vec![Arg::StateOut(slot)]))
                }
                Part::Restore(slot) => {
                    calls.ids.push(self.call(instance, "SetFMUState", vec![Arg::State(slot)]))
                }
                Part::Drop(slot) => {
                    calls.ids.push(self.call(instance, "FreeFMUState", vec![Arg::StateOut(slot)]))
                }
                Part::Free => calls.ids.push(self.free(instance)),
            }
        }
        calls
    }

    /// Writes parts of a simulation, and returns the reads of each part that reads.
    pub fn groups<const N: usize>(&mut self, instance: usize, parts: &[Part]) -> [Vec<Read>; N] {
        let groups = parts.iter().filter_map(|part| {
            let reads = self.write(instance, &[*part]).reads;
            matches!(part, Part::Read | Part::ReadAll | Part::Run(_)).then_some(reads)
        });
        let groups: Vec<Vec<Read>> = groups.collect();
        groups.try_into().unwrap_or_else(|_| panic!("the number of parts that read is not {N}"))
    }

    /// Returns the usual arguments of an instantiation.
    pub fn how(&self) -> Make {
        let stepped = self.trajectory.is_stepped();
        Make {
            co_simulation: stepped,
            name: "instance".to_owned(),
            token: self.description.token.clone(),
            logging: true,
            event_mode: stepped && self.description.event_mode(),
            early_return: false,
        }
    }

    pub fn make(&mut self, instance: usize) -> u32 {
        self.make_with(instance, |_| {})
    }

    pub fn make_with(&mut self, instance: usize, change: impl FnOnce(&mut Make)) -> u32 {
        let mut how = self.how();
        change(&mut how);
        self.add(Step::Make(instance, how))
    }

    pub fn free(&mut self, instance: usize) -> u32 {
        self.add(Step::Free(instance))
    }

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
            // fmi2EventInfo has five flags, padding and the time.
            false => ("NewDiscreteStates", vec![Arg::Out(Kind::U64, 4)]),
        };
        self.call(instance, name, args)
    }

    /// Writes an event: enters Event Mode, updates the discrete states and returns to the mode before.
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

    /// Returns the positions of the variables of each type in `indices`, with the name and the C type of the type.
    fn by_type(&self, indices: &[usize]) -> Vec<(&'static str, Kind, Vec<usize>)> {
        let standard = self.description.standard;
        let mut groups: Vec<(&str, Kind, Vec<usize>)> = Vec::new();
        for (position, index) in indices.iter().enumerate() {
            let variable = &self.description.variables[*index];
            let (Some(base), Some(_)) = (variable.base, variable.size) else { continue };
            let name = type_name(standard, base);
            match groups.iter_mut().find(|group| group.0 == name) {
                Some(group) => group.2.push(position),
                None => groups.push((name, kind_of(standard, base), vec![position])),
            }
        }
        groups
    }

    fn reference(&self, index: usize) -> u64 {
        u64::from(self.description.variables[index].reference)
    }

    /// Sets values with a call for each type.
    pub fn set(&mut self, instance: usize, values: &[(usize, Values)]) -> Vec<u32> {
        let indices: Vec<usize> = values.iter().map(|(index, _)| *index).collect();
        let mut ids = Vec::new();
        for (name, kind, positions) in self.by_type(&indices) {
            let references = positions.iter().map(|at| self.reference(indices[*at])).collect();
            let (mut numbers, mut texts) = (Vec::new(), Vec::new());
            for position in positions {
                match &values[position].1 {
                    Values::Numbers(_, bits) => numbers.extend(bits),
                    Values::Strings(all) => texts.extend(all.iter().cloned()),
                }
            }
            let total = numbers.len() + texts.len();
            let values = match name {
                "Binary" => {
                    let blobs: Vec<Vec<u8>> = texts.into_iter().flatten().collect();
                    let sizes = blobs.iter().map(|blob| blob.len() as u64).collect();
                    vec![Arg::In(Kind::Size, sizes), Arg::Blobs(blobs)]
                }
                "String" => vec![Arg::Strings(texts)],
                _ => vec![Arg::In(kind, numbers)],
            };
            let args = access(self.description.standard, references, values, total);
            ids.push(self.call(instance, &format!("Set{name}"), args));
        }
        ids
    }

    /// Sets the numbers of a variable.
    pub fn set_numbers(&mut self, instance: usize, index: usize, numbers: &[f64]) -> Vec<u32> {
        self.set(instance, &[(index, Values::new(self.description.kind(index), numbers.iter().copied()))])
    }

    /// Reads the variables at these indices with a call for each type. In Initialization Mode, reads only those that may be read there.
    pub fn read_these(&mut self, instance: usize, indices: &[usize]) -> Vec<Read> {
        if !self.modes.is_initializing(instance) {
            return self.read_anyway(instance, indices);
        }
        let allowed = |index: &usize| self.description.is_readable_while_initializing(*index);
        let indices: Vec<usize> = indices.iter().copied().filter(allowed).collect();
        self.read_anyway(instance, &indices)
    }

    /// Reads the variables at these indices with a call for each type. FMI 2.0 allows an FMU to reject some of the calls in Initialization
    /// Mode, which is not a finding.
    pub fn read_anyway(&mut self, instance: usize, indices: &[usize]) -> Vec<Read> {
        let mut reads = Vec::new();
        for (name, kind, positions) in self.by_type(indices) {
            let size = |index: usize| self.description.variables[index].size.unwrap_or(1);
            let group: Vec<_> = positions.iter().map(|at| (indices[*at], size(indices[*at]))).collect();
            let references = group.iter().map(|(index, _)| self.reference(*index)).collect();
            let total: usize = group.iter().map(|(_, size)| size).sum();
            let sizes = (name == "Binary").then_some(Arg::Out(Kind::Size, total));
            let values = sizes.into_iter().chain([Arg::Out(kind, total)]);
            let args = access(self.description.standard, references, values, total);
            reads.push(Read { id: self.call(instance, &format!("Get{name}"), args), variables: group });
        }
        reads
    }

    pub fn read(&mut self, instance: usize) -> Vec<Read> {
        self.read_these(instance, self.readable)
    }

    /// Writes a point: in Co-Simulation sets inputs and advances a step; in Model Exchange sets time, states and inputs. Then writes
    /// the event at the point.
    pub fn point(&mut self, instance: usize, point: &Point) -> Vec<u32> {
        let mut ids = Vec::new();
        if self.trajectory.is_stepped() {
            ids.extend(self.set(instance, &point.inputs));
            ids.push(self.step(instance, point.time, point.size));
        } else {
            ids.push(self.call(instance, "SetTime", vec![Arg::real(point.time)]));
            if !point.states.is_empty() {
                ids.push(self.set_states(instance, &point.states));
            }
            ids.extend(self.set(instance, &point.inputs));
            let flag = Arg::Out(if self.fmi3() { Kind::U8 } else { Kind::I32 }, 1);
            ids.push(self.call(
                instance,
                "CompletedIntegratorStep",
                vec![Arg::Integer(0), flag.clone(), flag],
            ));
        }
        if point.event {
            ids.extend(self.event(instance));
        }
        ids
    }

    pub fn step(&mut self, instance: usize, time: f64, size: f64) -> u32 {
        self.call(instance, "DoStep", step_args(self.description.standard, time, size))
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

    pub fn derivatives_name(&self) -> &'static str {
        if self.fmi3() { "GetContinuousStateDerivatives" } else { "GetDerivatives" }
    }

    /// Reads the variables and, in Model Exchange, the vectors.
    pub fn read_all(&mut self, instance: usize) -> Vec<Read> {
        let mut reads = self.read(instance);
        if !self.trajectory.is_stepped() {
            let states = self.description.states_count().unwrap_or(0);
            let indicators = self.description.event_indicators.unwrap_or(0);
            let vectors = [
                ("GetContinuousStates", states),
                (self.derivatives_name(), states),
                ("GetEventIndicators", indicators),
            ];
            for (name, count) in vectors.into_iter().filter(|(_, count)| *count > 0) {
                reads.push(Read { id: self.vector(instance, name, count), variables: Vec::new() });
            }
        }
        reads
    }

    /// Serializes a saved state; returns the numbers of the calls for the size and for the bytes.
    pub fn serialize(&mut self, instance: usize, slot: usize) -> [u32; 2] {
        let bytes = vec![Arg::State(slot), Arg::SavedOut(slot), Arg::SavedSize(slot)];
        [
            self.call(instance, "SerializedFMUStateSize", vec![Arg::State(slot), Arg::SizeOut(slot)]),
            self.call(instance, "SerializeFMUState", bytes),
        ]
    }

    /// Deserializes the bytes at the index `bytes` to the saved state at the index `slot`.
    pub fn deserialize(&mut self, instance: usize, bytes: usize, slot: usize) -> u32 {
        let args = vec![Arg::Saved(bytes), Arg::SavedSize(bytes), Arg::StateOut(slot)];
        self.call(instance, "DeserializeFMUState", args)
    }
}

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

pub fn step_args(standard: Standard, time: f64, size: f64) -> Vec<Arg> {
    let mut args = vec![Arg::real(time), Arg::real(size), Arg::Integer(0)];
    if standard == Standard::Fmi3 {
        args.extend([Kind::U8, Kind::U8, Kind::U8, Kind::F64].map(|kind| Arg::Out(kind, 1)));
    }
    args
}

/// Name of an instance with spaces, characters beyond ASCII and a conversion of printf, which an FMU may repeat in its messages.
pub const LONG_NAME: &str = "a long name, with Gödel in it %s #1#";

/// Maximum number of variables that most checks read.
pub const READ: usize = 1000;

/// Returns the indices of at most `max_count` variables that can be read: no clocks, no clocked variables, which can only be read while
/// their clock is active (section 2.2.7 of FMI 3.0.2), and none of unknown size. If there are more, at most
/// half are inputs, outputs, derivatives and the independent variable. All are taken at equal distances.
pub fn sample(description: &Description, max_count: usize) -> Vec<usize> {
    let known = |index: &usize| {
        let variable = &description.variables[*index];
        variable.base.is_some() && variable.size.is_some() && !variable.clocked
    };
    let all: Vec<usize> = (0..description.variables.len()).filter(known).collect();
    if all.len() <= max_count {
        return all;
    }
    let first = |index: &usize| {
        let variable = &description.variables[*index];
        ["input", "output", "independent"].contains(&variable.causality.as_str())
            || variable.derivative_of.is_some()
    };
    let (first, others): (Vec<usize>, Vec<usize>) = all.into_iter().partition(first);
    let evenly = |indices: Vec<usize>, count: usize| -> Vec<usize> {
        let step = indices.len().div_ceil(count.max(1)).max(1);
        indices.into_iter().step_by(step).collect()
    };
    let mut found = evenly(first, max_count / 2);
    found.extend(evenly(others, max_count - found.len()));
    found.sort_unstable();
    found
}

/// Returns the first difference between corresponding reads: the name of the variable and both values. Floating-point numbers differ
/// if their relative difference is greater than the tolerance.
pub fn difference(
    description: &Description,
    run: &Run,
    one: &[Read],
    other: &[Read],
    tolerance: f64,
) -> Option<[String; 3]> {
    one.iter().zip(other).find_map(|(one, other)| {
        let (of_one, of_other) = (run.outcome(one.id)?, run.outcome(other.id)?);
        if of_one.status != of_other.status {
            let show =
                |status: Option<i32>| format!("status {}", status.map_or("none".to_owned(), status_name));
            return Some(["a call".to_owned(), show(of_one.status), show(of_other.status)]);
        }
        // After an error, the standard does not define the values.
        let pairs = of_one.written.iter().zip(&of_other.written).filter(|_| run.succeeds(one.id));
        let of_pair = |(first, second): (&Values, &Values)| {
            let nominal = |index| {
                variable_at(one, index).map_or(1.0, |(variable, ..)| description.variables[variable].nominal)
            };
            let index = first.differ_beyond(second, tolerance, nominal)?;
            Some([name_at(description, one, index), first.show(index), second.show(index)])
        };
        pairs.into_iter().find_map(of_pair)
    })
}

/// Returns the name of the variable whose value is at an index of a read.
fn name_at(description: &Description, read: &Read, index: usize) -> String {
    variable_at(read, index).map_or_else(
        || format!("number {}", index + 1),
        |(variable, begin, size)| {
            let name = &description.variables[variable].name;
            if size == 1 { name.clone() } else { format!("{name}[{}]", index - begin) }
        },
    )
}

/// Returns the variable whose value is at an index of a read, the index of its first value, and the number of its values.
fn variable_at(read: &Read, index: usize) -> Option<(usize, usize, usize)> {
    read.parts().find(|(_, begin, size)| (*begin..begin + size).contains(&index))
}

/// Returns the values of the variables of all successful reads.
pub fn values_of<'r>(run: &'r Run, reads: &'r [Read]) -> impl Iterator<Item = (usize, Values)> {
    reads.iter().filter(|read| run.succeeds(read.id)).flat_map(move |read| {
        let value = move |(variable, begin, size)| Some((variable, run.written(read.id)?.part(begin, size)?));
        read.parts().filter_map(value)
    })
}

/// Returns the value of a variable in the first read that contains it.
pub fn value_of(run: &Run, reads: &[Read], variable: usize) -> Option<Values> {
    reads.iter().find_map(|read| {
        let (_, begin, size) = read.parts().find(|(index, ..)| *index == variable)?;
        run.written(read.id).filter(|_| run.succeeds(read.id))?.part(begin, size)
    })
}
