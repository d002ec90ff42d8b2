//! A heated rod with arrays of Reals, Integers, Booleans, Strings and Enumerations, as states, inputs, parameters and
//! outputs.
#![allow(non_snake_case, reason = "T is the symbol of a temperature")]

use fmu_export::*;

/// Number of pieces of the rod.
pub const PIECES: usize = 8;
const HEATERS: usize = 2;

enumeration! {
    /// State of a heater.
    pub enum Switch {
        Off = 0,
        /// The heater heats
        On = 3,
    }
}

const TEMPERATURE: Type = Type::real("Temperature", &Unit::new("degC").K(1)).nominal(100.0);
const RATE: Type = Type::real("TemperatureRate", &Unit::new("K/s").K(1).s(-1));
const POWER: Type = Type::real("Power", &Unit::new("W").kg(1).m(2).s(-3)).nominal(10.0);
const CAPACITY: Type = Type::real("Capacity", &Unit::new("J/K").kg(1).m(2).s(-2).K(-1)).min(0.1);
const CONDUCTANCE: Type =
    Type::real("Conductance", &Unit::new("W/K").kg(1).m(2).s(-3).K(-1)).min(0.0).max(1.0);
const SWITCH: Type = Type::enumeration("Switch", <Switch as Enumeration>::ITEMS);
const COUNT: Type = Type::integer("Count").min_integer(0).max_integer(9);

variables! {
    /// Each piece obeys C T' = conductance times the temperature differences to its neighbours + power of its heater. The far
    /// end of the rod is insulated.
    pub struct Rod;
    /// Temperature of the wall at the start of the rod
    wall: f64 = input(&TEMPERATURE).start(20.0);
    /// Temperatures of the pieces
    T: [f64; PIECES] = output(&TEMPERATURE).state().start(std::array::from_fn(|piece| 20.0 + piece as f64));
    /// Power of the heaters, each for half of the rod
    power: [f64; HEATERS] = input(&POWER).start([10.0, 5.0]);
    /// Whether the heaters are switched on
    switches: [Switch; HEATERS] = input(&SWITCH).start([Switch::On, Switch::Off]);
    /// Rates of the temperatures
    der_T as "der(T)" = local(&RATE).derivative_of(T).depends_on(wall, T, power, switches, capacities, conductance)
        by |rod| rod.rates();
    /// Mean temperature
    mean = output(&TEMPERATURE).depends_on(&[T]) by |rod| rod.T.iter().sum::<f64>() / PIECES as f64;
    /// Means of the halves
    means = output(&TEMPERATURE).depends_on(T) by |rod| rod.means();
    /// Capacities of the pieces
    capacities: [f64; PIECES] = parameter(&CAPACITY).start(std::array::from_fn(|piece| 2.0 + 0.125 * piece as f64));
    /// Conductance from piece to piece
    conductance: f64 = parameter(&CONDUCTANCE).start(0.5);
    /// Temperatures of each half below which it is cold and above which it is warm
    limits: [[f64; 2]; HEATERS] = parameter(&TEMPERATURE).start([[10.0, 25.0], [12.5, 30.0]]);
    /// Whether a piece is above the upper limit of its half, since the last step or event
    hot: [bool; PIECES] = output(&BOOLEAN).exact().depends_on(&[]);
    /// A number for each half
    counted: [i32; HEATERS] = parameter(&COUNT).start([1, 2]) then |rod| { rod.conductance = rod.conductance.min(1.0); };
    /// Names of the halves
    labels: [String; HEATERS] = parameter(&STRING).start(["the near half".to_owned(), "the far half".to_owned()]);
    /// Names of the halves and whether they are warm
    reports = output(&STRING).depends_on(&[T, limits, labels]) by |rod| rod.reports();
}

impl Rod {
    fn heater(piece: usize) -> usize {
        piece * HEATERS / PIECES
    }

    fn rates(&self) -> [f64; PIECES] {
        self.rates_at(&self.T)
    }

    fn rates_at(&self, temperatures: &[f64; PIECES]) -> [f64; PIECES] {
        std::array::from_fn(|piece| {
            let own = temperatures[piece];
            let before = if piece == 0 { self.wall } else { temperatures[piece - 1] };
            let behind = temperatures.get(piece + 1).map_or(0.0, |behind| behind - own);
            let heater = Self::heater(piece);
            let heat = if self.switches[heater] == Switch::On { self.power[heater] } else { 0.0 };
            (self.conductance * (before - own + behind) + heat) / self.capacities[piece]
        })
    }

