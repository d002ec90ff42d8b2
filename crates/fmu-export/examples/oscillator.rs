//! The test model `Oscillator` as a shared library, which the C programs of the tests load.

#[path = "../../fmu-test-kit/src/models/oscillator.rs"]
mod oscillator;

fmu_export::symbols!(oscillator::Oscillator);
