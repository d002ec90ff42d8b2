//! The testbed as an importer has it: with an interface type, and with what several of its variables share.

use crate::decoupled::Decoupled;
use crate::instant::{Instant, output_shaft, torques};
use crate::motor::{Motion, Motions, Motors};
use crate::pair::Sides;
use crate::start::Start;
use crate::testbed::Testbed;
use fmu_export::Interface;

/// The testbed in an FMU. Its [table of variables](crate::variables) says which variable is what.
#[derive(Debug)]
pub struct TestbedFmu {
    pub(crate) testbed: Testbed,
    pub(crate) interface: Interface,
    pub(crate) start: Start,
    /// Sensor torques, pitch and roll, pitch rate and roll rate, of the last time they were calculated.
    pub(crate) torques: [f64; 2],
    pub(crate) angles: [f64; 2],
    pub(crate) rates: [f64; 2],
    /// The partial derivatives of all that moves with respect to angles and rates of the motors and to the states; they
    /// follow from the parameters.
    pub(crate) jacobian: [Moving; 10],
}

/// A number for each variable before the parameters, in the order of the table.
pub(crate) type Moving = [f64; 22];

impl Clone for TestbedFmu {
    fn clone(&self) -> Self {
        Self { testbed: self.testbed.clone(), ..*self }
    }

    /// Passes on to the testbed, which copies little if the parameters are the same.
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

    /// The motion of these motors now. Model Exchange takes theta and omega as they are set (u of eq. (11));
    /// Co-Simulation knows the motors by their samples.
    #[inline]
    pub(crate) fn motions(&self, motors: &Motors) -> Motions {
        match self.interface {
            Interface::CoSimulation => motors.now(),
            Interface::ModelExchange => {
                Motion { angle: motors.theta(), rate: motors.omega(), ..Motions::default() }
            }
        }
    }

    /// Calculates the outputs with the motors in this motion.
    #[inline(always)]
    pub(crate) fn calculate_with(&mut self, motors: Motions) {
        let (state, system) = (&self.testbed.state, self.testbed.system());
        self.torques = torques(state, &motors, system).array();
        [self.angles, self.rates] = output_shaft(state, system).map(Sides::array);
    }

    /// State and motors now.
    #[inline]
    pub(crate) fn now(&self) -> Instant {
        Instant { x: self.testbed.state, motors: self.motions(&self.testbed.motors) }
    }
}
