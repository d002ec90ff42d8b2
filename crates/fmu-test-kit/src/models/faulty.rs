//! A model whose methods can panic. It is not an example for authors.

use fmu_export::*;
use std::cell::Cell;

/// The method in which the model panics.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(i32)]
pub enum Panic {
    None,
    Read,
    Then,
    ReadString,
    Update,
    Initialize,
    Calculate,
    Log,
    Step,
    Indicators,
    Event,
    ContinuousTimeEntered,
    StepCompleted,
    Nominals,
    Partial,
    InputDerivative,
    OutputDerivative,
    Memory,
    Drop,
    /// Panics in a getter with a payload that is not a string.
    NoMessage,
    /// Panics in a getter with a payload that panics when it is dropped. The payload of this second panic does the same.
    Bomb,
    /// Like `Clone`, set for all instances by [`while_all_break`], not by the parameter.
    New,
    Clone,
}

thread_local! {
    /// [`Panic::New`] or [`Panic::Clone`] while every new instance or every copy panics.
    static EVERYWHERE: Cell<Panic> = const { Cell::new(Panic::None) };
}

/// Runs the work while every new instance ([`Panic::New`]) or every copy ([`Panic::Clone`]) panics.
pub fn while_all_break<T>(panic: Panic, work: impl FnOnce() -> T) -> T {
    EVERYWHERE.set(panic);
    let result = work();
    EVERYWHERE.set(Panic::None);
    result
}

/// Panics in the method that the parameter `panic` selects.
pub struct Faulty {
    panic: i32,
    number: f64,
    state: f64,
    boolean: bool,
    string: String,
    memory: Memory,
}

/// A `memory` field that stores the parameter, so that visiting it can panic too.
#[derive(Clone)]
struct Memory(i32);

struct Bomb;

impl Drop for Bomb {
    fn drop(&mut self) {
        std::panic::panic_any(SecondBomb);
    }
}

struct SecondBomb;

impl Drop for SecondBomb {
    fn drop(&mut self) {
        panic!("a second bomb");
    }
}

impl Faulty {
    fn panic_if(&self, panic: Panic) {
        check(self.panic, panic);
    }

    fn read<T>(&self, value: T) -> T {
        self.panic_if(Panic::Read);
        if self.panic == Panic::NoMessage as i32 {
            std::panic::panic_any(7);
        }
        if self.panic == Panic::Bomb as i32 {
            std::panic::panic_any(Bomb);
        }
        value
    }
}

fn check(panic: i32, here: Panic) {
    assert!(panic != here as i32, "panic #{here:?} at 100%s");
}

impl Saved for Memory {
    fn visit(&mut self, visitor: &mut dyn StateVisitor) {
        check(self.0, Panic::Memory);
        self.0.visit(visitor);
    }
}

variables! { for Faulty, memory in memory;
    /// Input
    u = input(&NUMBER) in number then |faulty| { faulty.panic_if(Panic::Then); };
    /// Output
    y = output(&NUMBER) by |faulty| faulty.read(0.5);
    /// Where it breaks
    panic = parameter(&INTEGER) in panic then |faulty| { faulty.memory = Memory(faulty.panic); };
    /// An integer
    n = output(&INTEGER) by |faulty| faulty.read(3);
    /// A Boolean
    boolean = input(&BOOLEAN) in boolean then |faulty| { faulty.panic_if(Panic::Then); } by |faulty| faulty.read(faulty.boolean);
    /// A string
    string = input(&STRING) in string then |faulty| { faulty.panic_if(Panic::Then); } by |faulty| {
        faulty.panic_if(Panic::ReadString);
        faulty.string.clone()
    };
    /// A state
    x = local(&NUMBER).state() in state then |faulty| { faulty.panic_if(Panic::Then); };
    /// Its rate
    der_x as "der(x)" = local(&NUMBER).derivative_of(x) by |faulty| faulty.read(0.0);
}

impl Clone for Faulty {
    fn clone(&self) -> Self {
        check(EVERYWHERE.get() as i32, Panic::Clone);
        Self { string: self.string.clone(), memory: self.memory.clone(), ..*self }
    }
}

impl Drop for Faulty {
    fn drop(&mut self) {
        if !std::thread::panicking() {
            self.panic_if(Panic::Drop);
        }
    }
}

impl Model for Faulty {
    const INFO: Info = info!("Faulty", "faulty");

    fn new(_: &Setup) -> Result<Self, Error> {
        check(EVERYWHERE.get() as i32, Panic::New);
        let memory = Memory(0);
        Ok(Self { panic: 0, number: 0.0, state: 0.0, boolean: false, string: String::new(), memory })
    }

    fn update(&mut self) -> Result<(), Error> {
        self.panic_if(Panic::Update);
        Ok(())
    }

    fn initialize(&mut self, _: &Experiment) -> Result<(), Error> {
        self.panic_if(Panic::Initialize);
        Ok(())
    }

    fn calculate(&mut self, _: f64) {
        self.panic_if(Panic::Calculate);
    }

    fn log(&mut self) -> Option<&mut Log> {
        self.panic_if(Panic::Log);
        None
    }
}

impl CoSimulation for Faulty {
    fn step(&mut self, _: Step) -> Result<Stepped, Error> {
        self.panic_if(Panic::Step);
        Ok(Stepped::Done)
    }
}

impl ModelExchange for Faulty {
    const INDICATORS: usize = 1;
    const STEP_COMPLETED: bool = true;

    fn indicators(&self, _: &mut [f64]) {
        self.panic_if(Panic::Indicators);
    }

    fn event(&mut self, _: f64) -> Result<Event, Error> {
        self.panic_if(Panic::Event);
        Ok(Event::default())
    }

    fn continuous_time_entered(&mut self) {
        self.panic_if(Panic::ContinuousTimeEntered);
    }

    fn step_completed(&mut self, _: f64) -> StepCompleted {
        self.panic_if(Panic::StepCompleted);
        StepCompleted::default()
    }

    fn nominals(&self, _: &mut [f64]) {
        self.panic_if(Panic::Nominals);
    }
}

impl Partials for Faulty {
    fn partial(&self, _: Name, _: Name) -> Option<f64> {
        self.panic_if(Panic::Partial);
        Some(1.0)
    }
}

impl InputDerivatives for Faulty {
    fn set_input_derivative(&mut self, _: Name, _: u32, _: f64) {
        self.panic_if(Panic::InputDerivative);
    }
}

impl OutputDerivatives for Faulty {
    fn output_derivative(&self, _: Name, _: u32) -> f64 {
        self.panic_if(Panic::OutputDerivative);
        0.0
    }
}

offer!(Faulty: CoSimulation + ModelExchange + Partials + InputDerivatives + OutputDerivatives);
