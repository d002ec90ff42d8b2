//! What the standards tell of a variable besides its type (section 2.2.7 of FMI 2.0, 2.4.7.4 of FMI 3.0).

/// Who sets a variable and who reads it (section 2.2.7).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Causality {
    /// Set by the user before the simulation.
    Parameter,
    /// Follows from parameters.
    CalculatedParameter,
    /// Set by the importer at every communication point.
    Input,
    /// Read by the importer.
    Output,
    /// Of interest inside the model only.
    Local,
    /// The time.
    Independent,
}

/// When a variable changes (section 2.2.7).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Variability {
    /// Never.
    Constant,
    /// Not after initialization.
    Fixed,
    /// When the user changes a parameter.
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
    /// By calculation that begins with its start value.
    Approx,
    /// By calculation.
    Calculated,
}
