//! Capabilities of the testbed FMU.

use crate::fmu::{Moving, Row, TestbedFmu, moving_variables};
use crate::instant::Instant;
use crate::motor::Motions;
use crate::pair::Pair;
use crate::parameters::{InvalidParameter, Parameters};
use crate::start::Start;
use crate::testbed::{State, Testbed, split_by_side};
use crate::variables::Name;
use fmu_export::{
    CoSimulation, DefaultExperiment, Error, Experiment, FastSteps, Info, InputDerivatives, Interface, Model,
    ModelExchange, OutputDerivatives, Partials, Saved, Setup, StateVisitor, Step, Stepped, Variables, info,
    saved,
};
use std::borrow::Cow;

impl Saved for Pair {
    fn visit(&mut self, visitor: &mut dyn StateVisitor) {
        self[0].visit(visitor);
        self[1].visit(visitor);
    }
}

saved!(for Motions { angle, rate, acceleration });

/// Converts the error to the type of errors that the importer gets.
fn rejected(error: InvalidParameter) -> Error {
    Error::new(error.to_string())
}

impl Model for TestbedFmu {
    const INFO: Info = Info {
        description: "Testbed of the McGill pitch-roll wrist: a spherical epicyclic cam train driven by two \
                      motors through flexible couplings",
        copyright: "Copyright 2026 the pitch-roll wrist testbed authors",
        default_experiment: DefaultExperiment {
            start_time: 0.0,
            stop_time: 2.0,
            step_size: 1e-3,
            tolerance: 1e-6,
        },
        smooth: true,
        ..info!("PitchRollWristTestbed", "prw_testbed")
    };

    fn new(setup: &Setup) -> Result<Self, Error> {
        let testbed = Testbed::new(crate::BUILT_IN).map_err(rejected)?;
        let (interface, start, two) = (setup.interface, Start::default(), [0.0; 2]);
        let jacobian = [[0.0; _]; 10];
        let mut fmu = Self { testbed, interface, start, torques: two, angles: two, rates: two, jacobian };
        fmu.jacobian = fmu.jacobian();
        Ok(fmu)
    }

    #[inline(never)]
    fn update(&mut self) -> Result<(), Error> {
        self.testbed.parameters_changed().map_err(rejected)?;
        self.jacobian = self.jacobian();
        Ok(())
    }

    fn restored(&mut self) -> Result<(), Error> {
        let motors = &mut self.testbed.motors;
        if !motors.times.are_possible() {
            return Err(Error::new(
                "a saved state must have 0 to 2 earlier samples, and positive times between them",
            ));
        }
        motors.times.update();
        motors.rates_changed();
        Ok(())
    }

    /// Until the simulation has started or the importer has set a state, the state follows from the start parameters
    /// or from the motor angles.
    fn calculate_start(&mut self) {
        if !self.start.is_over {
            self.testbed.state = self.start.from(self.testbed.motors.theta());
        }
    }

    fn initialize(&mut self, _: &Experiment) -> Result<(), Error> {
        self.testbed.motors.forget_samples();
        Ok(())
    }

    fn calculate(&mut self, _time: f64) {
        self.calculate_with(split_by_side(&self.testbed.state), self.motions(&self.testbed.motors));
    }
}

impl CoSimulation for TestbedFmu {
    const ATOMIC_STEP: bool = true;

    fn step(&mut self, step: Step) -> Result<Stepped, Error> {
        if !self.step_any_size(step.size) {
            return Err(Error::new("the state would overflow; look for extreme inputs or states"));
        }
        self.start.is_over = true;
        Ok(Stepped::Calculated)
    }
}

impl FastSteps for TestbedFmu {
    #[inline(always)]
    fn step_fast(&mut self, size: f64) -> bool {
        let state = self.testbed.step_fast(size);
        if let Some(state) = state {
            self.calculate_with(state, self.testbed.motors.segment_end);
        }
        state.is_some()
    }

    fn step_any_size(&mut self, size: f64) -> bool {
        let state = self.testbed.step_to(size);
        if let Some(state) = state {
            self.calculate_with(state, self.testbed.motors.segment_end);
        }
        state.is_some()
    }
}

