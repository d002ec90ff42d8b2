//! Checks of saved states and steps that every FMU must pass. [`every_check!`](crate::every_check) defines a test of
//! each check for a model.

use crate::serialized::{MODE, sealed, time};
use crate::{Either, Random, Version};
use fmu_export::Interface::{CoSimulation, ModelExchange};
use fmu_export::Mode::{self, *};
use fmu_export::{BaseType, Causality, Exported, Interface, Status, Variable};
use std::ptr::{null, null_mut};

/// Defines one test per check for a model; each test runs in both FMI versions.
#[macro_export]
macro_rules! every_check {
    ($model:ty) => { $crate::every_check! {
        @each $model: random_contents_break_nothing steps_of_any_size steps_of_size_zero
    } };
    (@each $model:ty: $($check:ident)*) => {
        $(#[test] fn $check() {
            $crate::checks::$check::<$crate::Importer, $model>();
            $crate::checks::$check::<$crate::fmi3::Importer, $model>();
        })*
    };
}

/// Returns the indices of the variables that satisfy `wanted`.
pub fn indices<M: Exported>(wanted: impl Fn(&Variable<M>) -> bool) -> Vec<u32> {
    (0..).zip(M::TABLE).filter(|(_, variable)| wanted(variable)).map(|(index, _)| index).collect()
}

fn is_real<M>(variable: &Variable<M>) -> bool {
    variable.base() == BaseType::Real
}

/// Returns the Real inputs.
pub fn inputs<M: Exported>() -> Vec<u32> {
    indices::<M>(|variable| is_real(variable) && variable.causality() == Causality::Input)
}

/// Returns the Real outputs.
pub(crate) fn outputs<M: Exported>() -> Vec<u32> {
    indices::<M>(|variable| is_real(variable) && variable.causality() == Causality::Output)
}

/// Returns the Boolean parameters.
pub(crate) fn boolean_parameters<M: Exported>() -> Vec<u32> {
    indices::<M>(|variable| {
        variable.base() == BaseType::Boolean && variable.causality() == Causality::Parameter
    })
}

/// Returns the start value of a Real parameter; `None` for any other variable.
pub(crate) fn start_of<M: Exported>(variable: &Variable<M>) -> Option<f64> {
    use fmu_export::{Setup, Value};
    if variable.causality() != Causality::Parameter {
        return None;
    }
    match variable.value(&M::new(&Setup::new(CoSimulation)).ok()?) {
        Some(Value::Real(value)) if is_real(variable) => Some(value),
        _ => None,
    }
}

/// Returns all pairs of an interface type that the model supports and a mode that an instance can enter.
pub fn modes_of_model<F: Either, M: Exported>() -> Vec<(Interface, Mode)> {
    let has_events = M::CO_SIMULATION.is_some_and(|offer| offer.has_event_mode());
    let offered = [(CoSimulation, M::CO_SIMULATION.is_some()), (ModelExchange, M::MODEL_EXCHANGE.is_some())];
    let offered = offered.into_iter().filter(|(_, is_offered)| *is_offered);
    let all =
        offered.flat_map(|(interface, _)| F::modes_of(interface).iter().map(move |mode| (interface, *mode)));
    all.filter(|pair| has_events || *pair != (CoSimulation, Event)).collect()
}

/// Compares the first time derivatives of outputs and local variables with finite differences over short steps. Every
/// step begins at the same saved state. After a step, `set_inputs` is called with its size and sets the inputs for its end.
#[track_caller]
pub fn output_derivatives_fit_steps<M: Exported>(
    fmu: &dyn Either,
    time: f64,
    label: &str,
    set_inputs: impl Fn(f64),
) {
    const H: f64 = 5e-5;
    let moving = indices::<M>(|variable| {
        is_real(variable) && matches!(variable.causality(), Causality::Output | Causality::Local)
    });
    let found: Vec<_> = moving.iter().map(|index| fmu.rate(*index)).collect();
    let state = fmu.save();
    let y = [0.0, 1.0, 2.0, 3.0, 4.0].map(|steps| {
        fmu.ok(fmu.set_state(state));
        if steps > 0.0 {
            fmu.step(time, H * steps);
            set_inputs(H * steps);
        }
        fmu.read(&moving)
    });
    fmu.ok(fmu.set_state(state));
    fmu.forget(state);
    for (i, index) in moving.iter().enumerate() {
        let expected =
            (-25.0 * y[0][i] + 48.0 * y[1][i] - 36.0 * y[2][i] + 16.0 * y[3][i] - 3.0 * y[4][i]) / (12.0 * H);
        // Allows for the rounding error and the truncation error of the difference.
        let tolerance = 1e-7 * (1.0 + y[0][i].abs() + expected.abs());
        let name = M::TABLE[*index as usize].name();
        assert!(
            (found[i] - expected).abs() < tolerance,
            "{label}: {name}' must be {expected}, it is {}",
            found[i]
        );
    }
}

