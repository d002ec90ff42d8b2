//! Modes in which a variable may be set: the modes that the FMI standard allows, and further modes that are tolerated
//! because existing importers use them.

use fmi_abi::{AllowedStates, Standard};
use fmi_abi::{Causality, Initial, Variability};

/// Returns the modes with these letters in Co-Simulation and in Model Exchange, for both FMI versions.
const fn both(co_simulation: &str, model_exchange: &str) -> AllowedStates {
    AllowedStates::new(Standard::Fmi2, co_simulation, model_exchange).union(AllowedStates::new(
        Standard::Fmi3,
        co_simulation,
        model_exchange,
    ))
}

/// Returns the modes in which an importer may set a variable, in both FMI versions.
///
/// The modes of the standard are taken from the tables in sections 3.2.3 and 4.2.4 of FMI 2.0, with footnotes 1, 3,
/// 4, 5 and 6. Sections 2.3.2, 2.3.3, 2.3.5, 3.2.1 and 4.2.1 of FMI 3.0 define the same rules, except that FMI 3.0
/// also allows inputs before the initialization, and has an Event Mode in Co-Simulation.
///
/// The function also tolerates further calls that importers make:
/// * inputs before the initialization in FMI 2.0 (OpenModelica and libcosim set them);
/// * parameters after the initialization (OpenModelica, and users who tune fixed parameters);
/// * Real parameters in Continuous-Time Mode (CasADi sets them between two evaluations).
pub(crate) const fn settable(
    causality: Causality,
    variability: Variability,
    initial: Option<Initial>,
    state: bool,
    reinit: bool,
    real: bool,
) -> AllowedStates {
    let exact = matches!(initial, Some(Initial::Exact)) && !matches!(variability, Variability::Constant);
    let approx = matches!(initial, Some(Initial::Approx));
    let input = matches!(causality, Causality::Input);
    let parameter = matches!(causality, Causality::Parameter);

    let mut set = AllowedStates::NONE;
    if exact || approx || input {
        set = set.union(both("I", "I")); // footnote 1; inputs of FMI 2.0 are tolerated
    }
    if exact || input {
        set = set.union(both("N", "N")); // footnote 3
    }
    if input || parameter {
        // Footnotes 6 and 4; fixed parameters are tolerated.
        set = set.union(both("C", "M")).union(AllowedStates::new(Standard::Fmi3, "M", ""));
    } else if state && !reinit {
        set = set.union(AllowedStates::new(Standard::Fmi3, "", "M")); // section 2.3.5 of FMI 3.0
    }
    if state || input && matches!(variability, Variability::Continuous) || parameter && real {
        set = set.union(both("", "K")); // footnote 5; parameters are tolerated
    }
    set
}

/// Modes in which an importer sets start values.
pub(crate) const START_VALUE_MODES: AllowedStates = both("IN", "IN");

/// All modes that an instance can have, except fatal.
pub(crate) const ALL_MODES: AllowedStates = AllowedStates::new(Standard::Fmi2, "INCFTE", "INMKTE")
    .union(AllowedStates::new(Standard::Fmi3, "INCMT", "INMKT"));
