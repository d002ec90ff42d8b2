//! Derivatives in arrays of the importer's.

use super::{array, output, same};
use crate::export::Exported;
use crate::instance::{Direction, Instance, Outcome, Reference};

/// Partial derivatives (section 2.1.9 of FMI 2.0, 2.2.11 of FMI 3.0): unknowns, knowns, seed and result, each with its
/// length and called by `names`.
///
/// # Safety
/// Each is NULL or an array of its length; the result does not overlap the others.
pub(crate) unsafe fn partial_derivatives<M: Exported, R: Reference>(
    instance: &mut Instance<M>,
    names: [&str; 4],
    unknown: (*const u32, usize),
    known: (*const u32, usize),
    seed: (*const f64, usize),
    result: (*mut f64, usize),
    direction: Direction,
) -> Outcome {
    let (seeded, wanted) = match direction {
        Direction::Forward => (("knowns", known.1), ("unknowns", unknown.1)),
        Direction::Adjoint => (("unknowns", unknown.1), ("knowns", known.1)),
    };
    let (seed_count, result_count) = (seed.1, result.1);
    // SAFETY: the caller's promise.
    let (unknown, known, seed, result) = unsafe {
        (
            array(R::cast(unknown.0), unknown.1, names[0])?,
            array(R::cast(known.0), known.1, names[1])?,
            array(seed.0, seed.1, names[2])?,
            output(result.0, result.1, names[3])?,
        )
    };
    same(seeded.0, seeded.1, seed_count)?;
    same(wanted.0, wanted.1, result_count)?;
    instance.derivatives(unknown, known, seed, result, direction)
}

/// Time derivatives of outputs (section 4.2.2 of FMI 2.0, 4.2.4 of FMI 3.0).
///
/// # Safety
/// Each is NULL or an array of its length; the values do not overlap the others.
pub(crate) unsafe fn output_derivatives<M: Exported, R: Reference>(
    instance: &mut Instance<M>,
    vr: *const u32,
    count: usize,
    (order, order_name): (*const i32, &str),
    value: *mut f64,
    value_count: usize,
) -> Outcome {
    // SAFETY: the caller's promise.
    let (vr, order, value) = unsafe {
        (
            array(R::cast(vr), count, R::REFERENCES)?,
            array(order, count, order_name)?,
            output(value, value_count, R::VALUES)?,
        )
    };
    same("values", count, value_count)?;
    instance.get_output_derivatives(vr, order, value)
}
