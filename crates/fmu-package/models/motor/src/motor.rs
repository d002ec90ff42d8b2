//! A motor whose voltage is switched on and off at times that are known in advance (time events).

use fmu_export::*;

const VOLTAGE: Type = Type::real("Voltage", &Unit::new("V").kg(1).m(2).s(-3).A(-1)).min(0.0);
const CURRENT: Type = Type::real("Current", &Unit::new("A").A(1)).nominal(10.0);
const CURRENT_RATE: Type = Type::real("CurrentRate", &Unit::new("A/s").A(1).s(-1));
const SPEED: Type = Type::real("AngularVelocity", &units::RAD_PER_S).nominal(100.0);
const ACCELERATION: Type = Type::real("AngularAcceleration", &units::RAD_PER_S2);
const TORQUE: Type = Type::real("Torque", &units::N_M);
const RESISTANCE: Type =
    Type::real("Resistance", &Unit::new("Ohm").kg(1).m(2).s(-3).A(-2)).min(1e-3).max(1e3);
const INDUCTANCE: Type = Type::real("Inductance", &Unit::new("H").kg(1).m(2).s(-2).A(-2)).min(1e-5).max(1.0);
const CONSTANT: Type =
    Type::real("MotorConstant", &Unit::new("N.m/A").kg(1).m(2).s(-2).A(-1)).min(1e-4).max(10.0);
const INERTIA: Type = Type::real("Inertia", &units::KG_M2).min(1e-6).max(1e3);
const PERIOD: Type = Type::real("Period", &units::S).min(1e-5).max(1.0);
const RATIO: Type = Type::real("Ratio", &units::ONE).min(0.0).max(1.0);

variables! {
    /// A DC motor with pulse-width modulation: the duty is the part of each period in which the supply is on.
    pub struct Motor {
        /// Time of the next switching, s.
        next: f64,
        /// Whether the next switching begins a period.
        rises: bool = true,
        /// Start of the current period, s.
        begin: f64,
    }, memory in next, rises, begin;

    /// Part of each period in which the supply is on, limited to 0 and 1
    duty: f64 = input(&RATIO).start(0.5);
    /// Torque that brakes the shaft
    load: f64 = input(&TORQUE);
    /// Current through the winding
    current: f64 = output(&CURRENT).state();
    /// Speed of the shaft
    speed: f64 = output(&SPEED).state();
    /// Whether the supply is on
    on: bool = output(&BOOLEAN).exact();
    /// Rate of the current
    der_current as "der(current)" = local(&CURRENT_RATE).derivative_of(current)
        by |motor| motor.rates([motor.current, motor.speed])[0];
    /// Rate of the speed
    der_speed as "der(speed)" = local(&ACCELERATION).derivative_of(speed)
        by |motor| motor.rates([motor.current, motor.speed])[1];
    /// Voltage of the supply
    supply: f64 = parameter(&VOLTAGE).start(24.0);
    /// Resistance of the winding
    resistance: f64 = parameter(&RESISTANCE).start(0.5);
    /// Inductance of the winding
    inductance: f64 = parameter(&INDUCTANCE).start(1e-3);
    /// Torque per ampere, and voltage per rad/s
    constant: f64 = parameter(&CONSTANT).start(0.05);
    /// Inertia of the shaft and the load
    inertia: f64 = parameter(&INERTIA).start(2e-4);
    /// Time between the starts of two periods
    period: f64 = parameter(&PERIOD).start(1e-3);
}

impl Motor {
    /// Rates of current and speed.
    fn rates(&self, [current, speed]: [f64; 2]) -> [f64; 2] {
        let voltage = if self.on { self.supply } else { 0.0 };
        [
            (voltage - self.resistance * current - self.constant * speed) / self.inductance,
            (self.constant * current - self.load) / self.inertia,
        ]
    }

    /// Switches the supply on or off, and sets the time of the next event.
    fn switch(&mut self) {
        let duty = self.duty.clamp(0.0, 1.0);
        if self.rises {
            self.begin = self.next;
        }
        self.on = self.rises && duty > 0.0;
        self.rises = !(self.on && duty < 1.0);
        self.next = self.begin + if self.rises { self.period } else { duty * self.period };
    }

    /// Integrates in steps that are short compared with the time constant of the winding and with the period.
    fn integrate(&mut self, step: Step) -> Result<(), Error> {
        for part in step.parts(0.2 * (self.inductance / self.resistance).min(self.period))? {
            [self.current, self.speed] = rk4([self.current, self.speed], part, |_, state| self.rates(state));
        }
        Ok(())
    }
}

impl Model for Motor {
    const INFO: Info = Info {
        description: "DC motor with pulse-width modulation",
        default_experiment: DefaultExperiment {
            stop_time: 0.2,
            step_size: 1e-4,
            ..DefaultExperiment::DEFAULT
        },
        ..info!("Motor", "motor")
    };

    fn initialize(&mut self, experiment: &Experiment) -> Result<(), Error> {
        self.begin = experiment.start_time;
        self.next = experiment.start_time;
        Ok(())
    }
}

impl CoSimulation for Motor {
    /// Steps from switching to switching.
    fn step(&mut self, step: Step) -> Result<Stepped, Error> {
        const MOST: f64 = 10_000.0;
        let end = step.time + step.size;
        // A period that begins at the end belongs to the next step, even if rounding puts its start just before the end.
        let last = end - 1e-9 * self.period;
        if (end - self.next) / self.period > MOST || end + self.period == end {
            return Err(Error::new(format!(
                "a step may have at most {MOST} periods, and a period must not vanish when it is added to the time"
            )));
        }
        let mut time = step.time;
        while self.next < last {
            self.integrate(Step::new(time, (self.next - time).max(0.0)))?;
            time = self.next;
            self.switch();
        }
        self.integrate(Step::new(time, end - time))?;
        if !(self.current.is_finite() && self.speed.is_finite()) {
            return Err(Error::new("current or speed would not be finite"));
        }
        Ok(Stepped::Done)
    }
}

impl ModelExchange for Motor {
    fn event(&mut self, time: f64) -> Result<Event, Error> {
        let switched = time >= self.next;
        if switched {
            self.switch();
        }
        let again = time >= self.next;
        Ok(Event { again, states_changed: switched, next: Some(self.next), ..Event::default() })
    }
}
