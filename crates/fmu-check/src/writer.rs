//! Writes sequences: the calls of an importer that does what the standard says, with the numbers of this FMU.

use crate::call_sequence::{Arg, CallSequence, Kind, Make, Numbered, Run, Step, Written, steps_itself};
use crate::description::{Description, kind_of, type_name};
use crate::finding::status_name;
use crate::values::Value;
use fmi_abi::{BaseType, Interface, Standard};

/// A read: the number of the step, and the indices of the variables with the number of values of each.
#[derive(Clone, Debug)]
pub struct Read {
    /// The step.
    pub id: u32,
    /// The variables.
    pub of: Vec<(usize, usize)>,
}

/// The variables of a type, with how many values each has.
type Group = (&'static str, Kind, Vec<(usize, usize)>);

/// One point of a trajectory.
#[derive(Clone, Debug, Default)]
pub struct Point {
    /// Time at which the step begins; in Model Exchange the time at which states are set.
    pub time: f64,
    /// How long it is.
    pub size: f64,
    /// Values that are set before the step.
    pub inputs: Vec<(usize, Value)>,
    /// Model Exchange: what the states are set to.
    pub states: Vec<f64>,
    /// Number of updates of the discrete states in an event at this point; 0 if there is no event.
    pub updates: usize,
}

/// A simulation that goes well, as data.
#[derive(Clone, Debug)]
pub struct Trajectory {
    /// The interface type.
    pub interface: Interface,
    /// Updates of the discrete states after the initialization.
    pub updates: usize,
    /// The points.
    pub points: Vec<Point>,
    /// The time at the end.
    pub end: f64,
}

/// Writes a sequence.
pub struct Writer<'a> {
    /// Model description of the FMU.
    pub description: &'a Description,
    /// The steps so far.
    pub sequence: CallSequence,
    /// The next number.
    pub next: u32,
    /// Whether the steps that follow are forbidden by the standard.
    pub forbidden: bool,
}

impl<'a> Writer<'a> {
    /// An empty sequence.
    pub fn new(description: &'a Description) -> Self {
        Self { description, sequence: Vec::new(), next: 0, forbidden: false }
    }

    /// Whether the standard is 3.0.
    pub fn fmi3(&self) -> bool {
        self.description.standard == Standard::Fmi3
    }

    /// Adds a step.
    pub fn add(&mut self, step: Step) -> u32 {
        let id = self.next;
        self.next += 1;
        self.sequence.push(Numbered { id, forbidden: self.forbidden, step });
        id
    }

    /// Adds a call of a function, named without `fmi2` or `fmi3`.
    pub fn call(&mut self, of: usize, function: &str, args: Vec<Arg>) -> u32 {
        let function = format!("{}{function}", if self.fmi3() { "fmi3" } else { "fmi2" });
        self.add(Step::Call { of: Some(of), function, args })
    }

    /// A call that the standard forbids, or whose arguments it forbids.
    pub fn forbidden(&mut self, of: Option<usize>, function: &str, args: Vec<Arg>) -> u32 {
        let function = format!("{}{function}", if self.fmi3() { "fmi3" } else { "fmi2" });
        let before = std::mem::replace(&mut self.forbidden, true);
        let id = self.add(Step::Call { of, function, args });
        self.forbidden = before;
        id
    }

    /// How instances are made.
    pub fn how(&self, interface: Interface) -> Make {
        Make {
            co_simulation: steps_itself(interface),
            name: Some("instance".to_owned()),
            token: Some(self.description.token.clone()),
            logging: true,
            event_mode: steps_itself(interface) && self.description.event_mode(),
            early_return: false,
            resources: true,
        }
    }

    /// A new instance.
    pub fn make(&mut self, of: usize, interface: Interface) -> u32 {
        let how = self.how(interface);
        self.add(Step::Make(of, how))
    }

    /// Frees an instance.
    pub fn free(&mut self, of: usize) -> u32 {
        self.add(Step::Free(of))
    }

    /// Enters Initialization Mode.
    pub fn enter(&mut self, of: usize) -> u32 {
        self.enter_with(of, None, self.description.start_time, None)
    }

    /// Sets tolerance, start time and stop time.
    pub fn enter_with(&mut self, of: usize, tolerance: Option<f64>, start: f64, stop: Option<f64>) -> u32 {
        let defined = |number: Option<f64>| {
            [Arg::Whole(number.is_some().into()), Arg::real(number.unwrap_or_default())]
        };
        let mut experiment = defined(tolerance).to_vec();
        experiment.push(Arg::real(start));
        experiment.extend(defined(stop));
        if self.fmi3() {
            self.call(of, "EnterInitializationMode", experiment)
        } else {
            self.call(of, "SetupExperiment", experiment);
            self.call(of, "EnterInitializationMode", vec![])
        }
    }

