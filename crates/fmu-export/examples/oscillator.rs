//! The oscillator of the tests as a shared library, for C programs.

#[path = "../tests/models/oscillator.rs"]
mod oscillator;

fmu_export::symbols!(oscillator::Oscillator);
