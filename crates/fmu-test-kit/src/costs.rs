//! An instance with a past steps as fast as the model itself.
//!
//! The reference is the model without an instance: nothing has copied it, so it has everything that makes it fast, such as
//! a cache of step sizes. Steps are compared when their sizes repeat; an instance may prepare for a new size once.

use crate::checks::start_of;
use crate::{Either, Importer, fmi3, instructions};
use fmu_export::Interface::CoSimulation;
use fmu_export::{Experiment, Exported, Setup, Status, Step};
use std::ptr::null_mut;

/// Step sizes of a round, relative to the default step size.
const ALTERNATING: [f64; 2] = [1.0, 0.75];
const STEADY: [f64; 2] = [1.0; 2];

/// Makes the steps of a round; returns the time after it.
fn round(sizes: [f64; 2], unit: f64, mut time: f64, step: &mut dyn FnMut(f64, f64)) -> f64 {
    for size in sizes {
        step(time, size * unit);
        time += size * unit;
    }
    time
}

/// Counts the instructions of a round after two equal rounds.
fn cost(sizes: [f64; 2], unit: f64, time: &mut f64, step: &mut dyn FnMut(f64, f64)) -> Option<u64> {
    for _ in 0..2 {
        *time = round(sizes, unit, *time, step);
    }
    instructions(&mut || _ = round(sizes, unit, *time, step))
}

/// Returns the costs of a steady and of an alternating round of the model itself.
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

/// Something that happens to an instance at a communication point.
type Happens<'a, F> = (&'static str, &'a dyn Fn(&mut F, f64));

fn events<F: Either, M: Exported>(check: &mut dyn FnMut(Happens<'_, F>)) {
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
    check(("another instance continues", &|fmu, _| {
        let other = F::new::<M>(CoSimulation);
        other.restore(&fmu.bytes());
        *fmu = other;
    }));
    check(("a reset", &|fmu, time| {
        fmu.ok(fmu.reset());
        fmu.initialize(time);
    }));
}

/// Checks that steps of an instance cost as much as steps of the model, after anything that may happen to it. Does
/// nothing where instructions cannot be counted.
///
/// # Panics
/// Panics if steps of alternating sizes cost more than 1.3 times as much as the same steps of the model without FMI, after
/// the cost of the calls in steps of one size is added.
pub fn steps_stay_cheap<M: Exported>() {
    if let Some([steady, alternating]) = costs_of_model::<M>() {
        of_instances::<Importer, M>(steady, alternating, usize::MAX);
        // Both FMI versions share the code of these events.
        of_instances::<fmi3::Importer, M>(steady, alternating, 2);
    }
}

fn of_instances<F: Either, M: Exported>(steady_model: u64, alternating_model: u64, most_events: usize) {
    let unit = M::INFO.default_experiment.step_size;
    let cost = |fmu: &F, sizes, time: &mut f64| {
        cost(sizes, unit, time, &mut |time, size| fmu.step(time, size)).unwrap_or_default()
    };
    let of_calls = cost(&F::initialized_at::<M>(0.0), STEADY, &mut 0.0).saturating_sub(steady_model);
    let allowed = 1.3 * (alternating_model + of_calls) as f64;
    let mut count = 0;
    events::<F, M>(&mut |(label, happens)| {
        count += 1;
        if count > most_events {
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
