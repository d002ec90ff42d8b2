//! Value references of both FMI versions.

use fmi_abi::Standard;

/// A value reference: a number from which the index of a variable follows. The index is in the table, or after it for
/// the additional variables of FMI 3.0.
pub(crate) trait Reference: Copy {
    /// Whether a reference may denote a whole array.
    const ARRAYS: bool;
    /// Name that the FMI standard gives to the array of references.
    const REFERENCES: &str;
    /// Name that the FMI standard gives to the array of values.
    const VALUES: &str;

    fn index(self) -> u32;

    /// Casts the importer's array of numbers to an array of this type, which has the same layout.
    fn cast(array: *const u32) -> *const Self;
}

/// Value reference of FMI 2.0: the index itself.
impl Reference for u32 {
    const ARRAYS: bool = false;
    const REFERENCES: &str = "vr";
    const VALUES: &str = "value";

    #[inline]
    fn cast(array: *const u32) -> *const Self {
        array
    }

    #[inline]
    fn index(self) -> u32 {
        self
    }
}

/// Value reference of FMI 3.0, which counts from 1.
#[derive(Clone, Copy)]
#[repr(transparent)]
pub(crate) struct FromOne(u32);

impl Reference for FromOne {
    const ARRAYS: bool = true;
    const REFERENCES: &str = "valueReferences";
    const VALUES: &str = "values";

    #[inline]
    fn cast(array: *const u32) -> *const Self {
        array.cast()
    }

    #[inline]
    fn index(self) -> u32 {
        self.0.wrapping_sub(Standard::Fmi3.reference(0))
    }
}
