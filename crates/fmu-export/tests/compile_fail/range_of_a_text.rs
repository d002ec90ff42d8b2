//! A text has no range.
use fmu_export::*;

pub const TEXT: Type = STRING.min(0.0);

fn main() {}
