#![doc = include_str!("../README.md")]
//!
//! ## Inside
//!
//! `fmu` has what an FMU says of itself, `system` checks the wiring against it; `ssp` and `osp` write.

mod fmu;
mod osp;
mod ssp;
mod system;

pub use system::{CheckedSystem, System};
