//! Model Exchange with events, called like an importer with an integrator (section 3.2.2, and the pseudocode
//! in section 3.2.4).

use crate::models::{Ball, Counter, Oscillator, ball, counter};
use fmu_export::Exported;
use fmu_export::Interface::ModelExchange;
use fmu_export::Mode::*;
use fmu_export::fmi2::types::*;
use fmu_test_kit::{Either, Importer, Updated};

/// A minimal importer: Euler steps, halved until they locate a state event.
struct Master {
    fmu: Importer,
    states: usize,
    indicators: usize,
    time: f64,
    /// Combined results of the last event iterations.
    said: Updated,
    /// Times and kinds of the events.
    events: Vec<(f64, &'static str)>,
}

impl Master {
    fn new<M: Exported>(prepare: impl FnOnce(&Importer)) -> Self {
        let fmu = Importer::of::<M>(ModelExchange);
        prepare(&fmu);
        fmu.initialize(0.0);
        let said = fmu.enter_continuous_time();
        let indicators = M::MODEL_EXCHANGE.map_or(0, |offer| offer.indicators);
        Self { fmu, states: M::STATES.len(), indicators, time: 0.0, said, events: Vec::new() }
    }

    fn vector(&self, count: usize, get: impl FnOnce(*mut f64, usize) -> Status) -> Vec<f64> {
        let mut values = vec![f64::NAN; count];
        self.fmu.ok(get(values.as_mut_ptr(), count));
        values
    }

    fn states(&self) -> Vec<f64> {
        self.vector(self.states, |x, count| self.fmu.fmi2GetContinuousStates(x, count))
    }

    fn indicators(&self) -> Vec<f64> {
        self.vector(self.indicators, |z, count| self.fmu.fmi2GetEventIndicators(z, count))
    }

    fn go_to(&self, time: f64, x: &[f64]) {
        self.fmu.ok(self.fmu.fmi2SetTime(time));
        self.fmu.ok(self.fmu.fmi2SetContinuousStates(x.as_ptr(), x.len()));
    }

