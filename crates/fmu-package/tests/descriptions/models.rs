//! The test models. Together they use most of what fmu-package writes into a model description.

use fmu_export::*;
use std::cell::RefCell;

/// Implements the steps of Co-Simulation with Euler's method: `$change` adds the step size times the derivatives to the states.
macro_rules! step {
    ($change:expr; $($fact:ident: $type:ty = $value:expr;)*) => {
        $(const $fact: $type = $value;)*

        fn step(&mut self, step: Step) -> Result<Stepped, Error> {
            let change: fn(&mut Self, f64) = $change;
            change(self, step.size);
            Ok(Stepped::Done)
        }
    };
}

/// Most of what the descriptions for FMI 2.0 and FMI 3.0 have in common.
pub mod room {
    use super::*;

    enumeration! {
        /// Stage of the heater.
        pub enum Heater {
            /// Nothing
            Off = 0,
            /// Warms <gently>
            Low = 2,
            /// Warms
            High = 5,
        }
    }

    const HEATER: Type = Type::enumeration("Heater", <Heater as Enumeration>::ITEMS);
    const CELSIUS: Unit = Unit::new("degC").K(1).offset(273.15).display("degF", 1.8, 32.0);
    const TEMPERATURE: Type = Type::real("ThermodynamicTemperature", &CELSIUS).nominal(20.0).min(-273.15);
    const BASES: Unit = Unit::new("all").kg(1).m(-2).s(3).A(-4).K(5).mol(-6).cd(7).rad(-8).factor(0.001);
    const STRANGE: Type = Type { name: "", ..Type::real("Strange", &BASES).max(1.0) };
    const SHARE: Type = Type::integer("Share").max_integer(100);
    const ALARMS: Type = Type::integer("Alarms").min_integer(0);

    variables! {
        pub struct Room {
            time: f64,
        };

        /// Time
        time = independent(&TIME);
        /// Outside temperature
        outside: f64 = input(&TEMPERATURE).start(10.0);
        /// Requested stage
        heater: Heater = input(&HEATER).start(Heater::Low);
        /// Whether the window is open
        open: bool = input(&BOOLEAN);
        /// Note of the operator
        comment: String = input(&STRING);
        /// Setpoint that changes at communication points only
        setpoint: f64 = input(&TEMPERATURE).discrete().start(21.0);
        /// Temperature
        temperature: f64 = output(&TEMPERATURE).state().reinit().start(20.0);
        /// Its rate
        rate as "der(temperature)" = local(&NUMBER).derivative_of(temperature)
            by |room| room.power * f64::from(room.heater.number()) - room.temperature + room.outside;
        /// Temperature of the wall, found from a guess
        wall: f64 = local(&TEMPERATURE).state().approx().start(15.0);
        /// Its rate
        wall_rate as "der(wall)" = local(&NUMBER).derivative_of(wall) by |room| room.temperature - room.wall;
        /// Alarms so far
        alarms: i32 = output(&ALARMS).exact().start(3);
        /// Whether it is too warm
        warm = output(&BOOLEAN) by |room| room.temperature > 25.0;
        /// Present stage
        heater_now = output(&HEATER) by |room| room.heater;
        /// Text on the display
        display = output(&STRING) by |room| format!("{} {}", room.label, room.comment);
        /// Sine of the time
        wave = output(&NUMBER) by |room| room.time.sin();
        /// Version of the room
        version = output(&INTEGER).constant() by |_| 7;
        /// All base units
        strange = local(&STRANGE).constant() by |_| 0.5;
        /// Power per stage
        power: f64 = parameter(&NUMBER).start(1.5);
        /// Double the power
        double = calculated_parameter(&NUMBER) by |room| 2.0 * room.power;
        /// Title of the display
        label: String = parameter(&STRING).tunable().start("a \"b\"\n< c".into());
        /// Half the share, as it was in the beginning
        half = local(&INTEGER).fixed() by |room| room.share / 2;
        /// Share of the heat that is recovered, %
        share: i32 = parameter(&SHARE).start(50);
    }

    impl Model for Room {
        const INFO: Info = Info {
            description: "A \"room\"",
            author: "A. Uthor",
            version: "1",
            license: "MIT",
            copyright: "(c)",
            ..Info::new("Room", "room")
        };

        fn initialize(&mut self, _: &Experiment) -> Result<(), Error> {
            self.wall = 0.5 * (self.temperature + self.outside);
            Ok(())
        }

