//! Short, complete test models that together use all features of FMI 2.0. Some, such as `Palette` and `Rod`, also use features that only FMI 3.0 has. Each begins with a comment on what it is for.
#![allow(missing_docs, reason = "the table of variables describes a model")]

#[path = "../../../fmu-package/models/ball/src/ball.rs"]
pub mod ball;
pub mod clumsy;
pub mod counter;
pub mod faulty;
pub mod fuse;
pub mod lazy;
pub mod meter;
#[path = "../../../fmu-package/models/motor/src/motor.rs"]
pub mod motor;
pub mod oscillator;
pub mod palette;
pub mod rod;
pub mod talker;

pub use ball::Ball;
pub use clumsy::{Clumsy, ClumsyOnHeap};
pub use counter::Counter;
pub use faulty::Faulty;
pub use fuse::Fuse;
pub use lazy::Lazy;
pub use meter::Meter;
pub use motor::Motor;
pub use oscillator::Oscillator;
pub use palette::Palette;
pub use rod::Rod;
pub use talker::Talker;

fmu_export::offer!(Ball: CoSimulation + ModelExchange);
fmu_export::offer!(Motor: CoSimulation + ModelExchange);
