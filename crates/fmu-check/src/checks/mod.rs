//! Checks of the library and of the files of an FMU, with a module for each subject.

pub mod dependencies;
pub mod derivatives;
pub mod differences;
pub mod directional;
pub mod early_returns;
pub mod effects;
pub mod event_inputs;
pub mod functions;
pub mod hidden_events;
pub mod integration;
pub mod interfaces;
pub mod late_outputs;
pub mod life_cycle;
pub mod limits;
pub mod location;
pub mod logs;
pub mod malformed;
pub mod package;
pub mod rejections;
pub mod reset;
pub mod resources;
pub mod results;
pub mod set_again;
pub mod several;
pub mod single_precision;
pub mod small_steps;
pub mod snapshots;
pub mod stale;
pub mod start_times;
pub mod start_values;
pub mod state_values;
pub mod states;
pub mod status;
pub mod step_derivatives;
pub mod strings;
pub mod surroundings;
pub mod vectors;

use crate::call_sequence::CallSequence;
use crate::checker::Checker;
use crate::schema;
use crate::writer::Trajectory;
use Check::{Each, Malformed, Once};
use Fits::{Always, Integrated, Saves, Serializes, Several, Stepped, Stepped3};

/// Function of a check, and the simulations for which it is called.
#[derive(Clone, Copy)]
pub enum Check {
    /// Called once for the FMU.
    Once(fn(&Checker) -> anyhow::Result<()>),
    /// Called for each simulation that meets the condition.
    Each(Fits, fn(&Checker, &Trajectory) -> anyhow::Result<()>),
    /// Called for each simulation that meets the condition; returns malformed call sequences, whose findings belong to this rule.
    Malformed(&'static str, Fits, fn(&Checker, &Trajectory) -> anyhow::Result<Vec<CallSequence>>),
}

/// Condition that a simulation must meet for a check or a call sequence.
#[derive(Clone, Copy, PartialEq)]
pub enum Fits {
    Always,
    /// Simulations of Co-Simulation.
    Stepped,
    /// Simulations of Co-Simulation in FMI 3.0.
    Stepped3,
    /// Simulations of Co-Simulation in FMI 3.0 of FMUs that offer Event Mode.
    EventMode,
    /// Simulations of Model Exchange.
    Integrated,
    /// Simulations of FMUs that allow several instances in a process.
    Several,
    /// Simulations of FMUs that save states.
    Saves,
    /// Simulations of FMUs that serialize states.
    Serializes,
}

impl Fits {
    /// Returns whether a simulation meets the condition.
    pub fn fit(self, checker: &Checker, trajectory: &Trajectory) -> bool {
        let (interface, stepped) = (trajectory.interface, trajectory.is_stepped());
        match self {
            Always => true,
            Stepped => stepped,
            Stepped3 => stepped && checker.fmi3(),
            Fits::EventMode => stepped && checker.fmi3() && checker.can(interface, &["hasEventMode"]),
            Integrated => !stepped,
            Several => checker.several(interface),
            Saves => checker.saves(interface),
            Serializes => checker.serializes(interface),
        }
    }
}

/// Topic and function of every check that takes time. A check that can be requested separately has the name of its rule instead.
pub const ALL: &[(&str, Check)] = &[
    ("description", Once(schema::check)),
    ("life_cycle", Each(Always, life_cycle::sequences)),
    ("life_cycle", Once(life_cycle::free_null)),
    ("states", Each(Saves, states::restore)),
    ("malformed", Malformed("malformed.values", Always, malformed::values)),
    ("resources", Each(Always, resources::cycles)),
    ("results", Each(Always, results::repeat)),
    ("functions", Once(functions::present)),
    ("functions", Each(Always, functions::capabilities)),
    ("start_values", Each(Always, start_values::starts)),
    ("start_values", Each(Always, start_values::set)),
    ("start_values", Each(Always, single_precision::set)),
    ("states", Each(Serializes, states::serialized)),
    ("states", Each(Saves, state_values::restore)),
    ("reset", Each(Always, reset::reset)),
    ("derivatives", Each(Always, directional::directional)),
    ("derivatives", Each(Integrated, differences::after_events)),
    ("derivatives", Each(Always, differences::initial)),
    ("derivatives", Each(Integrated, differences::by_time)),
    ("derivatives", Each(Integrated, vectors::vectors)),
    ("dependencies", Each(Always, dependencies::missing)),
    ("dependencies", Each(Always, dependencies::initial)),
    ("dependencies", Each(Always, dependencies::kinds)),
    ("rejections", Each(Always, rejections::change_nothing)),
    ("results.interfaces", Once(interfaces::compare)),
    ("results", Each(Several, results::instances)),
    ("results", Each(Several, strings::instances)),
    ("results", Each(Several, several::freed)),
    ("results", Each(Stepped, status::status)),
    ("results", Each(Always, location::location)),
    ("results", Each(Always, results::reading)),
    ("results", Each(Always, results::arguments)),
    ("results", Each(Always, surroundings::environment)),
    ("results", Each(Always, surroundings::other_thread)),
    ("results", Each(Always, surroundings::no_earlier_state)),
    ("results", Each(Always, surroundings::logging)),
    ("results", Each(Always, surroundings::terminated)),
    ("results", Each(Stepped3, early_returns::steps)),
    ("results", Each(Several, results::threads)),
    ("results", Each(Several, strings::threads)),
    ("results", Each(Stepped, results::cut)),
    ("results", Each(Always, results::time)),
    ("results", Each(Stepped3, results::last_successful)),
    ("dynamics", Each(Stepped, small_steps::small_steps)),
    ("dynamics", Each(Stepped, step_derivatives::steps)),
    ("dynamics", Each(Always, set_again::set_again)),
    ("dynamics", Each(Stepped, late_outputs::late)),
    ("dynamics", Each(Integrated, stale::stale)),
    ("dynamics", Each(Integrated, event_inputs::integrated)),
    ("dynamics", Each(Fits::EventMode, event_inputs::stepped)),
    ("dynamics", Each(Integrated, hidden_events::unannounced)),
    ("dynamics", Each(Integrated, hidden_events::repeated)),
    ("dynamics", Each(Always, start_times::starts)),
    ("dynamics", Each(Always, limits::ranges)),
    ("dynamics", Each(Always, limits::stop_time)),
    ("start_values", Once(effects::parameters)),
    ("start_values", Each(Always, effects::tunable_parameters)),
    ("dependencies", Each(Always, effects::calculated_parameters)),
    ("life_cycle", Each(Always, life_cycle::random)),
    ("life_cycle", Each(Integrated, life_cycle::events)),
    ("logs", Each(Always, logs::switches)),
    ("logs.each-step", Each(Always, logs::each_step)),
    ("malformed", Malformed("malformed.null-instance", Always, malformed::null_instances)),
    ("malformed", Malformed("malformed.null", Always, malformed::nulls)),
    ("malformed", Malformed("malformed.references", Always, malformed::references)),
    ("malformed", Malformed("malformed.sizes", Always, malformed::sizes)),
    ("malformed", Malformed("malformed.times", Always, malformed::times)),
    ("malformed", Malformed("malformed.bytes", Serializes, malformed::bytes)),
];