    /// Integrates to this time or to an earlier event. Returns false when the model ends the simulation.
    fn step(&mut self, h: f64) -> bool {
        let (start, x) = (self.time, self.states());
        let rates = self.vector(self.states, |rates, count| self.fmu.fmi2GetDerivatives(rates, count));
        let before = self.indicators();
        let time_event = self.said.next.filter(|next| *next <= start + h);
        let end = time_event.unwrap_or(start + h);
        // Exact for the ball's velocity; the height uses the mean of both velocities.
        let at = |time: f64| -> Vec<f64> {
            let h = time - start;
            let bend = if self.states == 2 { 0.5 * h * h * rates[1] } else { 0.0 };
            x.iter()
                .zip(&rates)
                .enumerate()
                .map(|(i, (x, rate))| x + h * rate + if i == 0 { bend } else { 0.0 })
                .collect()
        };
        let crossed = |time: f64| {
            self.go_to(time, &at(time));
            let after = self.indicators();
            before.iter().zip(&after).any(|(before, after)| (*before > 0.0) != (*after > 0.0))
        };
        let mut reached = end;
        let state_event = crossed(end);
        if state_event {
            let (mut low, mut high) = (start, end);
            while high - low > 1e-12 {
                let middle = 0.5 * (low + high);
                if crossed(middle) { high = middle } else { low = middle }
            }
            reached = high;
            self.go_to(reached, &at(reached));
        }
        self.time = reached;
        let [asked, terminate] = self.fmu.completed_step();
        if terminate {
            return false;
        }
        let time_event = time_event == Some(reached);
        if !state_event && !time_event && !asked {
            return true;
        }
        self.fmu.ok(self.fmu.fmi2EnterEventMode());
        self.said = self.fmu.enter_continuous_time();
        // A ball that rises through the floor changes the sign of the indicator without a bounce.
        let happened = time_event || self.said.states_changed;
        if happened {
            self.events.push((reached, if time_event { "time" } else { "state" }));
        }
        !self.said.terminate
    }
}

/// Checks the times of the bounces: those of free fall, each flight shorter by the restitution. After enough
/// bounces the ball ends the simulation.
#[test]
fn state_events() {
    let mut master = Master::new::<Ball>(|_| ());
    let mut nominals = [0.0; 2];
    while master.step(0.05) {
        if master.said.nominals_changed {
            assert!(master.said.states_changed);
            let before = nominals[0];
            master.fmu.ok(master.fmu.fmi2GetNominalsOfContinuousStates(nominals.as_mut_ptr(), 2));
            assert!(nominals[0] > 0.0 && (before == 0.0 || nominals[0] <= before), "{nominals:?}");
            master.said.nominals_changed = false;
        }
    }
    assert_eq!(master.events.len(), 5);
    let fall = (2.0_f64 / 9.81).sqrt();
    let mut expected = fall;
    let mut flight = 2.0 * fall;
    for (time, kind) in &master.events {
        assert_eq!(*kind, "state");
        assert!((time - expected).abs() < 1e-9, "{time} instead of {expected}");
        flight *= 0.7;
        expected += flight;
    }
    let mut bounces = 0;
    master.fmu.ok(master.fmu.fmi2GetInteger(&(ball::Name::bounces as u32), 1, &mut bounces));
    assert_eq!(bounces, 5);
    // The height of each flight is the previous height times restitution^2.
    assert!((nominals[0] - 0.49_f64.powi(4)).abs() < 1e-6, "{nominals:?}");
}

/// The model is informed after each step of the integrator. It detects a missed event, and a lost ball.
#[test]
fn completed_steps() {
    let fmu = Importer::in_mode::<Ball>(ModelExchange, ContinuousTime);
    for (x, expected) in
        [([1.0, -1.0], [0, 0]), ([-0.5, -1.0], [1, 0]), ([-0.5, 1.0], [0, 0]), ([-200.0, -1.0], [1, 1])]
    {
        for no_set_state_prior in [0, 1] {
            let mut found = [-1; 2];
            let [event, terminate] = &mut found;
            fmu.ok(fmu.fmi2SetContinuousStates(x.as_ptr(), 2));
            fmu.ok(fmu.fmi2CompletedIntegratorStep(no_set_state_prior, event, terminate));
            assert_eq!(found, expected, "{x:?}");
        }
    }
    // A model without STEP_COMPLETED is not informed.
    let fmu = Importer::in_mode::<Oscillator>(ModelExchange, ContinuousTime);
    let mut found = [-1; 2];
    let [event, terminate] = &mut found;
    fmu.ok(fmu.fmi2CompletedIntegratorStep(1, event, terminate));
    assert_eq!(found, [0, 0]);
}

fn integers<const N: usize>(fmu: &Importer, names: [counter::Name; N]) -> [i32; N] {
    let mut values = [i32::MIN; N];
    fmu.ok(fmu.fmi2GetInteger(names.map(|name| name as u32).as_ptr(), N, values.as_mut_ptr()));
    values
}

fn prepare_counter(fmu: &Importer) {
    let integers = [counter::Name::increment as u32, counter::Name::full as u32];
    fmu.ok(fmu.fmi2SetInteger(integers.as_ptr(), 2, [7, 10].as_ptr()));
    fmu.ok(fmu.fmi2SetBoolean(&(counter::Name::on as u32), 1, &fmi2True));
    fmu.set(&[counter::Name::period as u32, counter::Name::weight as u32], &[0.25, 0.5]);
}

/// Checks that time events happen at the requested times for any integrator steps.
#[test]
fn time_events() {
    use counter::Name::*;
    for h in [0.01, 0.1, 1.0] {
        let mut master = Master::new::<Counter>(prepare_counter);
        assert_eq!(master.said.next, Some(0.25));
        while master.events.len() < 4 {
            assert!(master.step(h));
        }
        assert_eq!(master.events, [0.25, 0.5, 0.75, 1.0].map(|time| (time, "time")), "steps of {h}");
        // 4 times 7, with two carries.
        assert_eq!(integers(&master.fmu, [count, carries]), [8, 2]);
        assert_eq!(master.fmu.get([sum as u32]), [14.0]);
        let mut is_odd = -1;
        master.fmu.ok(master.fmu.fmi2GetBoolean(&(odd as u32), 1, &mut is_odd));
        assert_eq!(is_odd, fmi2False);
    }
}

/// Checks that an event that causes another at the same time needs one more iteration, and that the full
/// count is visible in between.
#[test]
fn event_iteration() {
    let fmu = Importer::of::<Counter>(ModelExchange);
    prepare_counter(&fmu);
    fmu.initialize(0.0);
    let round = || -> (u8, f64, i32) {
        let Updated { again, next, .. } = fmu.update();
        (again.into(), next.unwrap(), integers(&fmu, [counter::Name::count])[0])
    };
    assert_eq!(round(), (0, 0.25, 0), "nothing is due at the begin");
    // After two periods, both counts are due, and the second one fills the count.
    fmu.ok(fmu.fmi2EnterContinuousTimeMode());
    fmu.ok(fmu.fmi2SetTime(0.5));
    fmu.ok(fmu.fmi2EnterEventMode());
    assert_eq!(round(), (1, 0.5, 7));
    assert_eq!(round(), (1, 0.75, 14));
    assert_eq!(round(), (0, 0.75, 4));
    assert_eq!(round(), (0, 0.75, 4), "an importer may ask once more");
}

/// Checks that a failed step or event changes nothing: the model steps on a copy, and the crate undoes a
/// failed event.
#[test]
fn failing_events_and_steps_change_nothing() {
    use fmu_export::Interface::CoSimulation;
    for interface in [CoSimulation, ModelExchange] {
        let fmu = Importer::of::<Counter>(interface);
        prepare_counter(&fmu);
        fmu.set(&[counter::Name::weight as u32], &[f64::MAX]);
        fmu.initialize(0.0);
        let message = if interface == CoSimulation {
            fmu.refused("step", |fmu| fmu.try_step(0.0, 1.0))
        } else {
            fmu.ok(fmu.fmi2SetTime(1.0));
            fmu.refused("event", |fmu| fmu.fmi2NewDiscreteStates(&mut Default::default()))
        };
        assert!(message.contains("range of numbers"), "{message}");
    }
}

/// Checks that Co-Simulation gives equal counts at the communication points for any step size.
#[test]
fn the_same_in_co_simulation() {
    use counter::Name::*;
    for steps in [1, 4, 16] {
        let fmu = Importer::of::<Counter>(fmu_export::Interface::CoSimulation);
        prepare_counter(&fmu);
        fmu.initialize(0.0);
        let h = 1.0 / f64::from(steps);
        (0..steps).for_each(|step| fmu.step(f64::from(step) * h, h));
        assert_eq!(integers(&fmu, [count, carries]), [8, 2], "{steps} steps");
        assert_eq!(fmu.get([sum as u32]), [14.0]);
    }
}
