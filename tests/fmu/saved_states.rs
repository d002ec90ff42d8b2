//! Serialized states (section 2.1.8 of FMI 2.0) with an impossible number of samples, or with impossible times between
//! them, are rejected.

use crate::{TABLE, in_mode};
use fmu_export::BaseType;
use fmu_export::Interface::CoSimulation;
use fmu_export::Mode::*;
use fmu_test_kit::Either;
use fmu_test_kit::serialized::{VALUES, with};
use std::ops::Range;

/// Returns the range of a variable's value in the bytes of a state. The `memory` fields of the model follow the last
/// variable.
fn range_of(vr: u32) -> Range<usize> {
    let stored = TABLE[..vr as usize].iter().filter(|variable| variable.has_start() || variable.is_state());
    let length = |base| if base == BaseType::Boolean { 1 } else { 8 };
    let begin = VALUES + stored.map(|variable| length(variable.base())).sum::<usize>();
    begin..begin + 8
}

/// Checks impossible values of the first two `memory` fields: the number of samples, and the time between the last two.
#[test]
fn impossible_number_of_samples() {
    let fmu = in_mode(CoSimulation, StepComplete);
    fmu.step(0.0, 0.125);
    fmu.step(0.125, 0.125);
    let (bytes, samples) = (fmu.bytes(), range_of(TABLE.len() as u32));
    assert_eq!(bytes[samples.clone()], 2_i64.to_le_bytes());
    for count in [-1, i64::from(i32::MIN), 3, i64::MAX] {
        fmu.rejected_bytes(&with(bytes.clone(), samples.clone(), &count.to_le_bytes()));
    }
    for step in [0.0, -0.125] {
        let last_step = samples.end..samples.end + 8;
        let message = fmu.rejected_bytes(&with(bytes.clone(), last_step, &f64::to_le_bytes(step)));
        assert!(message.contains("samples"), "{message}");
    }
}