impl ModelExchange for TestbedFmu {
    fn continuous_time_entered(&mut self) {
        self.start.is_over = true;
    }
}

macro_rules! names {
    ($($name:ident)+) => { [$(Name::$name),+] };
}
/// The variables of [`Moving`] in the order of [`Row`].
const MOVING: [Name; size_of::<Row>() / size_of::<f64>()] = moving_variables!(names);

/// Index in a [`Row`] of each variable of the table; the length of a `Row` for a variable that it does not contain.
const POSITIONS: [usize; TestbedFmu::NAMES.len()] = {
    let mut positions = [MOVING.len(); _];
    let mut position = 0;
    while position < MOVING.len() {
        positions[MOVING[position] as usize] = position;
        position += 1;
    }
    positions
};

impl InputDerivatives for TestbedFmu {
    /// Accepts order 1 of theta, the slope over the next step. Higher orders and derivatives of omega are
    /// ignored, because the motor angles change linearly between communication points.
    fn set_input_derivative(&mut self, of: Name, order: u32, value: f64) {
        match (of, order) {
            (Name::theta1, 1) => self.testbed.motors.set_rate(0, value),
            (Name::theta2, 1) => self.testbed.motors.set_rate(1, value),
            _ => {}
        }
    }
}

impl OutputDerivatives for TestbedFmu {
    fn output_derivative(&self, of: Name, _: u32) -> f64 {
        let rates = self.moving(&self.now().rates(self.system()));
        self.change(of, &rates.into(), None).unwrap_or(f64::NAN)
    }
}

/// Derivatives of the values that a getter returns, in Initialization Mode and later. In Co-Simulation, the
/// rates that are estimated from the angles depend on the angles. Until the simulation has started, the
/// states may depend on the angles too. Derivatives with respect to parameters are calculated separately. All
/// others are entries of A, B, C and D of eq. (11), factors of eq. (1), 0 or 1.
impl Partials for TestbedFmu {
    fn partial(&self, unknown: Name, known: Name) -> Option<f64> {
        self.partials(Some((known, 0)), false)((unknown, 0))
    }

    #[inline]
    fn partials(
        &self,
        known: Option<(Name, usize)>,
        _initial: bool,
    ) -> impl Fn((Name, usize)) -> Option<f64> {
        let known = known.map(|(known, _)| known);
        let sensitivities = self.sensitivities(known);
        move |(unknown, _)| self.change(unknown, &sensitivities, known)
    }
}

impl TestbedFmu {
    /// Returns the change of a variable if the [`Moving`] variables change by `row`, because a known is set or because time passes (`None`).
    /// A variable that is not linear, such as a power, needs an arm: the sum of each factor times the change of the other one. The factors
    /// are the values after the known was set, because a motor angle that is set is a new sample, and may change the estimated rate.
    #[inline(always)]
    fn change(&self, of: Name, row: &Row, _known: Option<Name>) -> Option<f64> {
        row.get(POSITIONS[of as usize]).copied()
    }