        fn calculate(&mut self, time: f64) {
            self.time = time;
        }
    }

    impl ModelExchange for Room {
        const INDICATORS: usize = 2;
        const STEP_COMPLETED: bool = true;

        fn indicators(&self, indicators: &mut [f64]) {
            indicators.fill(0.0);
        }
    }

    impl CoSimulation for Room {
        step! {
        |room, size| {
            let rates = [
                room.power * f64::from(room.heater.number()) - room.temperature + room.outside,
                room.temperature - room.wall,
            ];
            room.temperature += size * rates[0];
            room.wall += size * rates[1];
        };
        VARIABLE_STEP_SIZE: bool = false; EVENTS: Events = Events::StopIfHandled; }
    }

    impl InputDerivatives for Room {
        fn set_input_derivative(&mut self, _: Name, _: u32, _: f64) {}
    }

    impl OutputDerivatives for Room {
        const HIGHEST: u32 = 2;

        fn output_derivative(&self, _: Name, _: u32) -> f64 {
            0.0
        }
    }

    offer!(Room: ModelExchange + CoSimulation + InputDerivatives + OutputDerivatives);
}

/// Dependencies with factors that are constant, fixed, or neither.
pub mod factors {
    use super::*;

    const SHARE: Type = Type::real("Share", &units::ONE).min(0.0).max(1.0);
    const COUNT: Type = Type::integer("Count").min_integer(-9).max_integer(3);

    variables! {
        pub struct Factors;
        /// Input
        u: f64 = input(&NUMBER);
        /// Input with <signs> & "quotes"
        v: f64 = input(&NUMBER);
        /// State
        x: f64 = output(&NUMBER).state().start(2.0);
        /// 3 u - p x
        der_x as "der(x)" = local(&NUMBER).derivative_of(x) by |model| 3.0 * model.u - model.p * model.x;
        /// 2 u + n x
        y = output(&NUMBER) by |model| 2.0 * model.u + f64::from(model.n) * model.x;
        /// x v, or x if not b
        z = output(&NUMBER) by |model| model.x * if model.b { model.v } else { 1.0 };
        /// Five; the input cancels, up to rounding
        five = output(&NUMBER) by |model| (model.u / 3.0 + 5.0) - model.u / 3.0;
        /// Real parameter
        p: f64 = parameter(&SHARE).start(0.1);
        /// Integer parameter
        n: i32 = parameter(&COUNT).start(1);
        /// Boolean parameter
        b: bool = parameter(&BOOLEAN).start(true);
    }

    impl Model for Factors {
        const INFO: Info = Info {
            default_experiment: DefaultExperiment {
                start_time: 0.5,
                stop_time: 2.0,
                step_size: 1e-3,
                tolerance: 1e-7,
            },
            smooth: true,
            ..Info::new("Factors", "factors")
        };

        fn update(&mut self) -> Result<(), Error> {
            match self.p < f64::from(self.n) / 20.0 {
                true => Err(Error::new("p is too small for n")),
                false => Ok(()),
            }
        }
    }

    impl CoSimulation for Factors {
        step! { |model, size| model.x += size * (3.0 * model.u - model.p * model.x); ENDS_EARLY: bool = true; }
    }

    impl ModelExchange for Factors {}

    impl Partials for Factors {
        fn partial(&self, unknown: Name, known: Name) -> Option<f64> {
            let (z_x, z_v) = if self.b { (self.v, self.x) } else { (1.0, 0.0) };
            Some(match (unknown, known) {
                (Name::der_x, Name::u) => 3.0,
                (Name::der_x, Name::x) => -self.p,
                (Name::der_x, Name::p) => -self.x,
                (Name::y, Name::u) => 2.0,
                (Name::y, Name::x) => f64::from(self.n),
                (Name::z, Name::x) => z_x,
                (Name::z, Name::v) => z_v,
                (Name::x, Name::x) => 1.0,
                _ => 0.0,
            })
        }
    }

    offer!(Factors: CoSimulation + ModelExchange + Partials);
}

/// Arrays of several types, whose elements have different dependencies. In FMI 3.0, the dependencies of the elements are merged.
pub mod chain {
    use super::*;

    enumeration! {
        /// Kind of an end.
        pub enum End {
            Free = 0,
            /// It does not move
            Fixed = 3,
        }
    }

