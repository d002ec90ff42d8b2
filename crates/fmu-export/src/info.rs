//! General data of a model: name, author, default experiment and so on.

/// General data of an FMU, for the model description (section 2.2.1 of FMI 2.0, 2.4.1 of FMI 3.0).
/// [`info!`](crate::info) takes author, version and licence from `Cargo.toml`.
#[derive(Clone, Debug)]
pub struct Info {
    /// `modelName`, the name that users see.
    pub name: &'static str,
    /// `modelIdentifier`, the name of the library file.
    pub identifier: &'static str,
    /// Description in one sentence.
    pub description: &'static str,
    /// Author of the model.
    pub author: &'static str,
    /// Version of the model.
    pub version: &'static str,
    /// Licence of the FMU.
    pub license: &'static str,
    /// Copyright notice.
    pub copyright: &'static str,
    /// Default experiment, which an importer proposes to its user.
    pub default_experiment: DefaultExperiment,
    /// Whether outputs and derivatives are smooth functions of inputs, states and parameters: no branches, saturation,
    /// dead zones or events. Integer, Boolean and Enumeration parameters may still select between equations. The
    /// build rejects `smooth` for a model with event indicators, `EVENTS` or `STEP_COMPLETED`.
    ///
    /// An unknown with [`depends_on`](crate::Variable::depends_on) depends on the variables in this list. An unknown
    /// without `depends_on` is taken to depend on all knowns if `smooth` is false. If `smooth` is true, fmu-package
    /// finds its dependencies numerically: an unknown that does not change when a known is perturbed near the start
    /// values is taken not to depend on it. Strings and binary values are not perturbed, so the unknown is taken to
    /// depend on all of them.
    pub smooth: bool,
}

/// Default experiment, which an importer proposes to its user (section 2.2.5 of FMI 2.0, 2.4.6 of FMI 3.0).
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
    /// One second in steps of one millisecond.
    pub const DEFAULT: Self = Self { start_time: 0.0, stop_time: 1.0, step_size: 1e-3, tolerance: 1e-6 };
}

impl Default for DefaultExperiment {
    fn default() -> Self {
        Self::DEFAULT
    }
}

impl Info {
    /// Creates the data of a model. The remaining strings are empty, the experiment is
    /// [`DefaultExperiment::DEFAULT`], and `smooth` is false.
    pub const fn new(name: &'static str, identifier: &'static str) -> Self {
        Self {
            name,
            identifier,
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

/// Creates the [`Info`] of a model with this name and identifier. Author, version and licence come from `Cargo.toml`.
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
            ..$crate::Info::new($name, $identifier)
        }
    };
}
