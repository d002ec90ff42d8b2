//! The checks, by topics.

pub mod dependencies;
pub mod derivatives;
pub mod early_returns;
pub mod functions;
pub mod hostile;
pub mod life_cycle;
pub mod logs;
pub mod package;
pub mod refusals;
pub mod reset;
pub mod resources;
pub mod results;
pub mod start_values;
pub mod states;

use crate::checker::Checker;

/// A check: its topic and what it does.
pub type Check = (&'static str, fn(&Checker) -> anyhow::Result<()>);

/// All topics with the checks of the library.
pub const ALL: &[Check] = &[
    ("life_cycle", life_cycle::orders),
    ("states", states::restore),
    ("hostile", hostile::values),
    ("resources", resources::cycles),
    ("results", results::repeat),
    ("functions", functions::present),
    ("start_values", start_values::starts),
    ("start_values", start_values::set),
    ("states", states::serialized),
    ("reset", reset::reset),
    ("derivatives", derivatives::directional),
    ("derivatives", derivatives::vectors),
    ("dependencies", dependencies::missing),
    ("dependencies", dependencies::initial),
    ("refusals", refusals::change_nothing),
    ("results", results::instances),
    ("results", results::reading),
    ("results", results::name),
    ("results", early_returns::told),
    ("results", results::threads),
    ("results", results::cut),
    ("results", results::time),
    ("life_cycle", life_cycle::random),
    ("life_cycle", life_cycle::events),
    ("logs", logs::switches),
    ("hostile", hostile::calls),
    ("hostile", hostile::times),
    ("hostile", hostile::bytes),
];

/// The sources of the checks, whose rules are to be in the table.
#[cfg(test)]
pub const SOURCES: &[&str] = &[
    include_str!("dependencies.rs"),
    include_str!("derivatives.rs"),
    include_str!("early_returns.rs"),
    include_str!("functions.rs"),
    include_str!("hostile.rs"),
    include_str!("life_cycle.rs"),
    include_str!("logs.rs"),
    include_str!("package.rs"),
    include_str!("refusals.rs"),
    include_str!("reset.rs"),
    include_str!("resources.rs"),
    include_str!("results.rs"),
    include_str!("start_values.rs"),
    include_str!("states.rs"),
];