    /// Sets another start time.
    pub fn start_at(&mut self, time: f64) {
        for numbered in &mut self.sequence {
            if let Step::Call { function, args, .. } = &mut numbered.step
                && ["SetupExperiment", "EnterInitializationMode"].contains(&&function[4..])
                && let Some(start) = args.get_mut(2)
            {
                *start = Arg::real(time);
            }
        }
    }

    /// Writes this many updates of the discrete states; returns their numbers.
    pub fn update(&mut self, of: usize, times: usize) -> Vec<u32> {
        let flag = || Arg::Out(Kind::U8, 1);
        (0..times)
            .map(|_| {
                if self.fmi3() {
                    let args = vec![flag(), flag(), flag(), flag(), flag(), Arg::Out(Kind::F64, 1)];
                    self.call(of, "UpdateDiscreteStates", args)
                } else {
                    // The five flags and the time of fmi2EventInfo, with the gap that C leaves between them.
                    self.call(of, "NewDiscreteStates", vec![Arg::Out(Kind::U64, 4)])
                }
            })
            .collect()
    }

    /// Leaves Initialization Mode, for the mode in which time goes on.
    pub fn leave(&mut self, of: usize, trajectory: &Trajectory) -> Vec<u32> {
        let mut ids = vec![self.call(of, "ExitInitializationMode", vec![])];
        if trajectory.interface == Interface::ModelExchange {
            ids.extend(self.update(of, trajectory.updates));
            ids.push(self.call(of, "EnterContinuousTimeMode", vec![]));
        } else if self.description.event_mode() {
            ids.extend(self.update(of, trajectory.updates));
            ids.push(self.call(of, "EnterStepMode", vec![]));
        }
        ids
    }

    /// Instantiates and initializes, up to the mode in which time advances.
    pub fn begin(&mut self, of: usize, trajectory: &Trajectory) -> Vec<u32> {
        let mut ids = vec![self.make(of, trajectory.interface), self.enter(of)];
        ids.extend(self.leave(of, trajectory));
        ids
    }

    /// Sets values: a call for each type.
    pub fn set(&mut self, of: usize, values: &[(usize, Value)]) -> Vec<u32> {
        let mut ids = Vec::new();
        let standard = self.description.standard;
        let mut types: Vec<&str> = Vec::new();
        for (index, _) in values {
            if let Some(base) = self.description.variables[*index].base
                && !types.contains(&type_name(standard, base))
            {
                types.push(type_name(standard, base));
            }
        }
        for name in types {
            let of_type = |index: usize| {
                self.description.variables[index].base.is_some_and(|base| type_name(standard, base) == name)
            };
            let these: Vec<_> = values.iter().filter(|(index, _)| of_type(*index)).collect();
            let references = these
                .iter()
                .map(|(index, _)| u64::from(self.description.variables[*index].reference))
                .collect();
            let count = these.len() as i64;
            let kind =
                kind_of(standard, self.description.variables[these[0].0].base.unwrap_or(BaseType::Real));
            let mut args = vec![Arg::In(Kind::U32, references), Arg::Whole(count)];
            let mut total = 0;
            if kind == Kind::Pointer {
                let texts: Vec<Vec<u8>> = these
                    .iter()
                    .flat_map(|(_, value)| match value {
                        Value::Texts(texts) => texts.clone(),
                        Value::Numbers(_) => Vec::new(),
                    })
                    .collect();
                total = texts.len();
                if name == "Binary" {
                    args.push(Arg::In(Kind::Size, texts.iter().map(|blob| blob.len() as u64).collect()));
                    args.push(Arg::Blobs(texts));
                } else {
                    args.push(Arg::Texts(texts.into_iter().map(Some).collect()));
                }
            } else {
                let numbers: Vec<u64> = these
                    .iter()
                    .flat_map(|(_, value)| match value {
                        Value::Numbers(numbers) => numbers.iter().map(|number| kind.bits(*number)).collect(),
                        Value::Texts(_) => Vec::new(),
                    })
                    .collect();
                total += numbers.len();
                args.push(Arg::In(kind, numbers));
            }
            if self.fmi3() {
                args.push(Arg::Whole(total as i64));
            }
            ids.push(self.call(of, &format!("Set{name}"), args));
        }
        ids
    }

