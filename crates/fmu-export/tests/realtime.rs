//! The control loop of the oscillator.
#![allow(missing_docs)]

mod toys;

fmu_test_kit::control_loop!(toys::Oscillator);

#[cfg(rtsan)]
#[test]
#[ignore = "the sanitizer must end it, and does if make sanitize goes on"]
fn allocation_is_caught() {
    let _context = fmu_test_kit::realtime::sanitizer::enter();
    drop(std::hint::black_box(Box::new(1)));
}
