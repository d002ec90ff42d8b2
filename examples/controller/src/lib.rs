//! A controller for the pitch-roll wrist testbed, and the FMU made from it.
//!
//! [`Controller`] moves the two motors of the testbed so that the wrist reaches a reference pitch and roll. A PI
//! controller corrects the reference with measured pitch and roll. The inverse of eq. (1) of the testbed's paper then
//! gives the motor angles. Feedback of the measured rates damps vibration. Rate, acceleration and torque of the motors
//! are limited. The table of [`variables`] and `fmu.rs` define the FMU; the other modules do not depend on FMI.
//!
//! ```
//! use prw_controller::controller::Inputs;
//! use prw_controller::wrist::Kinematics;
//! use prw_controller::{Controller, Parameters};
//!
//! let mut controller = Controller::new(Parameters { Kp: 0.2, ..Parameters::DEFAULT })?;
//! // A rigid wrist: pitch and roll follow the motors without delay.
//! let wrist = Kinematics::new(4, 7);
//! for sample in 0..2000 {
//!     let motors = controller.motion();
//!     controller.inputs = Inputs {
//!         reference: [0.5, 1.0], // pitch and roll, rad
//!         angle: wrist.wrist(motors.map(|motor| motor.angle)),
//!         rate: wrist.wrist(motors.map(|motor| motor.rate)),
//!         torque: [0.0; 2],
//!     };
//!     assert!(controller.step(f64::from(sample) * 1e-3, 1e-3));
//! }
//! let motors = controller.motion();
//! let [pitch, roll] = wrist.wrist(motors.map(|motor| motor.angle));
//! assert!((pitch - 0.5).abs() < 1e-9 && (roll - 1.0).abs() < 1e-9);
//! assert!(motors.iter().all(|motor| motor.rate.abs() < 1e-9));
//! # Ok::<(), fmu_export::Error>(())
//! ```

pub mod controller;
mod fmu;
pub mod motor;
pub mod parameters;
pub mod variables;
pub mod wrist;

pub use controller::Controller;
pub use parameters::Parameters;

fmu_export::export_fmu!(Controller: CoSimulation + ModelExchange + InputDerivatives + OutputDerivatives + Partials);
