//! A row of the table of allowed calls of an FMI version.

use crate::mode::Situations;
use crate::standard::Standard;

/// Situations in which a function may be called.
#[derive(Clone, Copy, Debug)]
pub struct Rule {
    /// Name of the function.
    pub name: &'static str,
    /// Situations in which the FMI standard allows the call.
    pub standard: Situations,
    /// Further situations in which this project tolerates the call.
    pub tolerated: Situations,
}

impl Rule {
    /// Creates a row from the letters of [`Situations::new`] for each interface type. Tolerated modes apply
    /// only to interface types that have the function, or to both if the standard allows it in no mode here.
    pub const fn new(
        of: Standard,
        name: &'static str,
        co_simulation: &str,
        model_exchange: &str,
        tolerated: &str,
    ) -> Self {
        let standard = Situations::new(of, co_simulation, model_exchange);
        let tolerated = Situations::new(of, tolerated, tolerated);
        let tolerated = if standard.is_empty() { tolerated } else { tolerated.where_any(standard) };
        Self { name, standard, tolerated }
    }

    /// Returns all situations in which the call is accepted.
    pub const fn accepted(&self) -> Situations {
        self.standard.union(self.tolerated)
    }
}
