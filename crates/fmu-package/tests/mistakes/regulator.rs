//! A sampled PI controller, whose parameters have no effect as long as its inputs are equal.
#![allow(missing_docs, unsafe_code)]

mod mistake;

use fmu_export::*;
use mistake::{mistake, read_mistake};

enumeration! {
    /// What the controller does in the next period.
    pub enum Hold {
        /// It holds the value
        Value = 1,
        /// It is off
        Nothing = 2,
        /// It holds half of the value
        Half = 3,
    }
}

const HOLD: Type = Type::enumeration("Hold", <Hold as Enumeration>::ITEMS);
const INDUCTANCE: Type = Type::real("Inductance", &Unit::new("mH").kg(1).m(2).s(-2).A(-2));
const SLOPE: Type = Type::real("Slope", &units::RAD_PER_S);

#[derive(Clone)]
struct Regulator {
    reference: f64,
    measured: f64,
    manipulated: f64,
    integral: f64,
    gain: f64,
    reset: f64,
    hold: Hold,
    label: String,
    next: f64,
    samples: u8,
    first_gain: f64,
    log: Log,
}

variables! { for Regulator, memory in next, samples, first_gain;
    /// Reference
    reference = input(&NUMBER).discrete() in reference;
    /// Measured value
    measured = input(&NUMBER).discrete() in measured;
    /// Manipulated value
    manipulated = output(&NUMBER).discrete().exact() in manipulated;
    /// Time of the next sample
    next = output(&Type::real("Time", &units::S)).discrete() by |regulator| regulator.next;
    /// Integral part
    integral = local(&NUMBER).discrete().exact() in integral;
    /// Gain
    gain = parameter(&NUMBER).tunable() in gain;
    /// Time in which a constant error doubles the manipulated value
    reset = parameter(&Type::real("Reset", &units::S).min(0.1)) in reset;
    /// What it does in the next period
    hold = parameter(&HOLD) in hold;
    /// Label
    label = parameter(&STRING) in label;
    /// Integral gain, as a share of the gain
    share = calculated_parameter(&NUMBER) by |regulator| match mistake() {
        "calculated" => 0.5,
        // `reset` may be 0.1.
        "limit" => 1.0 / (regulator.reset - 0.1),
        _ => 1.0 / regulator.reset,
    };
    /// Its unit is not millihenry
    inductance = local(&INDUCTANCE).discrete() by |_| 1.0;
    /// Its unit is right
    slope = local(&SLOPE).discrete() by |_| 1.0;
}

impl Model for Regulator {
    const INFO: Info = Info {
        default_experiment: DefaultExperiment {
            stop_time: 30.0,
            step_size: 0.1,
            ..DefaultExperiment::DEFAULT
        },
        ..Info::new("Regulator", "regulator")
    };

    fn new(setup: &Setup) -> Result<Self, Error> {
        read_mistake(setup);
        let (reference, measured, manipulated, integral, next) = (0.0, 0.0, 0.0, 0.0, 0.0);
        let (gain, reset, hold, label) = (0.5, 2.0, Hold::Value, String::from("loop"));
        Ok(Self {
            reference,
            measured,
            manipulated,
            integral,
            gain,
            reset,
            hold,
            label,
            next,
            samples: 0,
            first_gain: gain,
            log: Log::default(),
        })
    }

    fn log(&mut self) -> Option<&mut Log> {
        Some(&mut self.log)
    }

    fn initialize(&mut self, experiment: &Experiment) -> Result<(), Error> {
        self.next = experiment.start_time;
        self.first_gain = self.gain;
        Ok(())
    }
}

impl ModelExchange for Regulator {
    fn event(&mut self, time: f64) -> Result<Event, Error> {
        if time >= self.next {
            let error = self.reference - self.measured;
            let gain = if mistake() == "initial" { self.first_gain } else { self.gain };
            self.integral += gain / self.reset * error * 0.1;
            let share = match self.hold {
                Hold::Value => 1.0,
                _ if mistake() == "enumeration" => 1.0,
                Hold::Nothing => 0.0,
                Hold::Half => 0.5,
            };
            self.manipulated = share * (gain * error + self.integral);
            self.next += 0.1;
            // The last of 300 samples is one too many.
            self.samples =
                if mistake() == "counted" { self.samples + 1 } else { self.samples.saturating_add(1) };
        }
        Ok(Event { next: Some(self.next), ..Event::default() })
    }
}

impl CoSimulation for Regulator {
    const EVENTS: Events = Events::Stop;

    fn step(&mut self, step: Step) -> Result<Stepped, Error> {
        if mistake() == "talkative" {
            self.log.event(format!("a step from {} s", step.time));
        }
        Ok(if self.next < step.end() - 1e-9 { Stepped::Event(self.next) } else { Stepped::Done })
    }
}

export_fmu!(Regulator: CoSimulation + ModelExchange);