    const END: Type = Type::enumeration("End", <End as Enumeration>::ITEMS);
    const LIMIT: Type = Type::real("Limit", &units::ONE).min(-50.0);
    const COUNT: Type = Type::integer("Count").min_integer(0).max_integer(9);

    variables! {
        pub struct Chain;
        /// States
        x: [f64; 2] = output(&NUMBER).state().start([1.0, 2.0]);
        /// u[1]; p * x[1] + sin(u[2])
        der_x as "der(x)" = local(&NUMBER).derivative_of(x) by |c| [c.u[0], c.p * c.x[0] + c.u[1].sin()];
        /// Inputs
        u: [f64; 2] = input(&NUMBER).start([0.5, 0.25]);
        /// Parameter
        p: f64 = parameter(&NUMBER).start(3.0);
        /// Kinds of the ends
        ends: [End; 2] = input(&END).start([End::Fixed, End::Free]);
        /// Limits of the states
        limits: [[f64; 2]; 2] = parameter(&LIMIT).start([[10.0, 25.0], [12.5, 30.0]]);
        /// Whether the states have moved
        moved: [bool; 2] = output(&BOOLEAN).exact().depends_on().start([true, false]);
        /// Numbers
        counted: [i32; 2] = parameter(&COUNT).start([1, 2]);
        /// Labels of the ends
        labels: [String; 2] = parameter(&STRING).start(["the <left> end".to_owned(), "the right end".to_owned()]);
        /// Reports on the ends
        reports = output(&STRING).depends_on(&[ends, labels])
            by |c| [0, 1].map(|i| format!("{}{}", c.labels[i], c.ends[i] == End::Fixed));
    }

    impl Model for Chain {
        const INFO: Info = Info { smooth: true, ..Info::new("Chain", "chain") };

        fn update(&mut self) -> Result<(), Error> {
            match self.limits.iter().all(|[low, high]| low <= high) {
                true => Ok(()),
                false => Err(Error::new("a lower limit must not exceed its upper limit")),
            }
        }
    }

    impl ModelExchange for Chain {}

    impl Partials for Chain {
        fn partial(&self, unknown: Name, known: Name) -> Option<f64> {
            self.element_partial((unknown, 0), Some((known, 0)), false)
        }

        fn element_partial(
            &self,
            unknown: (Name, usize),
            known: Option<(Name, usize)>,
            _: bool,
        ) -> Option<f64> {
            Some(match (unknown, known) {
                ((Name::x, i), Some((Name::x, j))) => f64::from(u8::from(i == j)),
                ((Name::der_x, 0), Some((Name::u, 0))) => 1.0,
                ((Name::der_x, 1), Some((Name::x, 0))) => self.p,
                ((Name::der_x, 1), Some((Name::u, 1))) => self.u[1].cos(),
                (_, Some((Name::p, _))) => return None,
                _ => 0.0,
            })
        }
    }

    impl CoSimulation for Chain {
        step! { |c, size| c.x = [c.x[0] + size * c.u[0], c.x[1] + size * (c.p * c.x[0] + c.u[1].sin())]; }
    }

    offer!(Chain: ModelExchange + CoSimulation + Partials);
}

/// Dependencies through branches and memory, which no evaluation near the start values can find.
pub mod branches {
    use super::*;

    variables! {
        pub struct Branches {
            sum: f64,
            stepped: bool,
        }, memory in sum, stepped;

        /// Input
        u: f64 = input(&NUMBER);
        /// Input
        v: f64 = input(&NUMBER);
        /// u if it is above 10, else 0
        above = output(&NUMBER) by |model| model.above();
        /// u limited to -100 to 100, plus v after the first step
        limited = output(&NUMBER)
            by |model| model.u.clamp(-100.0, 100.0) + if model.stepped { model.v } else { 0.0 };
        /// The same value as the variable `above`, with its dependency declared
        declared = output(&NUMBER).depends_on(&[u]) by |model| model.above();
        /// gain * (1 + the sum of u at the earlier steps)
        sum = output(&NUMBER).depends_on(&[gain]) by |model| model.gain * (1.0 + model.sum);
        /// One
        timed = output(&NUMBER).depends_on(&[Index::TIME]) by |_| 1.0;
        /// Factor
        gain: f64 = parameter(&NUMBER).start(1.0);
    }

    impl Branches {
        fn above(&self) -> f64 {
            if self.u > 10.0 { self.u } else { 0.0 }
        }
    }

