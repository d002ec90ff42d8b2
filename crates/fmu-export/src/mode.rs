//! The states of an instance in the standards' state machines, and sets of them.

use std::fmt;

/// The type of interface that an instance was made for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interface {
    /// The importer integrates.
    ModelExchange = 0,
    /// The FMU steps itself.
    CoSimulation = 1,
}

impl fmt::Display for Interface {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::ModelExchange => "Model Exchange",
            Self::CoSimulation => "Co-Simulation",
        })
    }
}

/// The state of an instance in the sense of the standards' state machines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
#[non_exhaustive]
pub enum Mode {
    /// After it was made or reset.
    Instantiated = 1,
    /// Initialization Mode.
    Initialization = 2,
    /// Co-Simulation: at a communication point.
    StepComplete = 4,
    /// Co-Simulation: a step ended early, or the model wants to end the simulation.
    StepFailed = 8,
    /// Event Mode.
    Event = 16,
    /// Model Exchange: Continuous-Time Mode.
    ContinuousTime = 32,
    /// After the end of the simulation.
    Terminated = 64,
    /// The standard's state after an error. No call leads here, because a refused call changes nothing; a
    /// serialized state may.
    Error = 128,
    /// After a panic.
    Fatal = 256,
}

/// The modes with the letters that the tables of allowed calls have for them. In fatal nothing is allowed.
const MODES: [(Mode, u8, &str); 9] = [
    (Mode::Instantiated, b'I', "instantiated"),
    (Mode::Initialization, b'N', "initialization mode"),
    (Mode::StepComplete, b'C', "step complete"),
    (Mode::StepFailed, b'F', "step failed"),
    (Mode::Event, b'M', "event mode"),
    (Mode::ContinuousTime, b'K', "continuous-time mode"),
    (Mode::Terminated, b'T', "terminated"),
    (Mode::Error, b'E', "error"),
    (Mode::Fatal, b' ', "fatal"),
];

impl Mode {
    pub(crate) fn from_number(number: i64) -> Option<Self> {
        MODES.into_iter().map(|(mode, ..)| mode).find(|mode| i64::from(*mode as u32) == number)
    }
}

impl fmt::Display for Mode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = MODES.into_iter().find(|(mode, ..)| mode == self).map(|(.., name)| name);
        f.write_str(name.unwrap_or_default())
    }
}

/// A set of modes for each interface type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Situations(u32);

/// Where the modes of Model Exchange begin.
const MODEL_EXCHANGE: u32 = 16;

/// The one bit of an interface type and a mode.
#[inline]
const fn bit(interface: Interface, mode: Mode) -> u32 {
    match interface {
        Interface::CoSimulation => mode as u32,
        Interface::ModelExchange => (mode as u32) << MODEL_EXCHANGE,
    }
}

/// The bits of the letters.
const fn bits(letters: &str) -> u32 {
    let mut set = 0;
    let mut rest = letters.as_bytes();
    while let [letter, tail @ ..] = rest {
        let mut known = 0;
        while MODES[known].1 != *letter {
            known += 1; // Past the end for a letter that is none: an error when the table is compiled.
        }
        set |= MODES[known].0 as u32;
        rest = tail;
    }
    set
}

impl Situations {
    /// None.
    pub const NONE: Self = Self(0);

    /// The modes with these letters: I instantiated, N initialization, C step complete, F step failed, M event,
    /// K continuous time, T terminated, E error.
    pub const fn new(co_simulation: &str, model_exchange: &str) -> Self {
        Self(bits(co_simulation) | bits(model_exchange) << MODEL_EXCHANGE)
    }

    /// Whether an instance of this type in this mode is among them.
    #[inline]
    pub const fn contain(self, interface: Interface, mode: Mode) -> bool {
        self.0 & bit(interface, mode) != 0
    }

    /// Both sets together.
    #[must_use]
    pub const fn and(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// These for the interface types that the other set has any mode of.
    #[must_use]
    pub const fn where_any(self, other: Self) -> Self {
        let half = (1 << MODEL_EXCHANGE) - 1;
        let co_simulation = if other.0 & half == 0 { 0 } else { half };
        let model_exchange = if other.0 & !half == 0 { 0 } else { !half };
        Self(self.0 & (co_simulation | model_exchange))
    }

    /// The names of the modes of an interface type.
    pub fn names(self, interface: Interface) -> String {
        let known = MODES.into_iter().filter(|(mode, ..)| self.contain(interface, *mode));
        let names: Vec<_> = known.map(|(.., name)| name).collect();
        if names.is_empty() { "no state".to_owned() } else { names.join(", ") }
    }
}

/// Where an instance is: its interface type and its mode, as one bit that a set is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Situation(u32);

impl Situation {
    pub const fn new(interface: Interface, mode: Mode) -> Self {
        Self(bit(interface, mode))
    }

    #[inline]
    pub const fn is_in(self, set: Situations) -> bool {
        self.0 & set.0 != 0
    }
}

/// The modes that instances can be in, short of fatal.
pub(crate) const POSSIBLE: Situations = Situations::new("INCFTE", "INMKTE");
