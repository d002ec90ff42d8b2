//! Functions that always return an error with the reason, because this crate does not support their features: clocks,
//! Scheduled Execution, and dependencies of single array elements.

use super::types::*;
use crate::export::Exported;
use crate::instance::{Instance, Outcome, reject};

macro_rules! absent {
    ($reason:literal: $($function:ident($($type:ty),*);)+) => {
        $(
            pub unsafe fn $function<M: Exported>(_: &mut Instance<M> $(, _: $type)*) -> Outcome {
                reject($reason)
            }
        )+
    };
}

absent! { "this FMU has no clocks":
    fmi3GetClock(*const fmi3ValueReference, usize, *mut fmi3Clock);
    fmi3SetClock(*const fmi3ValueReference, usize, *const fmi3Clock);
    fmi3GetIntervalDecimal(*const fmi3ValueReference, usize, *mut fmi3Float64, *mut fmi3IntervalQualifier);
    fmi3GetIntervalFraction(
        *const fmi3ValueReference, usize, *mut fmi3UInt64, *mut fmi3UInt64, *mut fmi3IntervalQualifier
    );
    fmi3GetShiftDecimal(*const fmi3ValueReference, usize, *mut fmi3Float64);
    fmi3GetShiftFraction(*const fmi3ValueReference, usize, *mut fmi3UInt64, *mut fmi3UInt64);
    fmi3SetIntervalDecimal(*const fmi3ValueReference, usize, *const fmi3Float64);
    fmi3SetIntervalFraction(*const fmi3ValueReference, usize, *const fmi3UInt64, *const fmi3UInt64);
    fmi3SetShiftDecimal(*const fmi3ValueReference, usize, *const fmi3Float64);
    fmi3SetShiftFraction(*const fmi3ValueReference, usize, *const fmi3UInt64, *const fmi3UInt64);
}

absent! { "this FMU has no Scheduled Execution":
    fmi3ActivateModelPartition(fmi3ValueReference, fmi3Float64);
}

absent! { "modelDescription.xml contains all dependencies (providesPerElementDependencies is false)":
    fmi3GetNumberOfVariableDependencies(fmi3ValueReference, *mut usize);
    fmi3GetVariableDependencies(
        fmi3ValueReference, *mut usize, *mut fmi3ValueReference, *mut usize, *mut fmi3DependencyKind, usize
    );
}