    /// Reads the variables at these indices: a call for each type.
    pub fn read_these(&mut self, of: usize, indices: &[usize]) -> Vec<Read> {
        let standard = self.description.standard;
        let mut groups: Vec<Group> = Vec::new();
        for index in indices {
            let variable = &self.description.variables[*index];
            let (Some(base), Some(size)) = (variable.base, variable.size) else { continue };
            let name = type_name(standard, base);
            let at = groups.iter().position(|group| group.0 == name).unwrap_or_else(|| {
                groups.push((name, kind_of(standard, base), Vec::new()));
                groups.len() - 1
            });
            groups[at].2.push((*index, size));
        }
        let mut reads = Vec::new();
        for (name, kind, group) in groups {
            let references = group
                .iter()
                .map(|(index, _)| u64::from(self.description.variables[*index].reference))
                .collect();
            let total: usize = group.iter().map(|(_, size)| size).sum();
            let mut args = vec![Arg::In(Kind::U32, references), Arg::Whole(group.len() as i64)];
            if name == "Binary" {
                args.push(Arg::Out(Kind::Size, total));
            }
            args.push(Arg::Out(kind, total));
            if self.fmi3() {
                args.push(Arg::Whole(total as i64));
            }
            let id = self.call(of, &format!("Get{name}"), args);
            reads.push(Read { id, of: group });
        }
        reads
    }

    /// Reads all variables.
    pub fn read(&mut self, of: usize) -> Vec<Read> {
        let all = readable(self.description);
        self.read_these(of, &all)
    }

    /// Goes on to the time of a point, in Model Exchange, or takes the step, in Co-Simulation.
    pub fn point(&mut self, of: usize, trajectory: &Trajectory, point: &Point) -> Vec<u32> {
        let mut ids = Vec::new();
        match trajectory.interface {
            Interface::CoSimulation => {
                ids.extend(self.set(of, &point.inputs));
                ids.push(self.step(of, point.time, point.size));
                if point.updates > 0 {
                    ids.push(self.call(of, "EnterEventMode", vec![]));
                    ids.extend(self.update(of, point.updates));
                    ids.push(self.call(of, "EnterStepMode", vec![]));
                }
            }
            Interface::ModelExchange => {
                ids.push(self.call(of, "SetTime", vec![Arg::real(point.time)]));
                if !point.states.is_empty() {
                    ids.push(self.set_states(of, &point.states));
                }
                ids.extend(self.set(of, &point.inputs));
                let flag = || {
                    Arg::Out(
                        if self.description.standard == Standard::Fmi3 { Kind::U8 } else { Kind::I32 },
                        1,
                    )
                };
                let args = vec![Arg::Whole(0), flag(), flag()];
                ids.push(self.call(of, "CompletedIntegratorStep", args));
                if point.updates > 0 {
                    ids.push(self.call(of, "EnterEventMode", vec![]));
                    ids.extend(self.update(of, point.updates));
                    ids.push(self.call(of, "EnterContinuousTimeMode", vec![]));
                }
            }
        }
        ids
    }

    /// A step of Co-Simulation.
    pub fn step(&mut self, of: usize, time: f64, size: f64) -> u32 {
        let mut args = vec![Arg::real(time), Arg::real(size), Arg::Whole(0)];
        if self.fmi3() {
            let flag = || Arg::Out(Kind::U8, 1);
            args.extend([flag(), flag(), flag(), Arg::Out(Kind::F64, 1)]);
        }
        self.call(of, "DoStep", args)
    }

    /// Sets the continuous states.
    pub fn set_states(&mut self, of: usize, states: &[f64]) -> u32 {
        let bits = states.iter().map(|number| number.to_bits()).collect();
        self.call(of, "SetContinuousStates", vec![Arg::In(Kind::F64, bits), Arg::Whole(states.len() as i64)])
    }

    /// Reads a vector of so many numbers.
    pub fn vector(&mut self, of: usize, function: &str, count: usize) -> u32 {
        self.call(of, function, vec![Arg::Out(Kind::F64, count), Arg::Whole(count as i64)])
    }

    /// Reads the derivatives of the states.
    pub fn derivatives(&mut self, of: usize, count: usize) -> u32 {
        let name = if self.fmi3() { "GetContinuousStateDerivatives" } else { "GetDerivatives" };
        self.vector(of, name, count)
    }

    /// Everything that can be asked: variables, and in Model Exchange the vectors.
    pub fn ask(&mut self, of: usize, interface: Interface) -> Vec<Read> {
        let mut reads = self.read(of);
        if interface == Interface::ModelExchange {
            let states = self.description.states_count().unwrap_or(0);
            if states > 0 {
                reads.push(Read { id: self.vector(of, "GetContinuousStates", states), of: Vec::new() });
                reads.push(Read { id: self.derivatives(of, states), of: Vec::new() });
            }
            if let Some(count) = self.description.event_indicators.filter(|count| *count > 0) {
                reads.push(Read { id: self.vector(of, "GetEventIndicators", count), of: Vec::new() });
            }
        }
        reads
    }

    fn state_name(&self, of_fmi2: &str, of_fmi3: &str) -> String {
        if self.fmi3() { of_fmi3 } else { of_fmi2 }.to_owned()
    }

