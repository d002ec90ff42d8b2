//! Modes: the states of the FMI state machines, and sets of them.

use crate::standard::{Interface, Standard};
use std::fmt;

/// State of an instance in the FMI state machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Mode {
    /// After instantiation or a reset.
    Instantiated = 1,
    /// Initialization Mode.
    Initialization = 2,
    /// Co-Simulation: at a communication point. FMI 3.0 calls it Step Mode.
    StepComplete = 4,
    /// Co-Simulation: a step ended early, or the model requested the end of the simulation. Only in FMI 2.0.
    StepFailed = 8,
    /// Event Mode.
    Event = 16,
    /// Model Exchange: Continuous-Time Mode.
    ContinuousTime = 32,
    /// After the importer has ended the simulation (`fmi2Terminate`, `fmi3Terminate`).
    Terminated = 64,
    /// State of FMI 2.0 after an error. fmu-export never enters it, because a rejected call leaves the instance
    /// unchanged, but reads states that were serialized in this mode.
    Error = 128,
    /// After a failure that makes the instance unusable; in fmu-export, after a panic.
    Fatal = 256,
}

/// A mode with its letter in the tables of allowed calls and its name in messages.
struct Row {
    mode: Mode,
    letter: u8,
    name: &'static str,
}

const fn row(mode: Mode, letter: u8, name: &'static str) -> Row {
    Row { mode, letter, name }
}

/// All modes. The mode fatal has no letter, because no call is allowed in it.
const MODES: [Row; 9] = [
    row(Mode::Instantiated, b'I', "instantiated"),
    row(Mode::Initialization, b'N', "initialization mode"),
    row(Mode::StepComplete, b'C', "step complete"),
    row(Mode::StepFailed, b'F', "step failed"),
    row(Mode::Event, b'M', "event mode"),
    row(Mode::ContinuousTime, b'K', "continuous-time mode"),
    row(Mode::Terminated, b'T', "terminated"),
    row(Mode::Error, b'E', "error"),
    row(Mode::Fatal, b' ', "fatal"),
];

impl Mode {
    /// Returns the mode with this number, as stored in serialized states.
    pub fn from_number(number: i64) -> Option<Self> {
        MODES.iter().map(|row| row.mode).find(|mode| i64::from(*mode as u32) == number)
    }
}

impl fmt::Display for Mode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let row = MODES.iter().find(|row| row.mode == *self);
        f.write_str(row.map_or("", |row| row.name))
    }
}

/// A set of modes for each FMI version and interface type, for example the modes in which a function may be called.
/// Each of the four pairs of version and interface type has 16 bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AllowedStates(u64);

/// Offset of the 16 bits that belong to an FMI version and an interface type.
#[inline]
const fn bit_offset(standard: Standard, interface: Interface) -> u32 {
    16 * (2 * standard as u32 + interface as u32)
}

/// Returns the bit of an FMI version, an interface type and a mode.
#[inline]
const fn bit(standard: Standard, interface: Interface, mode: Mode) -> u64 {
    (mode as u64) << bit_offset(standard, interface)
}

/// Converts mode letters, as in the table MODES, into a bit set.
const fn bits(letters: &str) -> u64 {
    let mut set = 0;
    let mut rest = letters.as_bytes();
    while let [letter, tail @ ..] = rest {
        let mut known = 0;
        while MODES[known].letter != *letter {
            known += 1; // An unknown letter leads past the end of `MODES`; in a constant, this is a compile-time error.
        }
        set |= MODES[known].mode as u64;
        rest = tail;
    }
    set
}

impl AllowedStates {
    /// The empty set.
    pub const NONE: Self = Self(0);

    /// Creates a set of modes from their letters: I instantiated, N initialization, C step complete, F step failed, M
    /// event, K continuous time, T terminated, E error.
    pub const fn new(standard: Standard, co_simulation: &str, model_exchange: &str) -> Self {
        Self(
            bits(co_simulation) << bit_offset(standard, Interface::CoSimulation)
                | bits(model_exchange) << bit_offset(standard, Interface::ModelExchange),
        )
    }

    /// Returns whether the set contains this mode of this FMI version and interface type.
    #[inline]
    pub const fn contains(self, standard: Standard, interface: Interface, mode: Mode) -> bool {
        self.0 & bit(standard, interface, mode) != 0
    }

    /// Returns whether the set is empty.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Returns the union of both sets.
    #[must_use]
    pub const fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Returns this set without the elements of the other set.
    #[must_use]
    pub const fn without(self, others: Self) -> Self {
        Self(self.0 & !others.0)
    }

    /// Keeps the modes of each FMI version and interface type for which `other` contains at least one mode.
    #[must_use]
    pub const fn only_where(self, other: Self) -> Self {
        let (mut kept, mut mask) = (0, 0xffff);
        while mask != 0 {
            if other.0 & mask != 0 {
                kept |= mask;
            }
            mask <<= 16;
        }
        Self(self.0 & kept)
    }

    /// Lists the modes of this set for an FMI version and an interface type, for error messages; "no state" if there
    /// are none.
    pub fn names(self, standard: Standard, interface: Interface) -> String {
        let contained = MODES.iter().filter(|row| self.contains(standard, interface, row.mode));
        let names: Vec<_> = contained.map(|row| row.name).collect();
        if names.is_empty() { "no state".to_owned() } else { names.join(", ") }
    }
}

/// State of an instance in FMI: version, interface type and mode, as one bit for a fast test of membership.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FmiState(u64);

impl FmiState {
    /// A state that no set contains.
    pub const NONE: Self = Self(0);

    /// Creates the state of an instance.
    pub const fn new(standard: Standard, interface: Interface, mode: Mode) -> Self {
        Self(bit(standard, interface, mode))
    }

    /// Returns the state as a number, which [`from_bits`](Self::from_bits) turns back, so that it can be stored atomically.
    pub const fn bits(self) -> u64 {
        self.0
    }

    /// Returns the state with these [`bits`](Self::bits).
    pub const fn from_bits(bits: u64) -> Self {
        Self(bits)
    }

    /// Returns whether the set contains this state.
    #[inline]
    pub const fn is_in(self, set: AllowedStates) -> bool {
        self.0 & set.0 != 0
    }
}
