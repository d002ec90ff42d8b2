//! Checks that steps stay fast after incidents such as a rejected call, a reset or a restored state.
//!
//! The reference is the model itself, stepped without FMI. It is never copied or restored, so it keeps everything that makes
//! it fast, such as cached matrices of its step sizes. Only steps of repeated sizes are compared, because an instance may
//! need longer for the first step of a new size.

use crate::checks::start_of;
use crate::{Either, Importer, fmi3, instructions};
use fmu_export::Interface::CoSimulation;
use fmu_export::{Experiment, Exported, Setup, Status, Step};
use std::ptr::null_mut;

/// Step sizes of a round of two steps, relative to the default step size of the model.
const ALTERNATING: [f64; 2] = [1.0, 0.75];
const STEADY: [f64; 2] = [1.0; 2];

/// Performs the steps of a round; returns the time after it.
fn round(sizes: [f64; 2], unit: f64, mut time: f64, step: &mut dyn FnMut(f64, f64)) -> f64 {
    for size in sizes {
        step(time, size * unit);
        time += size * unit;
    }
    time
}

/// Counts the instructions of a round, after two rounds of the same sizes that are not counted.
fn cost(sizes: [f64; 2], unit: f64, time: &mut f64, step: &mut dyn FnMut(f64, f64)) -> Option<u64> {
    for _ in 0..2 {
        *time = round(sizes, unit, *time, step);
    }
    instructions(&mut || _ = round(sizes, unit, *time, step))
}

/// Returns the instructions of a steady and of an alternating round of the model itself.
fn costs_of_model<M: Exported>() -> Option<[u64; 2]> {
    let mut model = M::new(&Setup::new(CoSimulation)).expect("a model");
    model.calculate_start();
    model.initialize(&Experiment::default()).expect("an initial state");
    let mut step = |time: f64, size: f64| {
        if !model.exported_step_fast(size) && !model.exported_step_any_size(size) {
            model.exported_step(Step::new(time, size)).expect("a step");
            model.calculate(time + size);
        }
    };
    let (unit, mut time) = (M::INFO.default_experiment.step_size, 0.0);
    let costs = [STEADY, ALTERNATING].map(|sizes| cost(sizes, unit, &mut time, &mut step));
    Some([costs[0]?, costs[1]?])
}

/// A label and calls at a communication point, whose time is the last argument.
type Incident<'a, F> = (&'static str, &'a dyn Fn(&mut F, f64));

/// Calls `check` with each incident after which steps must stay fast.
fn incidents<F: Either, M: Exported>(check: &mut dyn FnMut(Incident<'_, F>)) {
    let parameter = (0..).zip(M::TABLE).find_map(|(index, of)| Some((index, start_of(of)?)));
    check(("nothing", &|_, _| ()));
    if let Some((index, start)) = parameter {
        check(("a parameter is changed twice", &|fmu, _| {
            fmu.set(&[index], &[start * 1.01]);
            fmu.set(&[index], &[start]);
        }));
        check(("a parameter is rejected", &|fmu, _| {
            assert_eq!(fmu.try_set(&[index], &[f64::NAN]), Status::Error);
        }));
        check(("another parameter is saved, and restored", &|fmu, _| {
            let state = fmu.save();
            fmu.set(&[index], &[start * 1.01]);
            fmu.ok(fmu.set_state(state));
            fmu.forget(state);
        }));
    }
    check(("a step is rejected", &|fmu, time| assert_eq!(fmu.try_step(time, -1.0), Status::Error)));
    check(("a state is restored", &|fmu, _| {
        let state = fmu.save();
        fmu.ok(fmu.set_state(state));
        fmu.forget(state);
    }));
    check(("a state is de-serialized", &|fmu, _| {
        let (bytes, mut state) = (fmu.bytes(), null_mut());
        fmu.ok(fmu.deserialize(bytes.as_ptr(), bytes.len(), &mut state));
        fmu.ok(fmu.set_state(state));
        fmu.forget(state);
    }));
    check(("a copy in another instance", &|fmu, _| {
        let other = F::new::<M>(CoSimulation);
        other.restore(&fmu.bytes());
        *fmu = other;
    }));
    check(("a reset", &|fmu, time| {
        fmu.ok(fmu.reset());
        fmu.initialize(time);
    }));
}

/// Checks that steps of an instance cost about as much as steps of the model itself, after each of the incidents. Does
/// nothing where instructions cannot be counted.
///
/// The calls through FMI have a cost, too. It is measured as the difference between an instance and the model in steps of
/// one size.
///
/// # Panics
/// Panics if a round of alternating sizes takes more instructions than 1.3 times the sum for the model and the calls.
pub fn steps_stay_cheap<M: Exported>() {
    if let Some([steady, alternating]) = costs_of_model::<M>() {
        of_instances::<Importer, M>(steady, alternating, usize::MAX);
        // Both FMI versions share most of the code, so two incidents suffice in FMI 3.0.
        of_instances::<fmi3::Importer, M>(steady, alternating, 2);
    }
}

/// Checks the first `most_incidents` incidents in an FMI version.
fn of_instances<F: Either, M: Exported>(steady_model: u64, alternating_model: u64, most_incidents: usize) {
    let unit = M::INFO.default_experiment.step_size;
    let cost = |fmu: &F, sizes, time: &mut f64| {
        cost(sizes, unit, time, &mut |time, size| fmu.step(time, size)).unwrap_or_default()
    };
    let of_calls = cost(&F::initialized_at::<M>(0.0), STEADY, &mut 0.0).saturating_sub(steady_model);
    let allowed = 1.3 * (alternating_model + of_calls) as f64;
    let mut count = 0;
    incidents::<F, M>(&mut |(label, happens)| {
        count += 1;
        if count > most_incidents {
            return;
        }
        let (mut fmu, mut time) = (F::initialized_at::<M>(0.0), 0.0);
        for _ in 0..2 {
            time = round(ALTERNATING, unit, time, &mut |time, size| fmu.step(time, size));
        }
        happens(&mut fmu, time);
        fmu.take_log();
        let alternating = cost(&fmu, ALTERNATING, &mut time);
        assert!(
            (alternating as f64) < allowed,
            "{label}: two steps take {alternating} instructions; the model itself takes {alternating_model}, and the calls \
             take {of_calls}"
        );
    });
}
