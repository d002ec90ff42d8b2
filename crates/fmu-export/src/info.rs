//! What a model says about itself: the facts behind the model description.

/// The facts about an FMU (section 2.2.1). [`info!`](crate::info) fills in what Cargo knows.
#[derive(Clone, Debug)]
pub struct Info {
    /// `modelName`, the name a user reads.
    pub name: &'static str,
    /// `modelIdentifier`, the name of the library file.
    pub identifier: &'static str,
    /// Fingerprint that ties the description to the library; importers must pass it when they make an instance.
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
    /// Whether outputs and derivatives follow from inputs, states and parameters by the same smooth equations
    /// everywhere and at all times: no branches, limits, dead zones or switches but Integer, Boolean and
    /// Enumeration parameters, and nothing that acts from a certain step on.
    ///
    /// What does not react near the start values then does not react anywhere, and fmu-package finds the
    /// dependencies, and their kinds, by trying. Otherwise it lists for every unknown all that its
    /// [`depends_on`](crate::Variable::depends_on) names, and without that all there is.
    pub smooth: bool,
}

/// The experiment an importer proposes to its user (section 2.2.5).
///
/// ```
/// use fmu_export::DefaultExperiment;
///
/// const TEN_SECONDS: DefaultExperiment = DefaultExperiment { stop_time: 10.0, ..DefaultExperiment::DEFAULT };
/// ```
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

impl DefaultExperiment {
    /// A second in steps of a millisecond.
    pub const DEFAULT: Self = Self { start_time: 0.0, stop_time: 1.0, step_size: 1e-3, tolerance: 1e-6 };
}

impl Default for DefaultExperiment {
    fn default() -> Self {
        Self::DEFAULT
    }
}

impl Info {
    /// A model to be filled in.
    pub const fn new(name: &'static str, identifier: &'static str, guid: &'static str) -> Self {
        Self {
            name,
            identifier,
            guid,
            description: "",
            author: "",
            version: "",
            license: "",
            copyright: "",
            default_experiment: DefaultExperiment::DEFAULT,
            smooth: false,
        }
    }
}

/// The [`Info`] of a model of this name and identifier, with author, version and licence as in `Cargo.toml` and the
/// guid that fmu-package passes to the compiler in the environment variable `FMU_GUID`: a hash of the model's sources.
///
/// Without that variable the guid is all zeros; fmu-package does not pack such a library.
///
/// ```
/// const INFO: fmu_export::Info =
///     fmu_export::Info { description: "First-order lag", ..fmu_export::info!("Lag", "lag") };
/// ```
#[macro_export]
macro_rules! info {
    ($name:expr, $identifier:expr) => {
        $crate::Info {
            author: ::core::env!("CARGO_PKG_AUTHORS"),
            version: ::core::env!("CARGO_PKG_VERSION"),
            license: ::core::env!("CARGO_PKG_LICENSE"),
            ..$crate::Info::new(
                $name,
                $identifier,
                match ::core::option_env!("FMU_GUID") {
                    ::core::option::Option::Some(guid) => guid,
                    ::core::option::Option::None => "{00000000-0000-0000-0000-000000000000}",
                },
            )
        }
    };
}
