//! A row of a standard's table of allowed calls.

use crate::mode::Situations;
use crate::standard::Standard;

/// Where one function may be called.
#[derive(Clone, Copy, Debug)]
pub struct Rule {
    /// The function's name.
    pub name: &'static str,
    /// Where the standard allows the call.
    pub standard: Situations,
    /// Where the call is tolerated beyond the standard.
    pub tolerated: Situations,
}

impl Rule {
    /// A row: the letters of [`Situations::new`] for either interface type; what is tolerated holds for those that have the
    /// function.
    pub const fn new(
        of: Standard,
        name: &'static str,
        co_simulation: &str,
        model_exchange: &str,
        tolerated: &str,
    ) -> Self {
        let standard = Situations::new(of, co_simulation, model_exchange);
        let tolerated = Situations::new(of, tolerated, tolerated).where_any(standard);
        Self { name, standard, tolerated }
    }

    /// Where the call is accepted.
    pub const fn accepted(&self) -> Situations {
        self.standard.union(self.tolerated)
    }
}
