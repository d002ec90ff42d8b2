//! Model Exchange: integrates the states of an FMU from event to event.
//!
//! [`inputs`] describes inputs as functions of time, [`model`] evaluates the FMU for the solver, [`simulation`] alternates between smooth
//! intervals and events, [`solve`] integrates an interval, [`stepping`] locates events in its steps, and [`chatter`] ends a run
//! with too many events. The solvers are in the crate `ivp`. Every event restarts them.

mod chatter;
mod inputs;
mod model;
mod simulation;
mod solve;
mod stepping;

pub(crate) use chatter::{Chatter, MOST_EVENTS};
pub(crate) use inputs::{Curve, Signals, Slopes};
pub(crate) use model::Model;
pub(crate) use simulation::{Hooks, Simulation};

use crate::error::{Error, named, request};
use fmi_abi::shown_number;
use std::str::FromStr;

/// Method for integrating an FMU in Model Exchange.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Solver {
    /// [`Dop853`](Self::Dop853), and [`Bdf`](Self::Bdf) as soon as the model proves stiff.
    #[default]
    Auto,
    /// Runge-Kutta method of order 5 (Dormand and Prince).
    Dopri5,
    /// Runge-Kutta method of order 8 (Dormand and Prince).
    Dop853,
    /// Backward differentiation formulas of order 1 to 5, for stiff models.
    Bdf,
    /// The classical Runge-Kutta method with one step from each communication point or event to the next, or with several equal
    /// steps if one would exceed the [largest step](Integration::max_step).
    Rk4,
}

impl Solver {
    /// All solvers, with their names.
    pub const ALL: [(&str, Self); 5] = [
        ("auto", Self::Auto),
        ("dopri5", Self::Dopri5),
        ("dop853", Self::Dop853),
        ("bdf", Self::Bdf),
        ("rk4", Self::Rk4),
    ];
}

impl FromStr for Solver {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        named(&Self::ALL, "solver", name)
    }
}

/// Settings of the integration in Model Exchange.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Integration {
    /// Method.
    pub solver: Solver,
    /// Relative tolerance; `None` means the [tolerance](crate::Batch::tolerance) for the FMU, or 1e-6 if there is none.
    pub rtol: Option<f64>,
    /// Absolute tolerance of a state whose nominal value is 1. For other states it is multiplied by the nominal value. `None` means a
    /// hundredth of the relative tolerance.
    pub atol: Option<f64>,
    /// Largest step, s; `None` sets no limit.
    pub max_step: Option<f64>,
}

impl Integration {
    /// Fails unless the tolerances and the largest step are above 0 and finite, and the relative tolerance is from 1e-13 to below
    /// 1.
    pub(crate) fn check(&self) -> Result<(), Error> {
        for (name, value) in [("rtol", self.rtol), ("atol", self.atol), ("max_step", self.max_step)] {
            if let Some(value) = value.filter(|value| !(*value > 0.0 && value.is_finite())) {
                return request(format!("{name} is {}; it must be above 0 and finite", shown_number(value)));
            }
        }
        if self.solver == Solver::Rk4 && (self.rtol.is_some() || self.atol.is_some()) {
            return request(
                "rtol and atol have no effect with rk4, whose steps are fixed; choose max_step, or another solver".to_owned(),
            );
        }
        match self.rtol {
            Some(rtol) if !(1e-13..1.0).contains(&rtol) => {
                request(format!("rtol is {}; it must be at least 1e-13 and below 1", shown_number(rtol)))
            }
            _ => Ok(()),
        }
    }
}
