//! Derivatives with respect to variables and with respect to time (sections 2.1.9 and 4.2.1 of FMI 2.0).

use crate::exact::{
    INPUTS, LINEAR, STARTS, STATES, jacobian, parameters, real_parameters, set_parameters, start_at, unknowns,
};
use crate::in_mode;
use crate::{TABLE, new, vr};
use fmu_export::Causality::Parameter;
use fmu_export::Interface::{CoSimulation, ModelExchange};
use fmu_export::Mode::{self, *};
use fmu_package::structure::ModelStructure;
use fmu_package::{LoadedModel, Standard};
use fmu_test_kit::checks::output_derivatives_fit_steps;
use fmu_test_kit::{Either, Importer as Fmu, Random, fmi3};
use prw_testbed::TestbedFmu;
use prw_testbed::variables::Name;
use std::sync::LazyLock;

/// The model structure in the model description for FMI 2.0.
static STRUCTURE: LazyLock<ModelStructure> = LazyLock::new(|| {
    let (fmi2, fmi3) =
        (fmu_export::fmi2::functions::<TestbedFmu>(), fmu_export::fmi3::functions::<TestbedFmu>());
    // SAFETY: the functions belong to the same model.
    let model = unsafe { LoadedModel::new(&fmu_export::describe::<TestbedFmu>(), fmi2, fmi3) };
    ModelStructure::of(&model.unwrap(), Standard::Fmi2, false).unwrap()
});

/// Returns central differences of the values of the unknowns with respect to `known`, each with a bound of its rounding
/// error. The values are linear in every known except the parameters of the equations, so the width is small only for these.
fn differences<F: Either>(fmu: &F, unknowns: &[u32], known: u32) -> Vec<(f64, f64)> {
    let [value] = fmu.get([known]);
    let is_linear = [&INPUTS[..], &STATES, &STARTS].concat().contains(&known);
    let width = if is_linear { 1.0 } else { 1e-4 * value };
    assert!(width > 0.0, "{} is {value}; vary it in exact::parameters", TABLE[known as usize].name());
    let state = fmu.save();
    let [above, below] = [value + width, value - width].map(|value| {
        fmu.ok(fmu.set_state(state));
        if let Some(index) = STATES.iter().position(|state| *state == known) {
            let mut x = fmu.states::<6>();
            x[index] = value;
            fmu.ok(fmu.set_states(x.as_ptr(), 6));
        } else {
            fmu.set(&[known], &[value]);
        }
        fmu.read(unknowns)
    });
    fmu.ok(fmu.set_state(state));
    fmu.forget(state);
    let ends = above.into_iter().zip(below);
    ends.map(|(a, b)| ((a - b) / (2.0 * width), 1e-10 * (a.abs() + b.abs()) / width)).collect()
}

/// Checks that every derivative agrees with its difference, and is 0 if the model structure does not declare the dependency.
/// After the initialization, declarations are not checked until the simulation has `started`, because until then the states
/// depend on start values. They are also not checked for parameters, which are declared only for the initialization.
fn fit_differences<F: Either>(fmu: &F, mode: Mode, started: bool, label: &str) {
    let structure = &*STRUCTURE;
    let (unknowns, listed) = match mode {
        Initialization => ([unknowns(), STATES.to_vec()].concat(), vec![&structure.initial_unknowns]),
        _ => (unknowns(), vec![&structure.outputs, &structure.derivatives]),
    };
    let declares = |unknown: u32, known: u32| {
        let mut listed = listed.iter().copied().flatten().filter(|variable| variable.index == unknown);
        listed.any(|variable| variable.dependencies.iter().any(|(vr, _)| *vr == known))
    };
    // States can be set only in these two modes, not in Co-Simulation.
    let states = if matches!(mode, Event | ContinuousTime) { &STATES[..] } else { &[] };
    for known in [&INPUTS, states].concat().into_iter().chain(real_parameters()) {
        let is_listed = mode == Initialization || started && TABLE[known as usize].causality() != Parameter;
        for (unknown, (expected, rounding)) in unknowns.iter().zip(differences(fmu, &unknowns, known)) {
            let found = fmu.partial(*unknown, known);
            let names = [*unknown, known].map(|vr| TABLE[vr as usize].name());
            assert!(
                (found - expected).abs() <= 1e-6 * expected.abs() + rounding,
                "{label}, {mode}: {names:?}: {found}, differences give {expected}"
            );
            assert!(!is_listed || found == 0.0 || declares(*unknown, known), "{label}, {mode}: {names:?}");
        }
    }
}

