//! The testbed as an importer has it: with an interface type, and with what several of its variables share.

use crate::decoupled::Decoupled;
use crate::instant::{Instant, torques};
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
    /// Sensor torques, of the last time they were calculated.
    pub(crate) torques: Sides,
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
        let Self { testbed, interface, start, torques, jacobian } = source;
        if self.testbed.parameters != testbed.parameters {
            self.jacobian = *jacobian;
        }
        self.testbed.clone_from(testbed);
        (self.interface, self.start, self.torques) = (*interface, *start, *torques);
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

    /// Sensor torques. Most often they are read right after a step: all else is a call, which keeps this short.
    #[inline]
    pub(crate) fn torques_now(&self) -> Sides {
        let Testbed { motors, state, .. } = &self.testbed;
        if self.interface == Interface::CoSimulation && motors.are_at_path_end() {
            torques(state, &motors.path_end, self.system())
        } else {
            self.torques_otherwise()
        }
    }

    #[cold]
    #[inline(never)]
    fn torques_otherwise(&self) -> Sides {
        let Testbed { motors, state, .. } = &self.testbed;
        torques(state, &self.motions(motors), self.system())
    }

    /// Until the testbed has started, its state follows the motors, or what is given. Called after either was set.
    #[inline]
    pub(crate) fn follow(&mut self) {
        if !self.start.is_over {
            self.testbed.state = self.start.from(self.testbed.motors.theta());
        }
    }

    /// State and motors now.
    #[inline]
    pub(crate) fn now(&self) -> Instant {
        Instant { x: self.testbed.state, motors: self.motions(&self.testbed.motors) }
    }
}
