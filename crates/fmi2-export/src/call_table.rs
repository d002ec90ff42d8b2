//! Which function may be called when: the tables of sections 3.2.3 and 4.2.4 as one table, and apart
//! from it what is tolerated beyond the standard because importers do it.

use crate::variable::{Causality, Initial, Settable, Variability};
use std::fmt;
use std::ops::BitOr;

/// The state of an instance in the sense of the standard's state machines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u16)]
#[non_exhaustive]
pub enum Mode {
    /// After `fmi2Instantiate` or `fmi2Reset`.
    Instantiated = 1,
    /// Initialization Mode.
    Initialization = 2,
    /// Co-Simulation: at a communication point.
    StepComplete = 4,
    /// Co-Simulation: a step ended early. No model here does that; the column is the standard's.
    StepFailed = 8,
    /// Model Exchange: Event Mode.
    Event = 16,
    /// Model Exchange: Continuous-Time Mode.
    ContinuousTime = 32,
    /// After `fmi2Terminate`.
    Terminated = 64,
    /// The standard's state after fmi2Error. No call leads here, because a refused call changes nothing; a
    /// serialized state may.
    Error = 128,
    /// After a panic.
    Fatal = 256,
}

impl Mode {
    const ALL: [Self; 9] = [
        Self::Instantiated,
        Self::Initialization,
        Self::StepComplete,
        Self::StepFailed,
        Self::Event,
        Self::ContinuousTime,
        Self::Terminated,
        Self::Error,
        Self::Fatal,
    ];

    pub(crate) fn from_bits(bits: u16) -> Option<Self> {
        Self::ALL.into_iter().find(|mode| *mode as u16 == bits)
    }

    const fn name(self) -> &'static str {
        match self {
            Self::Instantiated => "instantiated",
            Self::Initialization => "initialization mode",
            Self::StepComplete => "step complete",
            Self::StepFailed => "step failed",
            Self::Event => "event mode",
            Self::ContinuousTime => "continuous-time mode",
            Self::Terminated => "terminated",
            Self::Error => "error",
            Self::Fatal => "fatal",
        }
    }
}

impl fmt::Display for Mode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A set of [`Mode`]s.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Modes(u16);

impl Modes {
    /// Whether the mode is in the set.
    #[inline]
    pub const fn contains(self, mode: Mode) -> bool {
        self.0 & mode as u16 != 0
    }

    /// Both sets together.
    pub const fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

impl BitOr for Modes {
    type Output = Self;

    fn bitor(self, other: Self) -> Self {
        self.union(other)
    }
}

impl fmt::Display for Modes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names: Vec<_> =
            Mode::ALL.into_iter().filter(|mode| self.contains(*mode)).map(Mode::name).collect();
        f.write_str(if names.is_empty() { "never" } else { "" })?;
        f.write_str(&names.join(", "))
    }
}

/// The type of interface that an instance was made for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interface {
    /// The importer integrates.
    ModelExchange = 0,
    /// The FMU steps itself.
    CoSimulation = 1,
}

impl Interface {
    /// Whether instances of this type can be in the mode, short of fatal.
    pub(crate) const fn has(self, mode: Mode) -> bool {
        match self {
            Self::CoSimulation => modes("INCFTE").contains(mode),
            Self::ModelExchange => modes("INMKTE").contains(mode),
        }
    }
}

impl fmt::Display for Interface {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::ModelExchange => "Model Exchange",
            Self::CoSimulation => "Co-Simulation",
        })
    }
}

/// One row of the table of allowed calls.
#[derive(Clone, Copy, Debug)]
pub struct Rule {
    /// The function's name in C.
    pub name: &'static str,
    /// Where the standard allows the call in Co-Simulation (section 4.2.4).
    pub co_simulation: Modes,
    /// Where the standard allows the call in Model Exchange (section 3.2.3).
    pub model_exchange: Modes,
    /// Where the call is tolerated beyond the standard, for both interface types.
    pub tolerated: Modes,
}

impl Rule {
    /// Where the call is accepted.
    #[inline]
    pub const fn accepted(&self, interface: Interface) -> Modes {
        match interface {
            Interface::CoSimulation => self.co_simulation.union(self.tolerated_in(interface)),
            Interface::ModelExchange => self.model_exchange.union(self.tolerated_in(interface)),
        }
    }

