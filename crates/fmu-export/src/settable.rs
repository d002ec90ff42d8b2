//! Modes in which a variable may be set: those that the standard allows, and those tolerated for existing
//! importers.

use fmi_abi::{Causality, Initial, Variability};
use fmi_abi::{Situations, Standard};

/// Returns the modes in which an importer may set a variable, in both FMI versions, including tolerated ones.
pub(crate) const fn settable(
    causality: Causality,
    variability: Variability,
    initial: Option<Initial>,
    state: bool,
    reinit: bool,
    real: bool,
) -> Situations {
    let of_both = in_both(Standard::Fmi2, causality, variability, initial, state)
        .union(in_both(Standard::Fmi3, causality, variability, initial, state))
        .union(tolerated(Standard::Fmi2, causality, real))
        .union(tolerated(Standard::Fmi3, causality, real));
    of_both.union(in_event_mode(causality, variability, state, reinit))
}

/// Returns the modes of the tables in sections 3.2.3 and 4.2.4 of FMI 2.0, footnotes 1, 3, 4, 5 and 6.
/// Sections 2.3.2, 2.3.3, 2.3.5, 3.2.1 and 4.2.1 of FMI 3.0 give equal rules. FMI 3.0 also allows inputs
/// before the initialization; see [`tolerated`].
const fn in_both(
    standard: Standard,
    causality: Causality,
    variability: Variability,
    initial: Option<Initial>,
    state: bool,
) -> Situations {
    let constant = matches!(variability, Variability::Constant);
    let exact = matches!(initial, Some(Initial::Exact)) && !constant;
    let approx = matches!(initial, Some(Initial::Approx));
    let input = matches!(causality, Causality::Input);
    let tunable = matches!((causality, variability), (Causality::Parameter, Variability::Tunable));

    let mut set = Situations::NONE;
    if exact || approx {
        set = set.union(Situations::new(standard, "I", "I")); // footnote 1
    }
    if exact || input {
        set = set.union(Situations::new(standard, "N", "N")); // footnote 3
    }
    if input || tunable {
        set = set.union(Situations::new(standard, "C", "M")); // footnotes 6 and 4
    }
    if state || input && matches!(variability, Variability::Continuous) {
        set = set.union(Situations::new(standard, "", "K")); // footnote 5
    }
    set
}

/// Returns the modes that exist only in FMI 3.0 (section 2.3.5): Event Mode of Co-Simulation, and Event Mode
/// for states without `reinit`.
const fn in_event_mode(
    causality: Causality,
    variability: Variability,
    state: bool,
    reinit: bool,
) -> Situations {
    match (causality, variability) {
        // A fixed parameter is tolerated, as in step mode.
        (Causality::Input, _) | (Causality::Parameter, _) => Situations::new(Standard::Fmi3, "M", ""),
        _ if state && !reinit => Situations::new(Standard::Fmi3, "", "M"),
        _ => Situations::NONE,
    }
}

/// Returns the tolerated modes. Inputs before the initialization: OpenModelica and libcosim; FMI 3.0 allows
/// it (section 2.3.2). Parameters after the initialization: OpenModelica, and users who tune. Real parameters
/// between two evaluations: CasADi.
const fn tolerated(standard: Standard, causality: Causality, real: bool) -> Situations {
    match causality {
        Causality::Input => Situations::new(standard, "I", "I"),
        Causality::Parameter => Situations::new(standard, "C", if real { "MK" } else { "M" }),
        _ => Situations::NONE,
    }
}

/// Modes in which start values are set.
pub(crate) const STARTING: Situations =
    Situations::new(Standard::Fmi2, "IN", "IN").union(Situations::new(Standard::Fmi3, "IN", "IN"));

/// All modes of instances except fatal.
pub(crate) const POSSIBLE: Situations = Situations::new(Standard::Fmi2, "INCFTE", "INMKTE")
    .union(Situations::new(Standard::Fmi3, "INCMT", "INMKT"));
