//! A model that calculates values in `calculate`, once before they are read, and uses them in events.

use fmu_export::*;

variables! {
    /// Calculates and stores the sum of all its values.
    pub struct Lazy {
        slope: f64,
        sum: f64 = f64::NAN,
    }, memory in slope;

    /// A summand
    real: f64 = input(&NUMBER).start(1.0);
    /// Another
    integer: i32 = input(&INTEGER).start(2);
    /// 1 more, and steps end half-way
    boolean: bool = input(&BOOLEAN);
    /// Its length
    string: String = input(&STRING).start("abc".to_owned());
    /// A parameter
    weight: f64 = parameter(&NUMBER).start(4.0);
    /// A state
    state: f64 = output(&NUMBER).state().start(5.0);
    /// Its rate, which is the sum as well
    der_state as "der(state)" = local(&NUMBER).derivative_of(state) by |lazy| lazy.sum;
    /// The sum as it was calculated
    sum = output(&NUMBER) by |lazy| lazy.sum;
    /// Sum without the time, calculated when it is read
    summands = local(&NUMBER) by |lazy| lazy.summands();
    /// The time
    time = independent(&TIME);
}

impl Lazy {
    fn summands(&self) -> f64 {
        let integer = f64::from(self.integer) + f64::from(u8::from(self.boolean)) + self.string.len() as f64;
        self.real + integer + self.weight + self.state + self.slope
    }
}

impl Model for Lazy {
    const INFO: Info = info!("Lazy", "lazy");

    fn calculate(&mut self, time: f64) {
        self.sum = self.summands() + time;
    }
}

impl CoSimulation for Lazy {
    const ENDS_EARLY: bool = true;

    fn step(&mut self, step: Step) -> Result<Stepped, Error> {
        self.state += 1.0;
        Ok(if self.boolean { Stepped::Early(step.time + 0.5 * step.size) } else { Stepped::Done })
    }
}

impl ModelExchange for Lazy {
    const INDICATORS: usize = 1;
    const STEP_COMPLETED: bool = true;

    fn indicators(&self, indicators: &mut [f64]) {
        indicators[0] = self.sum;
    }

    fn event(&mut self, _: f64) -> Result<Event, Error> {
        if !self.sum.is_finite() {
            return Err(Error::new("the sum would not be finite"));
        }
        self.state = self.sum;
        Ok(Event { states_changed: true, ..Event::default() })
    }

    fn step_completed(&mut self, _: f64) -> StepCompleted {
        if self.sum.is_finite() {
            self.state = self.sum;
        }
        StepCompleted::default()
    }

    fn nominals(&self, nominals: &mut [f64]) {
        nominals[0] = self.sum;
    }
}

impl Partials for Lazy {
    fn partial(&self, _: Name, _: Name) -> Option<f64> {
        Some(self.sum)
    }
}

impl InputDerivatives for Lazy {
    fn set_input_derivative(&mut self, _: Name, _: u32, value: f64) {
        self.slope = value;
    }
}

impl OutputDerivatives for Lazy {
    fn output_derivative(&self, _: Name, _: u32) -> f64 {
        self.sum
    }
}

offer!(Lazy: CoSimulation + ModelExchange + Partials + InputDerivatives + OutputDerivatives);
