//! Where a variable may be set: what the standard says, and apart from it what is tolerated because importers do it.

use fmi_abi::{Causality, Initial, Variability};
use fmi_abi::{Situations, Standard};

/// Where an importer may set a variable, in both standards, with what is tolerated.
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

/// Footnotes 1, 3, 4, 5 and 6 of the tables in sections 3.2.3 and 4.2.4 of FMI 2.0; the states of FMI 3.0 (sections
/// 2.3.2, 2.3.3, 2.3.5, 3.2.1 and 4.2.1) say the same. Inputs before the initialization are of FMI 3.0, see
/// [`tolerated`].
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

/// What only FMI 3.0 has (section 2.3.5): the Event Mode of Co-Simulation, and states that events leave alone.
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

/// Inputs before the initialization (OpenModelica, libcosim; FMI 3.0 allows it, section 2.3.2), parameters after it
/// (OpenModelica, and users who tune), Real ones also between two evaluations (CasADi).
const fn tolerated(standard: Standard, causality: Causality, real: bool) -> Situations {
    match causality {
        Causality::Input => Situations::new(standard, "I", "I"),
        Causality::Parameter => Situations::new(standard, "C", if real { "MK" } else { "M" }),
        _ => Situations::NONE,
    }
}

/// Where start values are set.
pub(crate) const STARTING: Situations =
    Situations::new(Standard::Fmi2, "IN", "IN").union(Situations::new(Standard::Fmi3, "IN", "IN"));

/// The modes that instances can be in, short of fatal.
pub(crate) const POSSIBLE: Situations = Situations::new(Standard::Fmi2, "INCFTE", "INMKTE")
    .union(Situations::new(Standard::Fmi3, "INCMT", "INMKT"));
