//! Where a variable may be set: what the standard says, and apart from it what is tolerated because importers do it.

use crate::mode::Situations;
use crate::variable::{Causality, Initial, Variability};

/// Where an importer may set a variable, standard and tolerated together.
pub(crate) const fn settable(
    causality: Causality,
    variability: Variability,
    initial: Option<Initial>,
    state: bool,
) -> Situations {
    standard(causality, variability, initial, state).and(tolerated(causality))
}

/// Footnotes 1, 3, 4, 5 and 6 of the tables in sections 3.2.3 and 4.2.4 of FMI 2.0.
pub(crate) const fn standard(
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
        set = set.and(Situations::new("I", "I")); // footnote 1
    }
    if exact || input {
        set = set.and(Situations::new("N", "N")); // footnote 3
    }
    if input || tunable {
        set = set.and(Situations::new("C", "M")); // footnotes 6 and 4
    }
    if state || input && matches!(variability, Variability::Continuous) {
        set = set.and(Situations::new("", "K")); // footnote 5
    }
    set
}

/// Inputs before the initialization (OpenModelica, libcosim), parameters after it (OpenModelica, and users who
/// tune).
pub(crate) const fn tolerated(causality: Causality) -> Situations {
    match causality {
        Causality::Input => Situations::new("I", "I"),
        Causality::Parameter => Situations::new("C", "M"),
        _ => Situations::NONE,
    }
}