/// Checks that neither reading Reals nor a step is fatal after the FMU has accepted a damaged state. Under Miri, which is
/// slow, fewer states are tried.
pub fn random_contents_break_nothing<F: Either, M: Exported>() {
    const DAMAGED: usize = if cfg!(miri) { 60 } else { 3_000 };
    let fmu = F::in_mode::<M>(CoSimulation, StepComplete);
    let original = fmu.bytes();
    let (mut random, mut accepted) = (Random(11), 0);
    for _ in 0..DAMAGED {
        let mut bytes = original.clone();
        for _ in 0..=random.below(3) {
            // Writes a number of any magnitude at any offset, so that it may overlap two values.
            let at = MODE.end + random.below(bytes.len() - MODE.end - 16);
            let word = random.bits() >> random.below(64);
            let width = if random.chance(0.5) { 4 } else { 8 };
            bytes[at..at + width].copy_from_slice(&word.to_le_bytes()[..width]);
        }
        let (bytes, mut state) = (sealed(bytes), null_mut());
        if fmu.deserialize(bytes.as_ptr(), bytes.len(), &mut state) == Status::Ok {
            accepted += 1;
            fmu.ok(fmu.set_state(state));
            fmu.forget(state);
            let time = time(&fmu.bytes());
            let all = indices::<M>(is_real);
            let mut statuses: Vec<_> = all.iter().map(|index| fmu.try_get(&[*index], &mut [0.0])).collect();
            statuses.extend([fmu.try_step(time, 0.01), fmu.try_step(time + 0.01, 0.02)]);
            assert!(!statuses.contains(&Status::Fatal), "{:?}\n{bytes:?}", fmu.take_log());
        }
        fmu.take_log();
    }
    fmu.restore(&original);
    fmu.ok(fmu.try_step(0.0, 0.01));
    assert!(accepted > DAMAGED / 15, "only {accepted} of {DAMAGED} were accepted");
}

/// Checks that a step of any size returns within 10 seconds, because importers may take very long or very short steps.
pub fn steps_of_any_size<F: Either, M: Exported>() {
    for step_size in [1e-300, 1e-9, 1.0, 1e9, 1e100, 1e300, 0.5 * f64::MAX] {
        let (sender, receiver) = std::sync::mpsc::channel();
        std::thread::spawn(move || {
            let fmu = F::in_mode::<M>(CoSimulation, StepComplete);
            let inputs = inputs::<M>();
            fmu.set(&inputs, &vec![0.5; inputs.len()]);
            let _ = sender.send((fmu.try_step(0.0, step_size), fmu.read(&indices::<M>(is_real))));
        });
        let received = receiver.recv_timeout(std::time::Duration::from_secs(10));
        let (status, _) =
            received.unwrap_or_else(|_| panic!("a step of {step_size:e} s takes over 10 seconds"));
        assert!(matches!(status, Status::Ok | Status::Error), "{step_size:e}: {status:?}");
    }
}

/// Checks that a step of size 0 changes nothing and is logged once, before the first step and later, because some
/// importers begin with one.
pub fn steps_of_size_zero<F: Either, M: Exported>() {
    let fmu = F::in_mode::<M>(CoSimulation, StepComplete);
    fmu.ok(match fmu.version() {
        Version::Fmi2(fmu) => fmu.fmi2SetDebugLogging(1, 0, null()),
        Version::Fmi3(fmu) => fmu.fmi3SetDebugLogging(1, 0, null()),
    });
    let inputs = inputs::<M>();
    let mut time = 0.0;
    for value in [0.5, 0.6, 0.8] {
        fmu.set(&inputs, &vec![value; inputs.len()]);
        let before = fmu.bytes();
        fmu.take_log();
        for zero in [0.0, -0.0] {
            fmu.step(time, zero);
            let log: Vec<_> = fmu.take_log().into_iter().map(|message| message.message).collect();
            assert!(log.len() == 1 && log[0].contains("size 0"), "{log:?}");
        }
        assert_eq!(fmu.bytes(), before, "at {time}");
        fmu.step(time, 0.01);
        time += 0.01;
    }
}
