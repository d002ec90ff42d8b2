//! What a model says about itself: the facts behind `modelDescription.xml`.
//!
//! Everything here can be built in a `const`, so a model's table of variables costs nothing at run
//! time and every fact (a name, a unit, a start value) is written once.

use crate::call_table::{Modes, settable};

/// The facts about an FMU (section 2.2.1).
#[derive(Clone, Debug)]
pub struct ModelInfo {
    /// `modelName`, the name a user reads.
    pub name: &'static str,
    /// `modelIdentifier`, the name of the library file.
    pub identifier: &'static str,
    /// Fingerprint that ties the description to the library; importers must pass it to
    /// `fmi2Instantiate`.
    pub guid: &'static str,
    /// One sentence.
    pub description: &'static str,
    /// Who made the model.
    pub author: &'static str,
    /// The model's version.
    pub version: &'static str,
    /// The licence of the FMU.
    pub license: &'static str,
    /// Who holds the copyright.
    pub copyright: &'static str,
    /// The experiment an importer proposes to its user.
    pub default_experiment: DefaultExperiment,
    /// The variables; a variable's place in this list is its value reference.
    pub variables: &'static [Variable],
    /// What the FMU offers as Co-Simulation slave; `None` if it is no slave.
    pub co_simulation: Option<CoSimulation>,
    /// What the FMU offers as Model Exchange model; `None` if it is none.
    pub model_exchange: Option<ModelExchange>,
}

/// The experiment an importer proposes to its user (section 2.2.5).
#[derive(Clone, Copy, Debug)]
pub struct DefaultExperiment {
    /// Start time, s.
    pub start_time: f64,
    /// Stop time, s.
    pub stop_time: f64,
    /// Communication step size, s.
    pub step_size: f64,
    /// Relative tolerance for the importer's solver in Model Exchange.
    pub tolerance: f64,
}

/// Capabilities of a Co-Simulation slave (section 4.3.1).
#[derive(Clone, Copy, Debug)]
pub struct CoSimulation {
    /// [`Model::do_step`](crate::Model::do_step) takes any step size.
    pub variable_step_size: bool,
    /// [`Model::set_input_derivative`](crate::Model::set_input_derivative) is used.
    pub interpolates_inputs: bool,
    /// The highest order [`Model::output_derivative`](crate::Model::output_derivative) answers.
    pub max_output_derivative_order: u32,
    /// [`Model::partial_derivative`](crate::Model::partial_derivative) is exact at communication points.
    pub directional_derivative: bool,
    /// [`Model::visit_state`](crate::Model::visit_state) lists the whole state.
    pub serializes_state: bool,
}

/// Capabilities of a Model Exchange model (section 3.3.1).
#[derive(Clone, Copy, Debug)]
pub struct ModelExchange {
    /// [`Model::partial_derivative`](crate::Model::partial_derivative) is exact.
    pub directional_derivative: bool,
    /// [`Model::visit_state`](crate::Model::visit_state) lists the whole state.
    pub serializes_state: bool,
}

/// Who sets a variable and who reads it (section 2.2.7).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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

/// A variable of the model.
#[derive(Clone, Debug)]
pub struct Variable {
    /// The name; keep to letters, digits and underscores, which every importer takes.
    pub name: &'static str,
    /// One sentence for the user.
    pub description: &'static str,
    /// Who sets it and who reads it.
    pub causality: Causality,
    /// When it changes.
    pub variability: Variability,
    /// How it gets its first value; `None` for inputs.
    pub initial: Option<Initial>,
    /// Type, unit, range and start value.
    pub kind: Kind,
    /// Value reference of the variable this one is the time derivative of.
    pub derivative_of: Option<u32>,
    /// Whether this is a continuous-time state.
    pub state: bool,
    /// The states of the instance in which the importer may set this variable.
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

/// A unit (section 2.2.2).
#[derive(Debug, PartialEq)]
pub struct Unit {
    /// Name, for example `N.m/rad`.
    pub name: &'static str,
    /// Exponents of kg, m, s and rad.
    pub base: BaseUnit,
    /// The unit a person prefers, with display value = factor * value.
    pub display: Option<DisplayUnit>,
}

/// Exponents of the base units that mechanics needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BaseUnit {
    /// Exponent of kg.
    pub kg: i32,
    /// Exponent of m.
    pub m: i32,
    /// Exponent of s.
    pub s: i32,
    /// Exponent of rad.
    pub rad: i32,
}

