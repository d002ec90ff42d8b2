//! Where values are in a serialized state.

use crate::TABLE;
use fmu_export::BaseType;
use fmu_test_kit::serialized::VALUES;
use std::ops::Range;

/// Where the value of a variable is; after the last one what the model remembers besides.
pub fn place_of(vr: u32) -> Range<usize> {
    let stored = TABLE[..vr as usize].iter().filter(|variable| variable.has_start() || variable.is_state());
    let length = |base| if base == BaseType::Boolean { 1 } else { 8 };
    let begin = VALUES + stored.map(|variable| length(variable.base())).sum::<usize>();
    begin..begin + 8
}
