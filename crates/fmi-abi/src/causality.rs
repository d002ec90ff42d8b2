//! Attributes of a variable other than its type (section 2.2.7 of FMI 2.0, 2.4.7.4 of FMI 3.0), and of its dependencies.

use crate::Standard;
use std::fmt;

// The tables of section 2.2.7 of FMI 2.0.5 and section 2.4.7.4 of FMI 3.0.2. The exporter and the checker call the same functions, so
// a model that compiles has no finding.
impl Causality {
    /// Whether a variable of this causality may have this variability.
    pub const fn permits(self, variability: Variability) -> bool {
        use Causality::*;
        use Variability::*;
        matches!(
            (self, variability),
            (Parameter | StructuralParameter | CalculatedParameter, Fixed | Tunable)
                | (Input, Discrete | Continuous)
                | (Output, Constant | Discrete | Continuous)
                | (Local, _)
                | (Independent, Continuous)
        )
    }

    /// Whether a variable of this causality and variability may have this `initial`; `None` if the attribute is missing and has no
    /// default. Only FMI 3.0 lets an input state that its first value is the start value.
    pub const fn permits_initial(
        self,
        standard: Standard,
        variability: Variability,
        initial: Option<Initial>,
    ) -> bool {
        use Causality::*;
        use Initial::*;
        use Variability::{Constant, Continuous, Discrete, Fixed, Tunable};
        let is_stated_input = matches!((standard, self, initial), (Standard::Fmi3, Input, Some(Exact)));
        self.permits(variability)
            && (is_stated_input
                || matches!(
                    (self, variability, initial),
                    (Parameter | StructuralParameter, _, Some(Exact))
                        | (_, Constant, Some(Exact))
                        | (Input, _, None)
                        | (Independent, _, None)
                        | (CalculatedParameter | Local, Fixed | Tunable, Some(Calculated | Approx))
                        | (Output | Local, Discrete | Continuous, Some(_))
                ))
    }
}

/// Defines an enumeration whose items have names in model descriptions.
macro_rules! attribute {
    ($(#[$text:meta])* $name:ident { $($(#[$item_text:meta])* $item:ident = $word:literal,)+ }) => {
        $(#[$text])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
        pub enum $name { $($(#[$item_text])* $item,)+ }

        impl $name {
            /// Returns the item with this name in model descriptions.
            pub fn of_name(name: &str) -> Option<Self> {
                match name {
                    $($word => Some(Self::$item),)+
                    _ => None,
                }
            }
        }

        /// Writes the name in model descriptions.
        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(match self { $(Self::$item => $word,)+ })
            }
        }
    };
}

attribute! {
    /// Purpose of a variable: who sets it and who reads it (section 2.2.7 of FMI 2.0).
    Causality {
        /// Set by the user: before the simulation or, if it is tunable, also during the simulation.
        Parameter = "parameter",
        /// Sets the sizes of arrays before the simulation (FMI 3.0).
        StructuralParameter = "structuralParameter",
        /// Calculated from parameters.
        CalculatedParameter = "calculatedParameter",
        /// Set by the importer, before and during the simulation.
        Input = "input",
        /// Read by the importer.
        Output = "output",
        /// Calculated by the model. The importer may read it, but must not connect it to other models.
        Local = "local",
        /// The independent variable: the time.
        Independent = "independent",
    }
}

attribute! {
    /// Times at which a variable may change (section 2.2.7 of FMI 2.0).
    Variability {
        /// The variable never changes.
        Constant = "constant",
        /// The variable does not change after initialization.
        Fixed = "fixed",
        /// The variable changes only when the user sets a tunable parameter.
        Tunable = "tunable",
        /// The variable changes only at events or communication points.
        Discrete = "discrete",
        /// The variable may change at any time.
        Continuous = "continuous",
    }
}

attribute! {
    /// Source of the first value of a variable (section 2.2.7 of FMI 2.0).
    Initial {
        /// The first value is the start value.
        Exact = "exact",
        /// The first value is calculated by iteration from the start value.
        Approx = "approx",
        /// The first value is calculated.
        Calculated = "calculated",
    }
}

attribute! {
    /// How a known enters the equation of an unknown (`dependenciesKind`, section 2.2.8 of FMI 2.0, 2.4.8 of FMI 3.0). Each kind states less
    /// than the ones before it.
    DependencyKind {
        /// With a factor that never changes.
        Constant = "constant",
        /// With a factor that does not change after the initialization.
        Fixed = "fixed",
        /// With a factor that changes only with tunable parameters.
        Tunable = "tunable",
        /// With a factor that changes only at events, in Co-Simulation at communication points.
        Discrete = "discrete",
        /// In any way.
        Dependent = "dependent",
    }
}

attribute! {
    /// Source of the interval between two ticks of a clock (`intervalVariability`, section 2.2.8.2 of FMI 3.0).
    IntervalVariability {
        /// The interval is declared.
        Constant = "constant",
        /// The interval does not change after initialization.
        Fixed = "fixed",
        /// The interval changes only with tunable parameters.
        Tunable = "tunable",
        /// Each tick determines the interval to the next one.
        Changing = "changing",
        /// Any event may determine the interval to the next tick.
        Countdown = "countdown",
        /// The importer ticks an input clock when it wants to, and the FMU any other clock.
        Triggered = "triggered",
    }
}
