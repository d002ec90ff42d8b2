//! A row of the table of allowed calls of an FMI version.

use crate::mode::AllowedStates;
use crate::standard::Standard;

/// States in which a function may be called.
#[derive(Clone, Copy, Debug)]
pub struct Rule {
    /// Name of the function.
    pub name: &'static str,
    /// States in which the FMI standard allows the call.
    pub standard: AllowedStates,
    /// Further states in which fmu-export tolerates the call.
    pub tolerated: AllowedStates,
}

impl Rule {
    /// Creates a row from mode letters, as in [`AllowedStates::new`]. The tolerated modes apply to each interface
    /// type in which the standard allows the call at all. If the standard allows it nowhere, they apply to both.
    pub const fn new(
        of: Standard,
        name: &'static str,
        co_simulation: &str,
        model_exchange: &str,
        tolerated: &str,
    ) -> Self {
        let standard = AllowedStates::new(of, co_simulation, model_exchange);
        let tolerated = AllowedStates::new(of, tolerated, tolerated);
        let tolerated = if standard.is_empty() { tolerated } else { tolerated.only_where(standard) };
        Self { name, standard, tolerated }
    }

    /// Returns all states in which fmu-export accepts the call.
    pub const fn accepted(&self) -> AllowedStates {
        self.standard.union(self.tolerated)
    }
}
