//! The variables of a model: what each is, and the table of them.

use crate::call_table::{Modes, settable};
use crate::units::Unit;

/// Who sets a variable and who reads it (section 2.2.7).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Causality {
    /// Set by the user before the simulation.
    Parameter,
    /// Set by the importer at every communication point.
    Input,
    /// Read by the importer.
    Output,
    /// Of interest inside the model only.
    Local,
}

/// When a variable changes (section 2.2.7).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Variability {
    /// Not after initialization.
    Fixed,
    /// When the user changes it.
    Tunable,
    /// At events or communication points.
    Discrete,
    /// At any time.
    Continuous,
}

/// How a variable gets its first value (section 2.2.7).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Initial {
    /// From its start value.
    Exact,
    /// By calculation.
    Calculated,
}

/// A variable of the model: made by [`input`](Self::input), [`output`](Self::output), [`local`](Self::local) or
/// [`parameter`](Self::parameter), and refined by the methods that follow them.
#[derive(Clone, Debug)]
pub struct Variable {
    pub(crate) name: &'static str,
    pub(crate) description: &'static str,
    pub(crate) causality: Causality,
    pub(crate) variability: Variability,
    pub(crate) initial: Option<Initial>,
    pub(crate) kind: Kind,
    pub(crate) derivative_of: Option<u32>,
    pub(crate) depends_on: Option<&'static [u32]>,
    pub(crate) state: bool,
    /// The states of the instance in which the importer may set this variable; follows from the rest.
    pub(crate) settable: Settable,
}

/// The modes in which a variable can be set, per interface type.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Settable {
    pub co_simulation: Modes,
    pub model_exchange: Modes,
}

/// Type, unit, range and start value of a variable.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub enum Kind {
    /// A `Real`.
    Real {
        /// Unit, display unit, range and nominal value.
        of: &'static RealType,
        /// Start value; not used for calculated variables.
        start: f64,
    },
    /// An `Integer`.
    Integer {
        /// Smallest value.
        min: i32,
        /// Largest value.
        max: i32,
        /// Start value.
        start: i32,
    },
    /// A `Boolean`.
    Boolean {
        /// Start value.
        start: bool,
    },
}

/// The types of FMI 2.0. Models here have no String variables.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum BaseType {
    /// `fmi2Real`
    Real,
    /// `fmi2Integer`
    Integer,
    /// `fmi2Boolean`
    Boolean,
    /// `fmi2String`
    String,
}

impl Kind {
    /// The type without its attributes.
    pub const fn base_type(&self) -> BaseType {
        match self {
            Self::Real { .. } => BaseType::Real,
            Self::Integer { .. } => BaseType::Integer,
            Self::Boolean { .. } => BaseType::Boolean,
        }
    }
}

/// The type of a physical quantity; becomes a `SimpleType` (section 2.2.3).
#[derive(Debug)]
pub struct RealType {
    /// Name of the type, unlike any variable's.
    pub name: &'static str,
    /// `quantity`, as in ISO 80000, for example `Angle`.
    pub quantity: &'static str,
    /// Unit of the values at the interface; importers show them in its display unit if it has one.
    pub unit: &'static Unit,
    /// Smallest value; enforced for parameters.
    pub min: Option<f64>,
    /// Largest value; enforced for parameters.
    pub max: Option<f64>,
    /// The order of magnitude of the values, for the scaling of solvers.
    pub nominal: Option<f64>,
}

impl RealType {
    /// A quantity of this name in this unit, without range and nominal value.
    pub const fn new(name: &'static str, unit: &'static Unit) -> Self {
        Self { name, quantity: name, unit, min: None, max: None, nominal: None }
    }
}

impl Variable {
    const fn new(
        causality: Causality,
        variability: Variability,
        initial: Option<Initial>,
        kind: Kind,
    ) -> Self {
        Self {
            name: "",
            description: "",
            causality,
            variability,
            initial,
            kind,
            derivative_of: None,
            depends_on: None,
            state: false,
            settable: settable(causality, variability, initial, false),
        }
    }

    /// A continuous Real input.
    pub const fn input(of: &'static RealType, start: f64) -> Self {
        Self::new(Causality::Input, Variability::Continuous, None, Kind::Real { of, start })
    }

    /// A continuous Real output that the model calculates.
    pub const fn output(of: &'static RealType) -> Self {
        Self::new(
            Causality::Output,
            Variability::Continuous,
            Some(Initial::Calculated),
            Kind::Real { of, start: 0.0 },
        )
    }

    /// A continuous Real of the model's inside, calculated.
    pub const fn local(of: &'static RealType) -> Self {
        let mut variable = Self::output(of);
        variable.causality = Causality::Local;
        variable
    }

    /// A fixed parameter of any type.
    pub const fn parameter(kind: Kind) -> Self {
        Self::new(Causality::Parameter, Variability::Fixed, Some(Initial::Exact), kind)
    }

    /// The variable, an output or local, as continuous-time state with an exact start value.
    ///
    /// What [`Model::real`](crate::Model::real) says of a state is what was set, or what the last step made of it.
    pub const fn state(mut self, start: f64) -> Self {
        self.state = true;
        self.starting_at(start)
    }