/// Checks derivatives before the first step and between steps of different sizes: with no new motor angle, with one, and
/// with both after the state is restored in another instance. The end of the simulation must not change the derivatives.
fn co_simulation<F: Either>(use_omega: bool, at_rest: bool, with_rates: bool) {
    let label = format!("use_omega {use_omega}, start_at_rest {at_rest}, derivatives {with_rates}");
    let p = parameters(7);
    let (mut random, jacobian) = (Random(8), jacobian(&p));
    let mut fmu = F::in_mode::<TestbedFmu>(CoSimulation, Instantiated);
    set_parameters(&fmu, &p);
    fmu.ok(fmu.set_boolean(vr(Name::use_omega), use_omega.into()));
    start_at(&fmu, [0.1, -0.2, 0.3, 0.4, -1.0, 2.0]);
    fmu.ok(fmu.set_boolean(vr(Name::start_at_rest), at_rest.into()));
    fmu.enter_initialization(0.0, None);
    let mut draw = || [(); 4].map(|()| random.between(-1.0, 1.0));
    fmu.set(&INPUTS, &draw());
    fit_differences(&fmu, Initialization, false, &label);
    fmu.ok(fmu.exit_initialization_mode());
    let mut time = 0.0;
    for (step, size) in [0.001, 0.003, 0.002, 0.002, 0.004].into_iter().enumerate() {
        let label = format!("{label}, after {step} steps");
        let fits = |fmu: &F| fit_differences(fmu, StepComplete, step > 0, &label);
        fits(&fmu);
        fmu.set(&INPUTS[..1], &draw()[..1]);
        fits(&fmu);
        fmu.set(&INPUTS, &draw());
        if with_rates {
            fmu.set_input_derivatives(&THETA, &draw()[..2]);
        }
        let restored = F::in_mode::<TestbedFmu>(CoSimulation, Instantiated);
        restored.restore(&fmu.bytes());
        fmu = restored;
        fits(&fmu);
        for (row, unknown) in LINEAR.into_iter().enumerate() {
            for (column, state) in STATES.into_iter().enumerate() {
                let (found, expected) = (fmu.partial(unknown, state), jacobian[(row, column)]);
                assert!((found - expected).abs() <= 1e-13 * expected.abs(), "{label}: {found} {expected}");
            }
        }
        fmu.step(time, size);
        time += size;
    }
    let all = |fmu: &F| {
        let of = |unknown| INPUTS.map(|known| fmu.partial(unknown, known));
        unknowns().into_iter().map(of).collect::<Vec<_>>()
    };
    let before = all(&fmu);
    fmu.ok(fmu.terminate());
    assert_eq!(all(&fmu), before, "{label}, terminated");
}

/// Checks derivatives in Model Exchange, first while the states depend on their start values, then after the start.
fn model_exchange<F: Either>(use_omega: bool, at_rest: bool) {
    let label = format!("use_omega {use_omega}, start_at_rest {at_rest}");
    let mut random = Random(9);
    let mut draw = || [(); 6].map(|()| random.between(-1.0, 1.0));
    let fmu = F::in_mode::<TestbedFmu>(ModelExchange, Initialization);
    set_parameters(&fmu, &parameters(10));
    fmu.ok(fmu.set_boolean(vr(Name::use_omega), use_omega.into()));
    start_at(&fmu, draw());
    fmu.ok(fmu.set_boolean(vr(Name::start_at_rest), at_rest.into()));
    fmu.set(&INPUTS, &draw()[..4]);
    fit_differences(&fmu, Initialization, false, &label);
    fmu.ok(fmu.exit_initialization_mode());
    fit_differences(&fmu, Event, false, &label);
    fmu.enter_continuous_time();
    fit_differences(&fmu, ContinuousTime, true, &label);
    fmu.ok(fmu.set_states(draw().as_ptr(), 6));
    fmu.set(&INPUTS, &draw()[..4]);
    fit_differences(&fmu, ContinuousTime, true, &label);
    fmu.ok(fmu.enter_event_mode());
    fit_differences(&fmu, Event, true, &label);
}