    fn means(&self) -> [f64; HEATERS] {
        let half = PIECES / HEATERS;
        std::array::from_fn(|heater| self.T[heater * half..][..half].iter().sum::<f64>() / half as f64)
    }

    fn reports(&self) -> [String; HEATERS] {
        let means = self.means();
        std::array::from_fn(|heater| {
            let [low, high] = self.limits[heater];
            let how = if means[heater] < low {
                "cold"
            } else if means[heater] > high {
                "warm"
            } else {
                "well"
            };
            format!("{} is {how}", self.labels[heater])
        })
    }

    fn above(&self, piece: usize) -> f64 {
        self.T[piece] - self.limits[Self::heater(piece)][1]
    }

    fn look(&mut self) {
        self.hot = std::array::from_fn(|piece| self.above(piece) > 0.0);
    }
}

impl Model for Rod {
    const INFO: Info = Info {
        description: "Heated rod",

        default_experiment: DefaultExperiment {
            stop_time: 10.0,
            step_size: 0.1,
            ..DefaultExperiment::DEFAULT
        },
        ..info!("Rod", "rod")
    };

    fn update(&mut self) -> Result<(), Error> {
        match self.limits.iter().all(|[low, high]| low <= high) {
            true => Ok(()),
            false => Err(Error::new("the limits of a half must be the lower one and the upper one")),
        }
    }
}

impl CoSimulation for Rod {
    /// Uses the explicit Euler method. In steps of up to 100 s, its substeps are short enough for any capacity.
    fn step(&mut self, step: Step) -> Result<Stepped, Error> {
        let count = (step.size / 0.01).ceil().clamp(1.0, 1e4);
        let mut next = self.T;
        for _ in 0..count as usize {
            let rates = self.rates_at(&next);
            next.iter_mut().zip(rates).for_each(|(next, rate)| *next += step.size / count * rate);
        }
        if !next.iter().all(|temperature| temperature.is_finite()) {
            return Err(Error::new("a temperature would not be finite"));
        }
        self.T = next;
        self.look();
        Ok(Stepped::Done)
    }
}

impl ModelExchange for Rod {
    const INDICATORS: usize = PIECES;

    fn indicators(&self, indicators: &mut [f64]) {
        for (piece, indicator) in indicators.iter_mut().enumerate() {
            *indicator = self.above(piece);
        }
    }

    fn event(&mut self, _: f64) -> Result<Event, Error> {
        self.look();
        Ok(Event::default())
    }
}

impl Partials for Rod {
    fn partial(&self, unknown: Name, known: Name) -> Option<f64> {
        self.element_partial((unknown, 0), Some((known, 0)), false)
    }

    fn element_partial(
        &self,
        (unknown, i): (Name, usize),
        known: Option<(Name, usize)>,
        _: bool,
    ) -> Option<f64> {
        let Some((known, j)) = known else { return Some(0.0) };
        let is = |same: bool, value: f64| if same { value } else { 0.0 };
        Some(match (unknown, known) {
            (Name::T, Name::T) => is(i == j, 1.0),
            (Name::mean, Name::T) => 1.0 / PIECES as f64,
            (Name::means, Name::T) => is(i == Self::heater(j), HEATERS as f64 / PIECES as f64),
            (Name::der_T, Name::wall) => is(i == 0, self.conductance / self.capacities[0]),
            (Name::der_T, Name::T) => {
                let neighbours = if i + 1 < PIECES { 2.0 } else { 1.0 };
                let factor = is(i == j, -neighbours) + is(i.abs_diff(j) == 1, 1.0);
                factor * self.conductance / self.capacities[i]
            }
            (Name::der_T, Name::power) => {
                is(Self::heater(i) == j && self.switches[j] == Switch::On, 1.0 / self.capacities[i])
            }
            (Name::der_T, Name::capacities | Name::conductance) => return None,
            _ => 0.0,
        })
    }
}

impl OutputDerivatives for Rod {
    fn output_derivative(&self, of: Name, order: u32) -> f64 {
        self.element_derivative(of, 0, order)
    }

    fn element_derivative(&self, of: Name, element: usize, _: u32) -> f64 {
        let rates = self.rates();
        let half = PIECES / HEATERS;
        match of {
            Name::T => rates[element],
            Name::mean => rates.iter().sum::<f64>() / PIECES as f64,
            Name::means => rates[element * half..][..half].iter().sum::<f64>() / half as f64,
            _ => 0.0,
        }
    }
}

offer!(Rod: CoSimulation + ModelExchange + Partials + OutputDerivatives);