    /// The variable, an output or local, with an exact start value that the importer may set.
    pub const fn starting_at(mut self, start: f64) -> Self {
        assert!(
            self.is_calculated(),
            "only outputs and locals can be states or get a start value afterwards"
        );
        self.initial = Some(Initial::Exact);
        if let Kind::Real { of, .. } = self.kind {
            self.kind = Kind::Real { of, start };
        }
        self.settable = settable(self.causality, self.variability, self.initial, self.state);
        self
    }

    /// The variable as time derivative of another, given by its value reference.
    pub const fn derivative_of(mut self, vr: u32) -> Self {
        assert!(!matches!(self.causality, Causality::Parameter), "a parameter is no derivative");
        self.derivative_of = Some(vr);
        self
    }

    /// The variable, an output or local, as one that depends on no inputs, states, parameters and other start
    /// values but these, given by their value references.
    ///
    /// It is about direct dependence (section 2.2.8): at a communication point or instant, and while
    /// initializing. An output that an input reaches through a step or a state only does not depend on that
    /// input. Where nothing is said, it depends on all of them, see [`ModelInfo::smooth`](crate::ModelInfo::smooth).
    ///
    /// ```
    /// # use fmi2_export::{RealType, Variable, units, variables};
    /// # const NUMBER: RealType = RealType::new("Number", &units::ONE);
    /// variables! {
    ///     /// Input
    ///     u = Variable::input(&NUMBER, 0.0);
    ///     /// Another input
    ///     v = Variable::input(&NUMBER, 0.0);
    ///     /// u where it is above 10, else 0
    ///     y = Variable::output(&NUMBER).depends_on(&[vr::u]);
    ///     /// The sum of what v was at the steps before
    ///     sum = Variable::output(&NUMBER).depends_on(&[]);
    /// }
    /// ```
    pub const fn depends_on(mut self, knowns: &'static [u32]) -> Self {
        assert!(self.is_calculated(), "only outputs and locals depend on others");
        self.depends_on = Some(knowns);
        self
    }

    /// The variable under a name that is no Rust identifier.
    pub const fn named(mut self, name: &'static str) -> Self {
        self.name = name;
        self
    }

    /// Called by [`variables!`](crate::variables): fills in name and description where they are missing.
    #[doc(hidden)]
    pub const fn documented(mut self, name: &'static str, description: &'static str) -> Self {
        if self.name.is_empty() {
            self.name = name;
        }
        self.description = description.trim_ascii();
        self
    }

    const fn is_calculated(&self) -> bool {
        matches!(self.causality, Causality::Output | Causality::Local)
    }

    /// The name.
    pub const fn name(&self) -> &'static str {
        self.name
    }

    /// One sentence for the user.
    pub const fn description(&self) -> &'static str {
        self.description
    }

    /// Who sets it and who reads it.
    pub const fn causality(&self) -> Causality {
        self.causality
    }

    /// When it changes.
    pub const fn variability(&self) -> Variability {
        self.variability
    }

    /// How it gets its first value; `None` for inputs.
    pub const fn initial(&self) -> Option<Initial> {
        self.initial
    }

    /// Type, unit, range and start value.
    pub const fn kind(&self) -> Kind {
        self.kind
    }

    /// Value reference of the variable that this one is the time derivative of.
    pub const fn differentiates(&self) -> Option<u32> {
        self.derivative_of
    }

    /// What [`depends_on`](Self::depends_on) has said.
    pub const fn dependencies(&self) -> Option<&'static [u32]> {
        self.depends_on
    }

    /// Whether this is a continuous-time state.
    pub const fn is_state(&self) -> bool {
        self.state
    }

    /// Whether this is the derivative of a state (and not, say, an input that is another's rate).
    pub const fn is_state_derivative(&self) -> bool {
        self.derivative_of.is_some() && !matches!(self.causality, Causality::Input)
    }
}

/// Writes a model's table of variables once: the list itself and a constant per value reference.
///
/// The documentation comment of an entry is the description that importers show. The macro defines
/// `VARIABLES: &[Variable]` and a module `vr` with a constant of the entry's name for each entry.
///
/// ```
/// use fmi2_export::{BaseUnit, RealType, Unit, Variable, variables};
///
/// const METRE: Unit = Unit { name: "m", base: BaseUnit { kg: 0, m: 1, s: 0, rad: 0 }, display: None };
/// const LENGTH: RealType = RealType::new("Length", &METRE);
///
/// variables! {
///     /// Height of the ball
///     h = Variable::output(&LENGTH).state(1.0);
///     /// Its velocity
///     der_h = Variable::local(&LENGTH).derivative_of(vr::h).named("der(h)");
/// }
/// assert_eq!(VARIABLES[vr::der_h as usize].name(), "der(h)");
/// assert_eq!(VARIABLES[vr::h as usize].description(), "Height of the ball");
/// ```
#[macro_export]
macro_rules! variables {
    ($( $(#[doc = $text:literal])+ $name:ident = $variable:expr ; )+) => {
        /// Value references: a variable's place in the table.
        #[allow(non_upper_case_globals, non_camel_case_types)]
        pub mod vr {
            enum Place { $($name),+ }
            $( $(#[doc = $text])+ pub const $name: u32 = Place::$name as u32; )+
        }

        /// The variables, in the order of their value references.
        pub const VARIABLES: &[$crate::Variable] = &[
            $( ($variable).documented(::core::stringify!($name), ::core::concat!($($text),+)) ),+
        ];
    };
}
