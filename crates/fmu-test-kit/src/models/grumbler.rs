//! A clock that logs a warning and then fails in the method that its parameter selects. Other values of the parameter cause
//! other trouble.

use fmu_export::*;

enumeration! {
    /// Where something goes wrong.
    pub enum Trouble {
        /// Nowhere
        Nowhere = 0,
        /// When parameters are taken over
        Update = 1,
        /// When the initialization begins
        Initialize = 2,
        /// In the second round of an event
        SecondRound = 3,
        /// In the step after an event
        Step = 4,
        /// An event wants the simulation to end
        End = 5,
        /// Steps heat it up without limit
        Heat = 6,
        /// A round of an event asks for another, always
        Rounds = 7,
    }
}

/// A temperature in a type that the author of a model may define, with only the required functions.
#[derive(Clone, Copy)]
pub struct Celsius(pub f32);

impl Saved for Celsius {
    fn visit(&mut self, visitor: &mut dyn StateVisitor) {
        self.0.visit(visitor);
    }
}

impl Scalar for Celsius {
    const BASE: BaseType = BaseType::Real;

    fn value(&self) -> Value {
        Value::Real(self.0.into())
    }

    fn assign(&mut self, value: &Value) {
        if let Value::Real(value) = value {
            self.0 = *value as f32;
        }
    }
}

/// Has an event with two iterations every second, until the time `last`.
#[derive(Clone)]
pub struct Grumbler {
    trouble: Trouble,
    ambient: Celsius,
    warmer: f32,
    rounds: i32,
    last: f64,
    /// Time of the next event; infinity if there is none.
    next: f64,
    log: Log,
}

const TROUBLE: Type = Type::enumeration("Trouble", <Trouble as Enumeration>::ITEMS);
const KELVIN: Type = Type::float32("Kelvin", &units::ONE);

variables! { for Grumbler, memory in next;
    /// Where something goes wrong
    trouble = parameter(&TROUBLE) in trouble;
    /// Ambient temperature
    ambient = input(&NUMBER) in ambient;
    /// Temperature above the ambient temperature
    warmer = output(&KELVIN).exact() in warmer;
    /// Number of rounds of events
    rounds = output(&INTEGER).exact() in rounds;
    /// No event is after that
    last = parameter(&NUMBER) in last;
}

impl Grumbler {
    fn fail_at(&mut self, trouble: Trouble) -> Result<(), Error> {
        if self.trouble != trouble {
            return Ok(());
        }
        self.log.warning(format!("{trouble:?} will fail"));
        Err(Error::new(format!("{trouble:?} has failed")))
    }
}

impl Model for Grumbler {
    const INFO: Info = info!("Grumbler", "grumbler");

    fn new(_: &Setup) -> Result<Self, Error> {
        let mut log = Log::default();
        log.warning("made");
        let (ambient, next) = (Celsius(20.0), f64::INFINITY);
        Ok(Self { trouble: Trouble::Nowhere, ambient, warmer: 0.0, rounds: 0, last: 1e9, next, log })
    }

    fn update(&mut self) -> Result<(), Error> {
        self.fail_at(Trouble::Update)
    }

    fn initialize(&mut self, experiment: &Experiment) -> Result<(), Error> {
        self.next = experiment.start_time;
        self.fail_at(Trouble::Initialize)
    }

    fn log(&mut self) -> Option<&mut Log> {
        Some(&mut self.log)
    }
}

impl ModelExchange for Grumbler {
    fn event(&mut self, time: f64) -> Result<Event, Error> {
        let mut again = false;
        if time >= self.next {
            self.rounds = self.rounds.saturating_add(1);
            again = self.rounds % 2 == 1 || self.trouble == Trouble::Rounds;
            if !again {
                self.fail_at(Trouble::SecondRound)?;
                self.next = if time + 1.0 > self.last { f64::INFINITY } else { time + 1.0 };
            }
        }
        let next = Some(self.next).filter(|next| next.is_finite());
        Ok(Event { again, next, terminate: self.trouble == Trouble::End, ..Event::default() })
    }
}

impl CoSimulation for Grumbler {
    const EVENTS: Events = Events::Stop;

    fn step(&mut self, step: Step) -> Result<Stepped, Error> {
        if step.time > 0.0 {
            self.fail_at(Trouble::Step)?;
        }
        if self.trouble == Trouble::Heat {
            self.warmer = f32::INFINITY;
        }
        if step.time + step.size >= self.next {
            self.log.event(format!("stops at {}", self.next));
            return Ok(Stepped::Event(self.next));
        }
        Ok(Stepped::Done)
    }
}

offer!(Grumbler: CoSimulation + ModelExchange);