    /// Saves the state.
    pub fn save(&mut self, of: usize, slot: usize) -> u32 {
        let name = self.state_name("GetFMUstate", "GetFMUState");
        self.call(of, &name, vec![Arg::StateOut(slot)])
    }

    /// Restores it.
    pub fn restore(&mut self, of: usize, slot: usize) -> u32 {
        let name = self.state_name("SetFMUstate", "SetFMUState");
        self.call(of, &name, vec![Arg::State(slot)])
    }

    /// Frees it.
    pub fn drop_state(&mut self, of: usize, slot: usize) -> u32 {
        let name = self.state_name("FreeFMUstate", "FreeFMUState");
        self.call(of, &name, vec![Arg::StateOut(slot)])
    }

    /// Serializes it: the size, the bytes.
    pub fn serialize(&mut self, of: usize, slot: usize) -> [u32; 2] {
        let size = self.state_name("SerializedFMUstateSize", "SerializedFMUStateSize");
        let bytes = self.state_name("SerializeFMUstate", "SerializeFMUState");
        [
            self.call(of, &size, vec![Arg::State(slot), Arg::SizeOut(slot)]),
            self.call(of, &bytes, vec![Arg::State(slot), Arg::SavedOut(slot), Arg::SavedSize(slot)]),
        ]
    }

    /// Makes a state of the bytes.
    pub fn deserialize(&mut self, of: usize, bytes: usize, slot: usize) -> u32 {
        let name = self.state_name("DeSerializeFMUstate", "DeserializeFMUState");
        self.call(of, &name, vec![Arg::Saved(bytes), Arg::SavedSize(bytes), Arg::StateOut(slot)])
    }
}

/// Variables that most checks read at most.
pub const READ: usize = 1000;

/// The variables that can be read at any time: no clocks, none whose size is not known. Of more than a thousand, inputs,
/// outputs and derivatives come first, and others are taken at equal distances.
pub fn readable(description: &Description) -> Vec<usize> {
    sample(description, READ)
}

/// At most this many of the variables that can be read at any time.
pub fn sample(description: &Description, most: usize) -> Vec<usize> {
    let known = |index: &usize| {
        let variable = &description.variables[*index];
        variable.base.is_some() && variable.size.is_some()
    };
    let all: Vec<usize> = (0..description.variables.len()).filter(known).collect();
    if all.len() <= most {
        return all;
    }
    let first = |index: &usize| {
        let variable = &description.variables[*index];
        ["input", "output", "independent"].contains(&variable.causality.as_str())
            || variable.derivative_of.is_some()
    };
    let (first, others): (Vec<usize>, Vec<usize>) = all.into_iter().partition(first);
    let evenly = |from: Vec<usize>, most: usize| -> Vec<usize> {
        let step = from.len().div_ceil(most.max(1)).max(1);
        from.into_iter().step_by(step).collect()
    };
    let mut found = evenly(first, most / 2);
    found.extend(evenly(others, most - found.len()));
    found.sort_unstable();
    found
}

/// The first difference between what was read here and there: the variable and both values.
pub fn difference(
    description: &Description,
    run: &Run,
    one: &[Read],
    other: &[Read],
) -> Option<(String, String, String)> {
    for (one, other) in one.iter().zip(other) {
        let (Some(of_one), Some(of_other)) = (run.of(one.id), run.of(other.id)) else { continue };
        if of_one.status != of_other.status {
            let show =
                |status: Option<i32>| format!("status {}", status.map_or("none".to_owned(), status_name));
            return Some(("a call".to_owned(), show(of_one.status), show(of_other.status)));
        }
        // After an error nothing is required of what was written.
        if of_one.status.is_none_or(|status| status > 1) {
            continue;
        }
        for (first, second) in of_one.written.iter().zip(&of_other.written) {
            if let Some(index) = first.differ(second) {
                return Some((name_at(description, one, index), first.show(index), second.show(index)));
            }
        }
    }
    None
}

/// Whose value is at an index of what was read.
pub fn name_at(description: &Description, read: &Read, index: usize) -> String {
    let mut rest = index;
    for (variable, size) in &read.of {
        if rest < *size {
            let name = &description.variables[*variable].name;
            return if *size == 1 { name.clone() } else { format!("{name}[{rest}]") };
        }
        rest -= size;
    }
    format!("number {}", index + 1)
}

/// The value of a variable in what was read.
pub fn value_of(run: &Run, reads: &[Read], variable: usize) -> Option<Written> {
    for read in reads {
        let mut begin = 0;
        for (index, size) in &read.of {
            if *index == variable {
                let outcome = run.of(read.id)?;
                if outcome.status.is_none_or(|status| status > 1) {
                    return None;
                }
                return outcome.written.first()?.part(begin, *size);
            }
            begin += size;
        }
    }
    None
}
