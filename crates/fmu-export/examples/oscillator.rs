//! The oscillator of the tests as a shared library, for C programs.

#[path = "../tests/toys/oscillator.rs"]
mod oscillator;

fmu_export::fmi2_symbols!(oscillator::Oscillator);
fmu_export::fmi3_symbols!(oscillator::Oscillator);
