//! Properties of a variable besides its type (section 2.2.7 of FMI 2.0, 2.4.7.4 of FMI 3.0).

use std::fmt;

/// Defines an enumeration whose items have names in model descriptions.
macro_rules! attribute {
    ($(#[$text:meta])* $name:ident { $($(#[$item_text:meta])* $item:ident = $word:literal,)+ }) => {
        $(#[$text])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum $name { $($(#[$item_text])* $item,)+ }

        impl $name {
            /// The item that has this name in model descriptions.
            pub fn of_name(name: &str) -> Option<Self> {
                match name {
                    $($word => Some(Self::$item),)+
                    _ => None,
                }
            }
        }

        /// As written in model descriptions.
        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(match self { $(Self::$item => $word,)+ })
            }
        }
    };
}

attribute! {
    /// Who sets a variable and who reads it (section 2.2.7).
    Causality {
        /// Set by the user before the simulation.
        Parameter = "parameter",
        /// Follows from parameters.
        CalculatedParameter = "calculatedParameter",
        /// Set by the importer at every communication point.
        Input = "input",
        /// Read by the importer.
        Output = "output",
        /// Of interest inside the model only.
        Local = "local",
        /// The time.
        Independent = "independent",
    }
}

attribute! {
    /// When a variable changes (section 2.2.7).
    Variability {
        /// Never.
        Constant = "constant",
        /// Not after initialization.
        Fixed = "fixed",
        /// When the user changes a parameter.
        Tunable = "tunable",
        /// At events or communication points.
        Discrete = "discrete",
        /// At any time.
        Continuous = "continuous",
    }
}

attribute! {
    /// How a variable gets its first value (section 2.2.7).
    Initial {
        /// From its start value.
        Exact = "exact",
        /// By calculation that begins with its start value.
        Approx = "approx",
        /// By calculation.
        Calculated = "calculated",
    }
}
