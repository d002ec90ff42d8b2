//! What a model says about itself: the facts behind `modelDescription.xml`.
//!
//! Everything here can be built in a `const`, so a model's table of variables costs nothing at run
//! time and every fact (a name, a unit, a start value) is written once.

use crate::variable::Variable;

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
    /// Whether outputs and derivatives follow from inputs, states and parameters by the same smooth equations
    /// everywhere and at all times: no branches, limits, dead zones or switches but Integer and Boolean
    /// parameters, and nothing that acts from a certain step on.
    ///
    /// What does not react near the start values then does not react anywhere, and fmi2-package finds the
    /// dependencies, and their kinds, by trying. Otherwise it lists for every unknown all that its
    /// [`depends_on`](Variable::depends_on) names, and without that all there is.
    pub smooth: bool,
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
            smooth: false,
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