/// Checks both interface types in both FMI versions. In FMI 3.0, the test kit also compares the adjoint derivatives.
#[test]
fn every_pair_fits_differences() {
    for [use_omega, at_rest] in [[false, false], [false, true], [true, false], [true, true]] {
        for with_rates in [false, true] {
            co_simulation::<Fmu>(use_omega, at_rest, with_rates);
        }
        co_simulation::<fmi3::Importer>(use_omega, at_rest, false);
        model_exchange::<Fmu>(use_omega, at_rest);
        model_exchange::<fmi3::Importer>(use_omega, at_rest);
    }
}

const THETA: [u32; 2] = [vr(Name::theta1), vr(Name::theta2)];
const OMEGA: [u32; 2] = [vr(Name::omega1), vr(Name::omega2)];

/// Where the motor rates come from.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Rates {
    Samples,
    Omega,
    Derivatives,
}

/// Checks output derivatives right after the initialization and after each step. The samples are the angles at the end of
/// the last step, so the motors do not jump. If rates are estimated from samples, the third sample differs and is not checked.
#[test]
fn output_derivatives_are_exact() {
    for rates in [Rates::Samples, Rates::Omega, Rates::Derivatives] {
        let p = parameters(9);
        let fmu = new(CoSimulation);
        set_parameters(&fmu, &p);
        fmu.ok(fmu.fmi2SetBoolean(&vr(Name::use_omega), 1, &i32::from(rates == Rates::Omega)));
        start_at(&fmu, [0.1, -0.2, 0.3, 0.4, -1.0, 2.0]);
        fmu.initialize(0.0);
        let mut random = Random(10);
        let (mut time, mut theta) = (0.0, [0.2, -0.1]);
        for step in 0..8 {
            fmu.set(&THETA, &theta);
            let given = [random.between(-2.0, 2.0), random.between(-2.0, 2.0)];
            fmu.set(&OMEGA, &given);
            if rates == Rates::Derivatives {
                fmu.set_input_derivatives(&THETA, &given);
            }
            if rates == Rates::Samples && step == 2 {
                // Changes the slope, so that the motors have an acceleration from here on.
                theta[0] += 0.01;
                fmu.set(&THETA, &theta);
            } else {
                output_derivatives_fit_steps::<TestbedFmu>(
                    &fmu,
                    time,
                    &format!("{rates:?}, step {step}"),
                    |_| (),
                );
            }
            let slopes = fmu.rates(THETA);
            if rates != Rates::Samples {
                assert_eq!(slopes, given);
                assert_eq!(fmu.rates(OMEGA), [0.0; 2]);
            }
            let h = random.between(0.005, 0.03);
            fmu.step(time, h);
            time += h;
            theta = std::array::from_fn(|motor| theta[motor] + slopes[motor] * h);
        }
    }
}

/// Checks that the derivative of omega, if it is estimated from samples, is the second derivative of the parabola through
/// the last three.
#[test]
fn acceleration_of_samples() {
    let fmu = in_mode(CoSimulation, StepComplete);
    for i in 0..6 {
        let t = f64::from(i) * 0.02;
        fmu.set(&THETA, &[3.0 * t * t, 1.0 - t * t]);
        if i >= 2 {
            let [one, two] = fmu.rates(OMEGA);
            assert!((one - 6.0).abs() < 1e-9 && (two + 2.0).abs() < 1e-9, "{one}, {two}");
        }
        fmu.step(t, 0.02);
    }
}
