#![doc = include_str!("../README.md")]
//!
//! ## Structure of the crate
//!
//! `fmu` reads the FMUs, `system` checks the connections, `ssp` and `osp` write the files.

mod fmu;
mod osp;
mod ssp;
mod system;

pub use system::{CheckedSystem, System};