/// A unit to show values in: display value = factor * value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DisplayUnit {
    /// Name, for example `deg`.
    pub name: &'static str,
    /// Multiplies the value.
    pub factor: f64,
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
    pub const fn state(mut self, start: f64) -> Self {
        self.state = true;
        self.starting_at(start)
    }

    /// The variable, an output or local, with an exact start value that the importer may set.
    pub const fn starting_at(mut self, start: f64) -> Self {
        self.initial = Some(Initial::Exact);
        if let Kind::Real { of, .. } = self.kind {
            self.kind = Kind::Real { of, start };
        }
        self.settable = settable(self.causality, self.variability, self.initial, self.state);
        self
    }

    /// The variable as time derivative of another, given by its value reference.
    pub const fn derivative_of(mut self, vr: u32) -> Self {
        self.derivative_of = Some(vr);
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

    /// Whether this is the derivative of a state (and not, say, an input that is another's rate).
    pub const fn is_state_derivative(&self) -> bool {
        self.derivative_of.is_some() && !matches!(self.causality, Causality::Input)
    }
}

impl CoSimulation {
    /// A slave without optional capabilities.
    pub const PLAIN: Self = Self {
        variable_step_size: false,
        interpolates_inputs: false,
        max_output_derivative_order: 0,
        directional_derivative: false,
        serializes_state: false,
    };
}

impl ModelExchange {
    /// A model without optional capabilities.
    pub const PLAIN: Self = Self { directional_derivative: false, serializes_state: false };
}

impl ModelInfo {
    /// A model without interface types, to be filled in.
    pub const fn new(
        name: &'static str,
        identifier: &'static str,
        guid: &'static str,
        variables: &'static [Variable],
    ) -> Self {
        Self {
            name,
            identifier,
            guid,
            description: "",
            author: "",
            version: "",
            license: "",
            copyright: "",
            default_experiment: DefaultExperiment {
                start_time: 0.0,
                stop_time: 1.0,
                step_size: 1e-3,
                tolerance: 1e-6,
            },
            variables,
            co_simulation: None,
            model_exchange: None,
        }
    }

    /// Value references of the continuous-time states, ascending.
    pub fn states(&self) -> impl Iterator<Item = u32> {
        (0..).zip(self.variables).filter(|(_, variable)| variable.state).map(|(vr, _)| vr)
    }

    /// Value references of the states' derivatives, in the order of the states.
    pub fn derivatives(&self) -> impl Iterator<Item = u32> {
        self.states().filter_map(|state| {
            (0..)
                .zip(self.variables)
                .find(|(_, variable)| variable.is_state_derivative() && variable.derivative_of == Some(state))
                .map(|(vr, _)| vr)
        })
    }
}

/// Writes a model's table of variables once: the list itself and a constant per value reference.
///
/// The documentation comment of an entry is the description that importers show. The macro defines
/// `VARIABLES: &[Variable]` and a module `vr` with a constant of the entry's name for each entry.
///
/// ```
/// use fmi2_export::{Kind, RealType, Unit, BaseUnit, Variable, variables};
///
/// const METRE: Unit = Unit { name: "m", base: BaseUnit { kg: 0, m: 1, s: 0, rad: 0 }, display: None };
/// const LENGTH: RealType = RealType {
///     name: "Length", quantity: "Length", unit: &METRE, min: None, max: None, nominal: None,
/// };
///
/// variables! {
///     /// Height of the ball
///     h = Variable::output(&LENGTH).state(1.0);
///     /// Its velocity
///     der_h = Variable::local(&LENGTH).derivative_of(vr::h).named("der(h)");
/// }
/// assert_eq!(VARIABLES[vr::der_h as usize].name, "der(h)");
/// assert_eq!(VARIABLES[vr::h as usize].description, "Height of the ball");
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
            $( ($variable).documented(stringify!($name), concat!($($text),+)) ),+
        ];
    };
}
