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
    /// After the end of the simulation.
    Terminated = 64,
    /// State of FMI 2.0 after an error. No call leads here, because a rejected call changes nothing. A
    /// serialized state may contain it.
    Error = 128,
    /// After a panic.
    Fatal = 256,
}

/// Modes with their letters in the tables of allowed calls. In fatal no call is allowed.
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
    /// Returns the mode with this number, as stored in serialized states.
    pub fn from_number(number: i64) -> Option<Self> {
        MODES.into_iter().map(|(mode, ..)| mode).find(|mode| i64::from(*mode as u32) == number)
    }
}

impl fmt::Display for Mode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = MODES.into_iter().find(|(mode, ..)| mode == self).map(|(.., name)| name);
        f.write_str(name.unwrap_or_default())
    }
}

/// A set of modes for each FMI version and interface type: 16 bits for each of the four pairs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Situations(u64);

/// Returns the position of the first bit of an FMI version and interface type.
#[inline]
const fn column(standard: Standard, interface: Interface) -> u32 {
    16 * (2 * standard as u32 + interface as u32)
}

/// Returns the bit of an FMI version, an interface type and a mode.
#[inline]
const fn bit(standard: Standard, interface: Interface, mode: Mode) -> u64 {
    (mode as u64) << column(standard, interface)
}

/// Returns the bits of the letters.
const fn bits(letters: &str) -> u64 {
    let mut set = 0;
    let mut rest = letters.as_bytes();
    while let [letter, tail @ ..] = rest {
        let mut known = 0;
        while MODES[known].1 != *letter {
            known += 1; // An unknown letter leads past the end: a compile-time error.
        }
        set |= MODES[known].0 as u64;
        rest = tail;
    }
    set
}

impl Situations {
    /// The empty set.
    pub const NONE: Self = Self(0);

    /// Creates a set of modes by their letters: I instantiated, N initialization, C step complete, F step
    /// failed, M event, K continuous time, T terminated, E error.
    pub const fn new(standard: Standard, co_simulation: &str, model_exchange: &str) -> Self {
        Self(
            bits(co_simulation) << column(standard, Interface::CoSimulation)
                | bits(model_exchange) << column(standard, Interface::ModelExchange),
        )
    }

    /// Returns whether the set contains this mode of this FMI version and interface type.
    #[inline]
    pub const fn contain(self, standard: Standard, interface: Interface, mode: Mode) -> bool {
        self.0 & bit(standard, interface, mode) != 0
    }

    /// Returns whether the set contains nothing.
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

    /// Returns the elements of this set for the interface types for which the other set is not empty.
    #[must_use]
    pub const fn where_any(self, other: Self) -> Self {
        let (mut mask, mut column) = (0, 0xffff);
        while column != 0 {
            if other.0 & column != 0 {
                mask |= column;
            }
            column <<= 16;
        }
        Self(self.0 & mask)
    }

    /// Returns the names of the modes of an interface type.
    pub fn names(self, standard: Standard, interface: Interface) -> String {
        let known = MODES.into_iter().filter(|(mode, ..)| self.contain(standard, interface, *mode));
        let names: Vec<_> = known.map(|(.., name)| name).collect();
        if names.is_empty() { "no state".to_owned() } else { names.join(", ") }
    }
}

/// Situation of an instance: FMI version, interface type and mode, as one bit for a fast test of membership.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Situation(u64);

impl Situation {
    /// A situation that no set contains.
    pub const NOWHERE: Self = Self(0);

    /// Creates the situation of an instance.
    pub const fn new(standard: Standard, interface: Interface, mode: Mode) -> Self {
        Self(bit(standard, interface, mode))
    }

    /// Returns whether the set contains the situation.
    #[inline]
    pub const fn is_in(self, set: Situations) -> bool {
        self.0 & set.0 != 0
    }
}