    /// Returns the partial derivatives of the variables with respect to a known. `None` stands for time, on
    /// which no variable depends explicitly.
    #[inline(never)]
    fn sensitivities(&self, known: Option<Name>) -> Cow<'_, Row> {
        let [_, _, _, _, of_states @ ..] = &self.jacobian;
        let has_start = !self.start.is_over && !self.start.at_rest;
        let start = |state: usize| if has_start { &of_states[state] } else { &[0.0; _] };
        Cow::Borrowed(match known {
            None => &[0.0; _],
            Some(Name::theta3) => &of_states[0],
            Some(Name::theta4) => &of_states[1],
            Some(Name::theta5) => &of_states[2],
            Some(Name::theta6) => &of_states[3],
            Some(Name::omega5) => &of_states[4],
            Some(Name::omega6) => &of_states[5],
            Some(Name::theta3_start) => start(0),
            Some(Name::theta4_start) => start(1),
            Some(Name::theta5_start) => start(2),
            Some(Name::theta6_start) => start(3),
            Some(Name::omega5_start) => start(4),
            Some(Name::omega6_start) => start(5),
            Some(Name::theta1) => return self.sensitivities_to_angle(0),
            Some(Name::theta2) => return self.sensitivities_to_angle(1),
            Some(Name::omega1) => self.sensitivities_to_rate(0),
            Some(Name::omega2) => self.sensitivities_to_rate(1),
            Some(parameter) => return self.sensitivities_to_parameter(parameter),
        })
    }

    /// Returns the partial derivatives with respect to a motor angle. A change of the angle also changes the rate, if
    /// it is estimated from samples, and the states, if the testbed is still to start at rest at the motor angles.
    #[inline(never)]
    fn sensitivities_to_angle(&self, motor: usize) -> Cow<'_, Row> {
        let mut theta = [0.0; 2];
        theta[motor] = 1.0;
        let motors = self.motions(&self.testbed.motors.sensitivity(theta));
        let follows = !self.start.is_over && self.start.at_rest;
        if motors.rate[motor] == 0.0 && !follows {
            return Cow::Borrowed(&self.jacobian[motor]);
        }
        let x = if follows { self.start.from(motors.angle) } else { State::default() };
        Cow::Owned(self.moving(&Instant { x, motors }).into())
    }

    fn sensitivities_to_rate(&self, motor: usize) -> &Row {
        let takes_omega =
            self.interface == Interface::ModelExchange || self.testbed.motors.takes_omega(motor);
        if takes_omega { &self.jacobian[2 + motor] } else { &[0.0; _] }
    }

    /// Returns the partial derivatives with respect to angles and rates of the motors and to the states.
    fn jacobian(&self) -> [Row; 10] {
        std::array::from_fn(|column| {
            let mut unit = Instant::default();
            match column {
                0 | 1 => unit.motors.angle[column] = 1.0,
                2 | 3 => unit.motors.rate[column - 2] = 1.0,
                _ => unit.x[column - 4] = 1.0,
            }
            self.moving(&unit).into()
        })
    }

    /// Returns the values of the variables at an instant. The values are linear functions of the states and of
    /// the motor motion.
    #[inline]
    fn moving(&self, instant: &Instant) -> Moving {
        let system = self.system();
        let Instant { x: [theta3, theta4, theta5, theta6, omega5, omega6], motors } = *instant;
        let ([theta1, theta2], [omega1, omega2]) = (motors.angle.array(), motors.rate.array());
        let [[tau1, tau2], [der_theta3, der_theta4], [der_omega5, der_omega6]] =
            [instant.torques(system), instant.shaft_rates(system), instant.accelerations(system)]
                .map(Pair::array);
        let [pitch, roll] = [instant.pitch(system), instant.roll(system)];
        let [pitch_rate, roll_rate] = [instant.pitch_rate(system), instant.roll_rate(system)];
        Moving {
            theta1,
            theta2,
            omega1,
            omega2,
            tau1,
            tau2,
            pitch,
            roll,
            pitch_rate,
            roll_rate,
            theta3,
            theta4,
            theta5,
            theta6,
            omega5,
            omega6,
            der_theta3,
            der_theta4,
            der_theta5: omega5,
            der_theta6: omega6,
            der_omega5,
            der_omega6,
        }
    }

    /// Returns the partial derivatives with respect to a parameter. The parameters of `unit` are the direction of
    /// the derivative: 1 for this parameter, 0 for all others.
    #[cold]
    #[inline(never)]
    fn sensitivities_to_parameter(&self, parameter: Name) -> Cow<'_, Row> {
        let mut unit = self.clone();
        unit.testbed.parameters = Parameters::ZERO;
        Self::TABLE[Self::index(parameter)].set(&mut unit, &1.0.into());
        let (now, system, change) = (self.now(), self.system(), &unit.testbed.parameters);
        let [tau1, tau2] = now.change_of_torques(system, change).array();
        let [der_theta3, der_theta4] = now.change_of_shaft_rates(system, change).array();
        let [der_omega5, der_omega6] = now.change_of_accelerations(system, change).array();
        let sensitivities =
            Moving { tau1, tau2, der_theta3, der_theta4, der_omega5, der_omega6, ..Moving::default() };
        Cow::Owned(sensitivities.into())
    }
}
