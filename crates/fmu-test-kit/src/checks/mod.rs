//! Checks that hold for every FMU with both interface types and all derivatives.
//! [`every_check!`](crate::every_check) defines the tests for a model. The test inputs are derived from the
//! variable table.

mod derivatives;
mod importers;
mod states;

pub use derivatives::*;
pub use importers::*;
pub use states::*;

use crate::Either;
use fmu_export::{BaseType, Causality, Exported, Interface, Mode, Variable};
use std::ops::Range;

/// Defines a test for each check of a model: checks of FMI 2.0, then checks of both FMI versions.
#[macro_export]
macro_rules! every_check {
    ($model:ty) => {
        $crate::every_check! { $model:
            [fmikit fmpy libcosim maestro_and_pyfmi omsimulator openmodelica
            derivatives_of_every_variable_and_order output_derivatives_are_exact several_at_once]
            [events_of_the_importer every_mode_comes_back no_changed_byte_goes_unseen omsimulator_without_instance random_contents_break_nothing replay_in_model_exchange
            replay_is_bit_identical reset_is_a_new_beginning state_between_inputs_and_step
            states_of_the_other_standard stepping_back_in_any_order steps_of_any_size values_come_back]
        }
    };
    ($model:ty: [$($check:ident)*] [$($either:ident)*]) => {
        $(#[test] fn $check() { $crate::checks::$check::<$model>(); })*
        $(#[test] fn $either() {
            $crate::checks::$either::<$crate::Importer, $model>();
            $crate::checks::$either::<$crate::fmi3::Importer, $model>();
        })*
    };
}

/// Returns the indices of the variables that satisfy `wanted`.
pub fn places<M: Exported>(wanted: impl Fn(&Variable<M>) -> bool) -> Vec<u32> {
    (0..).zip(M::TABLE).filter(|(_, variable)| wanted(variable)).map(|(place, _)| place).collect()
}

fn is_real<M>(variable: &Variable<M>) -> bool {
    variable.base() == BaseType::Real
}

pub(crate) fn inputs<M: Exported>() -> Vec<u32> {
    places::<M>(|of| is_real(of) && of.causality() == Causality::Input)
}

pub(crate) fn outputs<M: Exported>() -> Vec<u32> {
    places::<M>(|of| is_real(of) && of.causality() == Causality::Output)
}

/// Returns the parameters of a type.
pub(crate) fn parameters<M: Exported>(base: BaseType) -> Vec<u32> {
    places::<M>(|of| of.base() == base && of.causality() == Causality::Parameter)
}

/// Returns all Reals that may change: outputs and locals.
fn moving<M: Exported>() -> Vec<u32> {
    places::<M>(|of| is_real(of) && matches!(of.causality(), Causality::Output | Causality::Local))
}

/// Returns the values of the inputs at a time; 0 at time 0.
fn signals<M: Exported>(t: f64) -> Vec<f64> {
    (0..inputs::<M>().len()).map(|i| ((3 + i) as f64 * t).sin()).collect()
}

/// Returns the time derivatives of [`signals`].
fn slopes<M: Exported>(t: f64) -> Vec<f64> {
    (0..inputs::<M>().len()).map(|i| (3 + i) as f64).map(|f| f * (f * t).cos()).collect()
}

/// Sets non-default parameters: Reals 1 % larger, which stays within their ranges, all Booleans to `truth`.
fn change_parameters<M: Exported>(fmu: &dyn Either, truth: u8) {
    for place in parameters::<M>(BaseType::Boolean) {
        fmu.ok(fmu.set_boolean(place, truth));
    }
    for (place, start) in (0..).zip(M::TABLE).filter_map(|(place, of)| Some((place, start_of(of)?))) {
        fmu.set(&[place], &[1.01 * start]);
    }
}

/// Returns the start value of a Real parameter.
pub(crate) fn start_of<M: Exported>(variable: &Variable<M>) -> Option<f64> {
    use fmu_export::{Setup, Value};
    if variable.causality() != Causality::Parameter {
        return None;
    }
    match variable.value(&M::new(&Setup::new(Interface::CoSimulation)).ok()?) {
        Some(Value::Real(value)) if is_real(variable) => Some(value),
        _ => None,
    }
}

/// Returns every interface type of the model with each of its modes that can be entered.
pub fn modes_of_model<F: Either, M: Exported>() -> Vec<(Interface, Mode)> {
    let has_events = M::CO_SIMULATION.is_some_and(|offer| offer.has_event_mode());
    let offered = [
        (Interface::CoSimulation, M::CO_SIMULATION.is_some()),
        (Interface::ModelExchange, M::MODEL_EXCHANGE.is_some()),
    ];
    let offered = offered.into_iter().filter(|(_, is_offered)| *is_offered);
    let all =
        offered.flat_map(|(interface, _)| F::modes_of(interface).iter().map(move |mode| (interface, *mode)));
    all.filter(|pair| has_events || *pair != (Interface::CoSimulation, Mode::Event)).collect()
}

/// Returns the bits of every Real variable.
fn observe<M: Exported>(fmu: &dyn Either) -> Vec<u64> {
    fmu.read(&places::<M>(is_real)).into_iter().map(f64::to_bits).collect()
}

/// A Co-Simulation run with uneven steps; it can begin and end at any step.
struct Run {
    /// Whether input derivatives are set.
    slopes: bool,
    /// Value of all Boolean parameters.
    truth: u8,
    points: Vec<f64>,
}

impl Run {
    const STEPS: usize = 24;

    fn all() -> [Self; 3] {
        let mut random = crate::Random(7);
        let mut points = vec![0.25];
        for i in 0..Self::STEPS {
            points.push(points[i] + random.between(0.001, 0.03));
        }
        [(true, 0), (false, 0), (false, 1)].map(|(slopes, truth)| Self {
            slopes,
            truth,
            points: points.clone(),
        })
    }

    fn start<F: Either, M: Exported>(&self) -> F {
        let fmu = F::in_mode::<M>(Interface::CoSimulation, Mode::Instantiated);
        change_parameters::<M>(&fmu, self.truth);
        fmu.initialize(self.points[0]);
        fmu.leave_event_mode();
        fmu
    }

    fn set_inputs<M: Exported>(&self, fmu: &dyn Either, i: usize) {
        let (t, inputs) = (self.points[i], inputs::<M>());
        fmu.set(&inputs, &signals::<M>(t));
        if self.slopes {
            fmu.give_rates(&inputs, &slopes::<M>(2.0 * t));
        }
    }

    fn step(&self, fmu: &dyn Either, i: usize) {
        fmu.step(self.points[i], self.points[i + 1] - self.points[i]);
    }

    /// Performs steps and returns the observed values.
    fn go<M: Exported>(&self, fmu: &dyn Either, steps: Range<usize>) -> Vec<Vec<u64>> {
        let see = |i| {
            self.set_inputs::<M>(fmu, i);
            self.step(fmu, i);
            observe::<M>(fmu)
        };
        steps.map(see).collect()
    }
}