    impl Model for Branches {
        const INFO: Info = Info::new("Branches", "branches");
    }

    impl CoSimulation for Branches {
        fn step(&mut self, _: Step) -> Result<Stepped, Error> {
            self.sum += self.u;
            self.stepped = true;
            Ok(Stepped::Done)
        }
    }

    impl Partials for Branches {
        fn partial(&self, unknown: Name, known: Name) -> Option<f64> {
            Some(match (unknown, known) {
                (Name::above | Name::declared, Name::u) => f64::from(self.u > 10.0),
                (Name::limited, Name::u) => f64::from(self.u.abs() < 100.0),
                (Name::limited, Name::v) => f64::from(self.stepped),
                (Name::sum, Name::gain) => 1.0 + self.sum,
                _ => 0.0,
            })
        }
    }

    offer!(Branches: CoSimulation + Partials);
}

/// A characteristic with breakpoints that must rise, or be evenly spaced.
pub mod breakpoints {
    use super::*;

    pub const LENGTH: usize = 20;

    thread_local! {
        /// Start values of the breakpoints, and whether their distances must be equal.
        pub static BREAKPOINTS: RefCell<([f64; LENGTH], bool)> = const { RefCell::new(([0.0; LENGTH], false)) };
    }

    variables! {
        pub struct Breakpoints;
        /// Input
        u: f64 = input(&NUMBER).start(1.0);
        /// Breakpoints
        x: [f64; LENGTH] = parameter(&NUMBER).start(BREAKPOINTS.with_borrow(|(start, _)| *start));
        /// Sum of the breakpoints, times the input
        y = output(&NUMBER) by |model| model.u * model.x.iter().sum::<f64>();
    }

    impl Model for Breakpoints {
        const INFO: Info = Info { smooth: true, ..Info::new("Breakpoints", "breakpoints") };

        fn update(&mut self) -> Result<(), Error> {
            let fits = match BREAKPOINTS.with_borrow(|(_, even)| *even) {
                true => self.x.windows(3).all(|x| (x[2] - 2.0 * x[1] + x[0]).abs() < 1e-9),
                false => self.x.is_sorted_by(|one, next| one < next),
            };
            if fits { Ok(()) } else { Err(Error::new("the breakpoints do not fit")) }
        }
    }

    impl CoSimulation for Breakpoints {
        step! { |_, _| {}; }
    }

    offer!(Breakpoints: CoSimulation);
}

/// A model whose code has one of several faults. The module `malformed` makes other faults by changing the descriptions of correct models.
pub mod faulty {
    use super::*;

    thread_local! {
        /// The fault that the model has.
        pub static FAULT: RefCell<&'static str> = const { RefCell::new("") };
    }

    fn has(fault: &str) -> bool {
        FAULT.with_borrow(|present| *present == fault)
    }

    variables! {
        pub struct Faulty {
            time: f64,
        };

        /// Input
        u: f64 = input(&NUMBER);
        /// Label
        label: String = parameter(&STRING);
        /// Square of the input, plus the time
        y = output(&NUMBER).depends_on(&[u, Index::TIME]) by |model| {
            assert!(!has("unreadable"));
            model.u * model.u + model.time
        };
    }

    impl Model for Faulty {
        const INFO: Info = Info::new("Faulty", "faulty");

        fn new(setup: &Setup) -> Result<Self, Error> {
            if has("broken") {
                return Err(Error::new("it is broken"));
            }
            assert!(!has("panic"), "it panics");
            let u = if has("two-faced") { f64::from(setup.interface as u8) } else { 0.0 };
            let label = if has("unwritable") { "a\u{1}" } else { "" };
            Ok(Self { u, label: label.to_owned(), time: 0.0 })
        }

        fn update(&mut self) -> Result<(), Error> {
            if has("rejects itself") { Err(Error::new("no is no")) } else { Ok(()) }
        }

        fn calculate(&mut self, time: f64) {
            self.time = time;
        }
    }

    impl CoSimulation for Faulty {
        step! { |_, _| {}; }
    }

    impl ModelExchange for Faulty {
        const INDICATORS: usize = 2;

        fn indicators(&self, indicators: &mut [f64]) {
            indicators[0] = self.u;
            if !has("indicator") {
                indicators[1] = self.u;
            }
        }
    }

    offer!(Faulty: CoSimulation + ModelExchange);
}
