//! The testbed with the values that the FMU needs in addition: the interface type, the start and the outputs.

use crate::decoupled::Decoupled;
use crate::instant::{Instant, output_shaft, torques};
use crate::motor::{Motion, Motions, Motors};
use crate::pair::PerSide;
use crate::start::Start;
use crate::testbed::{StateBySide, Testbed};
use fmu_export::Interface;

/// The testbed in an FMU. The [table of variables](crate::variables) maps its fields to variables.
#[derive(Debug)]
pub struct TestbedFmu {
    pub(crate) testbed: Testbed,
    pub(crate) interface: Interface,
    pub(crate) start: Start,
    /// Sensor torques `tau1` and `tau2`. Like the two fields below, they are updated when outputs are calculated.
    pub(crate) torques: [f64; 2],
    /// Pitch and roll.
    pub(crate) angles: [f64; 2],
    /// Pitch rate and roll rate.
    pub(crate) rates: [f64; 2],
    /// Partial derivatives with respect to angles and rates of the motors and to the states. They depend only
    /// on the parameters.
    pub(crate) jacobian: [Row; 10],
}

/// Passes the names of the Real variables that are linear functions of the states and of the motor motion to the macro
/// `$make`.
macro_rules! moving_variables {
    ($make:ident) => {
        $make! {
            theta1 theta2 omega1 omega2 tau1 tau2 pitch roll pitch_rate roll_rate theta3 theta4 theta5 theta6 omega5 omega6
            der_theta3 der_theta4 der_theta5 der_theta6 der_omega5 der_omega6
        }
    };
}
pub(crate) use moving_variables;

macro_rules! moving {
    ($($name:ident)+) => {
        /// Values of the variables in `moving_variables!`, or the derivatives of these variables.
        #[derive(Clone, Copy, Debug, Default)]
        pub(crate) struct Moving {
            $(pub $name: f64),+
        }

        /// The numbers of a [`Moving`] as an array, because reading one by its index is fast.
        pub(crate) type Row = [f64; [$(stringify!($name)),+].len()];

        impl From<Moving> for Row {
            #[inline(always)]
            fn from(moving: Moving) -> Self {
                [$(moving.$name),+]
            }
        }
    };
}
moving_variables!(moving);

impl Clone for TestbedFmu {
    fn clone(&self) -> Self {
        Self { testbed: self.testbed.clone(), ..*self }
    }

    /// Copies the testbed with [`Testbed::copy_from`], which copies only the state and the motors if the parameters are equal.
    fn clone_from(&mut self, source: &Self) {
        let Self { testbed, interface, start, torques, angles, rates, jacobian } = source;
        if self.testbed.copy_from(testbed) {
            self.jacobian = *jacobian;
        }
        (self.interface, self.start) = (*interface, *start);
        (self.torques, self.angles, self.rates) = (*torques, *angles, *rates);
    }
}

impl TestbedFmu {
    pub(crate) fn system(&self) -> &Decoupled {
        self.testbed.system()
    }

    /// Returns the current motion of these motors. Model Exchange takes theta and omega as the importer sets
    /// them (u of eq. (11)). Co-Simulation computes the motion with [`Motors::now`].
    #[inline]
    pub(crate) fn motions(&self, motors: &Motors) -> Motions {
        match self.interface {
            Interface::CoSimulation => motors.now(),
            Interface::ModelExchange => {
                Motion { angle: motors.theta(), rate: motors.omega(), ..Motions::default() }
            }
        }
    }

    /// Calculates the outputs for this state and motion of the motors.
    #[inline(always)]
    pub(crate) fn calculate_with(&mut self, state: StateBySide, motors: Motions) {
        let system = self.testbed.system();
        self.torques = torques(state, &motors, system).array();
        [self.angles, self.rates] = output_shaft(state, system).map(PerSide::array);
    }

    /// Returns the current state and motor motion.
    #[inline]
    pub(crate) fn now(&self) -> Instant {
        Instant { x: self.testbed.state, motors: self.motions(&self.testbed.motors) }
    }
}