    /// What is tolerated counts only for functions that the interface type has.
    const fn tolerated_in(&self, interface: Interface) -> Modes {
        let own = match interface {
            Interface::CoSimulation => self.co_simulation,
            Interface::ModelExchange => self.model_exchange,
        };
        if own.0 == 0 { NEVER } else { self.tolerated }
    }
}

/// The columns of the standard's tables, with the letters used below.
const fn modes(letters: &str) -> Modes {
    let mut set = 0;
    let mut rest = letters.as_bytes();
    while let [letter, tail @ ..] = rest {
        set |= match letter {
            b'I' => Mode::Instantiated,
            b'N' => Mode::Initialization,
            b'C' => Mode::StepComplete,
            b'F' => Mode::StepFailed,
            b'M' => Mode::Event,
            b'K' => Mode::ContinuousTime,
            b'T' => Mode::Terminated,
            b'E' => Mode::Error,
            _ => panic!("unknown mode"),
        } as u16;
        rest = tail;
    }
    Modes(set)
}

const NEVER: Modes = modes("");

/// Defines [`Function`] and its [`Rule`]s: name, Co-Simulation, Model Exchange, tolerated.
macro_rules! call_table {
    ($($function:ident $name:literal $cs:literal $me:literal $tolerated:literal;)+) => {
        /// The functions that work on an instance and have an order of calls.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[allow(missing_docs)]
        #[non_exhaustive]
        pub enum Function { $($function),+ }

        /// The table of allowed calls, in the order of [`Function`].
        pub const CALL_TABLE: &[Rule] = &[
            $(Rule {
                name: $name,
                co_simulation: modes($cs),
                model_exchange: modes($me),
                tolerated: modes($tolerated),
            }),+
        ];
    };
}

// I instantiated, N initialization, C step complete, F step failed, M event, K continuous time,
// T terminated, E error. In fatal nothing is allowed (fmi2GetVersion and fmi2GetTypesPlatform, which
// have no instance, always are). fmi2CancelStep belongs to asynchronous steps, which do not exist here.
//
// For fmi2Set... the table holds the columns; which variable can be set in which of them is `settable`.
//
// Tolerated:
//   fmi2Terminate after an error (FMI Library calls it in a destructor),
//   fmi2EnterInitializationMode without fmi2SetupExperiment before it: the start time is 0,
//   fmi2SetTime while initializing and in event mode, fmi2SetContinuousStates in event mode
//   (OpenModelica, on every run).
call_table! {
    // function                   name in C                          CS        ME        tolerated
    SetDebugLogging               "fmi2SetDebugLogging"              "INCFTE"  "INMKTE"  "";
    SetupExperiment               "fmi2SetupExperiment"              "I"       "I"       "";
    EnterInitializationMode       "fmi2EnterInitializationMode"      "I"       "I"       "";
    ExitInitializationMode        "fmi2ExitInitializationMode"       "N"       "N"       "";
    Terminate                     "fmi2Terminate"                    "CF"      "MK"      "E";
    Reset                         "fmi2Reset"                        "INCFTE"  "INMKTE"  "";
    GetReal                       "fmi2GetReal"                      "NCFTE"   "NMKTE"   "";
    GetInteger                    "fmi2GetInteger"                   "NCFTE"   "NMKTE"   "";
    GetBoolean                    "fmi2GetBoolean"                   "NCFTE"   "NMKTE"   "";
    GetString                     "fmi2GetString"                    "NCFTE"   "NMKTE"   "";
    SetReal                       "fmi2SetReal"                      "INC"     "INMK"    "";
    SetInteger                    "fmi2SetInteger"                   "INC"     "INM"     "";
    SetBoolean                    "fmi2SetBoolean"                   "INC"     "INM"     "";
    SetString                     "fmi2SetString"                    "INC"     "INM"     "";
    GetFMUstate                   "fmi2GetFMUstate"                  "INCFTE"  "INMKTE"  "";
    SetFMUstate                   "fmi2SetFMUstate"                  "INCFTE"  "INMKTE"  "";
    FreeFMUstate                  "fmi2FreeFMUstate"                 "INCFTE"  "INMKTE"  "";
    SerializedFMUstateSize        "fmi2SerializedFMUstateSize"       "INCFTE"  "INMKTE"  "";
    SerializeFMUstate             "fmi2SerializeFMUstate"            "INCFTE"  "INMKTE"  "";
    DeSerializeFMUstate           "fmi2DeSerializeFMUstate"          "INCFTE"  "INMKTE"  "";
    GetDirectionalDerivative      "fmi2GetDirectionalDerivative"     "NCFTE"   "NMKTE"   "";
    SetRealInputDerivatives       "fmi2SetRealInputDerivatives"      "INC"     ""        "";
    GetRealOutputDerivatives      "fmi2GetRealOutputDerivatives"     "CFTE"    ""        "";
    DoStep                        "fmi2DoStep"                       "C"       ""        "";
    CancelStep                    "fmi2CancelStep"                   ""        ""        "";
    GetStatus                     "fmi2GetStatus"                    "CFT"     ""        "";
    GetRealStatus                 "fmi2GetRealStatus"                "CFT"     ""        "";
    GetIntegerStatus              "fmi2GetIntegerStatus"             "CFT"     ""        "";
    GetBooleanStatus              "fmi2GetBooleanStatus"             "CFT"     ""        "";
    GetStringStatus               "fmi2GetStringStatus"              "CFT"     ""        "";
    EnterEventMode                "fmi2EnterEventMode"               ""        "MK"      "";
    NewDiscreteStates             "fmi2NewDiscreteStates"            ""        "M"       "";
    EnterContinuousTimeMode       "fmi2EnterContinuousTimeMode"      ""        "M"       "";
    CompletedIntegratorStep       "fmi2CompletedIntegratorStep"      ""        "K"       "";
    SetTime                       "fmi2SetTime"                      ""        "K"       "NM";
    SetContinuousStates           "fmi2SetContinuousStates"          ""        "K"       "M";
    GetDerivatives                "fmi2GetDerivatives"               ""        "NMKTE"   "";
    GetContinuousStates           "fmi2GetContinuousStates"          ""        "NMKTE"   "";
    GetEventIndicators            "fmi2GetEventIndicators"           ""        "NMKTE"   "";
    GetNominalsOfContinuousStates "fmi2GetNominalsOfContinuousStates" ""       "INMKTE"  "";
}

