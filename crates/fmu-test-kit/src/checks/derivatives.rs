//! Checks of derivatives: with respect to variables (section 2.1.9 of FMI 2.0) and to time (4.2.1).

use super::*;
use crate::{Importer, Random};
use fmu_export::Interface::{CoSimulation, ModelExchange};
use fmu_export::Mode::*;

/// Checks several unknowns and knowns at once, in any order and repeated: the result is a matrix product.
pub fn several_at_once<M: Exported>() {
    let mut random = Random(1);
    let fmu = Importer::in_mode::<M>(ModelExchange, ContinuousTime);
    let unknowns = places::<M>(|of| {
        is_real(of) && (of.causality() == Causality::Output || of.differentiates().is_some())
    });
    let knowns = places::<M>(|of| is_real(of) && (of.causality() == Causality::Input || of.is_state()));
    fmu.set(&knowns, &knowns.iter().map(|_| random.between(-1.0, 1.0)).collect::<Vec<_>>());
    let columns: Vec<_> = knowns.iter().map(|known| fmu.directional(&unknowns, &[*known], &[1.0])).collect();
    for _ in 0..50 {
        let seed: Vec<_> = knowns.iter().map(|_| random.between(-1.0, 1.0)).collect();
        let found = fmu.directional(&unknowns, &knowns, &seed);
        for (i, found) in found.iter().enumerate() {
            let terms = columns.iter().zip(&seed).map(|(column, seed)| column[i] * seed);
            let scale = 1.0 + columns.iter().map(|column| column[i].abs()).sum::<f64>();
            let expected: f64 = terms.sum();
            let name = M::TABLE[unknowns[i] as usize].name();
            assert!((found - expected).abs() < 1e-14 * scale, "{name}: {found} is not {expected}");
        }
    }
    let (first, last) = (knowns[0], knowns[knowns.len() - 1]);
    let unknown = [unknowns[unknowns.len() - 1], unknowns[0], unknowns[unknowns.len() - 1]];
    let found = fmu.directional(&unknown, &[first, last, first], &[2.0, 0.0, -1.0]);
    assert_eq!(found, fmu.directional(&unknown, &[first], &[1.0]));
    assert_eq!(found[0], found[2]);
    let none = fmu.directional(&unknowns, &[], &[]);
    assert!(none.iter().all(|sum| *sum == 0.0), "without knowns the sum is empty");
}

/// Compares time derivatives of order 1 with finite differences over short steps, each from the same saved
/// state. `go_on` sets the inputs as a function of time.
#[track_caller]
pub fn output_derivatives_fit_steps<M: Exported>(
    fmu: &Importer,
    time: f64,
    label: &str,
    go_on: impl Fn(f64),
) {
    const H: f64 = 5e-5;
    let moving = moving::<M>();
    let found: Vec<_> = moving.iter().map(|place| fmu.rate(*place)).collect();
    let state = fmu.save();
    let y = [0.0, 1.0, 2.0, 3.0, 4.0].map(|steps| {
        fmu.ok(fmu.set_state(state));
        if steps > 0.0 {
            fmu.step(time, H * steps);
            go_on(H * steps);
        }
        fmu.read(&moving)
    });
    fmu.ok(fmu.set_state(state));
    fmu.forget(state);
    for (i, place) in moving.iter().enumerate() {
        let expected =
            (-25.0 * y[0][i] + 48.0 * y[1][i] - 36.0 * y[2][i] + 16.0 * y[3][i] - 3.0 * y[4][i]) / (12.0 * H);
        // Tolerance for the rounding error of the difference and the truncation error of the series.
        let tolerance = 1e-7 * (1.0 + y[0][i].abs() + expected.abs());
        let name = M::TABLE[*place as usize].name();
        assert!((found[i] - expected).abs() < tolerance, "{label}: {name}' is {expected}, not {}", found[i]);
    }
}

/// Checks output derivatives right after the initialization and after each step, with given input
/// derivatives.
pub fn output_derivatives_are_exact<M: Exported>() {
    let (fmu, inputs) = (Importer::of::<M>(CoSimulation), inputs::<M>());
    fmu.initialize(0.0);
    let (mut random, mut time) = (Random(10), 0.0);
    let mut values = vec![0.1; inputs.len()];
    for step in 0..8 {
        let slopes: Vec<_> = inputs.iter().map(|_| random.between(-2.0, 2.0)).collect();
        fmu.set(&inputs, &values);
        fmu.give_rates(&inputs, &slopes);
        // An input whose derivative the model ignores is constant.
        let slopes: Vec<_> = inputs.iter().map(|place| fmu.rate(*place)).collect();
        let after =
            |h: f64| values.iter().zip(&slopes).map(|(value, slope)| value + slope * h).collect::<Vec<_>>();
        output_derivatives_fit_steps::<M>(&fmu, time, &format!("step {step}"), |h| {
            fmu.set(&inputs, &after(h));
            fmu.give_rates(&inputs, &slopes);
        });
        let h = random.between(0.005, 0.03);
        fmu.step(time, h);
        values = after(h);
        time += h;
    }
}

/// Checks that every Real variable has a derivative, 0 for parameters. The highest order of the model is 1;
/// higher orders are errors (section 4.3.1).
pub fn derivatives_of_every_variable_and_order<M: Exported>() {
    let fmu = Importer::in_mode::<M>(CoSimulation, StepComplete);
    fmu.set(&inputs::<M>(), &signals::<M>(0.2));
    fmu.step(0.0, 0.05);
    for place in places::<M>(is_real) {
        let (variable, rate) = (&M::TABLE[place as usize], fmu.rate(place));
        assert!(rate.is_finite() && (variable.causality() != Causality::Parameter || rate == 0.0));
        for order in [2, 3, i32::MAX, 0, -1, i32::MIN] {
            let message =
                fmu.refused("the order", |fmu| fmu.fmi2GetRealOutputDerivatives(&place, 1, &order, &mut 0.0));
            let limit = if order > 0 { "at most 1 (maxOutputDerivativeOrder)" } else { "at least 1" };
            let expected = format!("the derivative of {} must be {limit}, it is {order}", variable.name());
            assert!(message.contains(&expected), "{message}");
        }
    }
}