impl Function {
    /// The function's row of the table.
    #[inline]
    pub const fn rule(self) -> &'static Rule {
        &CALL_TABLE[self as usize]
    }
}

/// Where a variable may be set by `fmi2Set...` (footnotes 1, 3, 4, 5 and 6 of the tables), standard
/// and tolerated together.
pub(crate) const fn settable(
    causality: Causality,
    variability: Variability,
    initial: Option<Initial>,
    state: bool,
) -> Settable {
    let standard = standard_settable(causality, variability, initial, state);
    let tolerated = tolerated_settable(causality);
    Settable {
        co_simulation: standard.co_simulation.union(tolerated.co_simulation),
        model_exchange: standard.model_exchange.union(tolerated.model_exchange),
    }
}

/// Where the standard lets a variable be set.
pub(crate) const fn standard_settable(
    causality: Causality,
    variability: Variability,
    initial: Option<Initial>,
    state: bool,
) -> Settable {
    let start = matches!(initial, Some(Initial::Exact));
    let input = matches!(causality, Causality::Input);
    let tunable = matches!((causality, variability), (Causality::Parameter, Variability::Tunable));
    let continuous_input = input && matches!(variability, Variability::Continuous);

    let mut both = NEVER;
    if start {
        both = both.union(modes("I")); // footnote 1
    }
    if start || input {
        both = both.union(modes("N")); // footnote 3
    }
    let mut settable = Settable { co_simulation: both, model_exchange: both };
    if input || tunable {
        settable.co_simulation = settable.co_simulation.union(modes("C")); // footnote 6
        settable.model_exchange = settable.model_exchange.union(modes("M")); // footnote 4
    }
    if continuous_input || state {
        settable.model_exchange = settable.model_exchange.union(modes("K")); // footnote 5
    }
    settable
}

/// Where a variable may be set beyond the standard: inputs before the initialization (OpenModelica,
/// libcosim), parameters after it (OpenModelica, and users who tune).
const fn tolerated_settable(causality: Causality) -> Settable {
    match causality {
        Causality::Input => Settable { co_simulation: modes("I"), model_exchange: modes("I") },
        Causality::Parameter => Settable { co_simulation: modes("C"), model_exchange: modes("M") },
        Causality::Output | Causality::Local => Settable { co_simulation: NEVER, model_exchange: NEVER },
    }
}
