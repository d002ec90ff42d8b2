//! Partial and time derivatives, which are written to arrays of the importer.

use super::{apart, in_slice, out_slice, reserve, same};
use crate::export::Exported;
use crate::instance::{Instance, Outcome, Reference, elements_of};
use std::mem::MaybeUninit;

/// Computes directional derivatives, or adjoint derivatives if `ADJOINT` is true (section 2.1.9 of FMI 2.0, 2.2.12 of
/// FMI 3.0). The last four arguments are arrays with their lengths; `names` contains their names for messages.
///
/// # Safety
/// Each array is NULL or has the given length.
#[inline]
pub(crate) unsafe fn partial_derivatives<M: Exported, R: Reference, const ADJOINT: bool>(
    instance: &mut Instance<M>,
    names: [&str; 4],
    unknown: (*const u32, usize),
    known: (*const u32, usize),
    seed: (*const f64, usize),
    result: (*mut f64, usize),
) -> Outcome {
    let (seed_count, result_count) = (seed.1, result.1);
    // SAFETY: the caller guarantees the arrays and their lengths.
    let (unknown, known, seed) = unsafe {
        (
            in_slice(R::cast(unknown.0), unknown.1, names[0])?,
            in_slice(R::cast(known.0), known.1, names[1])?,
            in_slice(seed.0, seed.1, names[2])?,
        )
    };
    let counts =
        [("unknowns", instance.count_elements(unknown)?), ("knowns", instance.count_elements(known)?)];
    let [wanted, seeded] = if ADJOINT { [counts[1], counts[0]] } else { counts };
    same(seeded.0, seeded.1, seed_count)?;
    same(wanted.0, wanted.1, result_count)?;
    let written = (result.0.cast_const(), result_count, names[3]);
    apart((unknown.as_ptr(), unknown.len(), names[0]), written)?;
    apart((known.as_ptr(), known.len(), names[1]), written)?;
    apart((seed.as_ptr(), seed_count, names[2]), written)?;
    // SAFETY: the caller guarantees the array and its length, and it does not overlap the others.
    let result = unsafe { out_slice(result.0, result_count, names[3]) }?;
    // More references than variables may be a wrong length, so they are checked before the first write. Checking them always would
    // take a seventh of the instructions of a call.
    let wanted = if ADJOINT { known } else { unknown };
    if wanted.len() > M::TABLE.len() {
        instance.check_references(wanted)?;
    }
    result.fill(MaybeUninit::new(0.0));
    // SAFETY: all values have been written.
    let sums = unsafe { &mut *(std::ptr::from_mut(result) as *mut [f64]) };
    if M::ARRAYS && R::ARRAYS {
        let [unknown, known] =
            [elements::<M, R>(unknown, counts[0].1)?, elements::<M, R>(known, counts[1].1)?];
        return instance.derivatives::<_, ADJOINT>(&unknown, &known, seed, sums);
    }
    instance.derivatives::<_, ADJOINT>(unknown, known, seed, sums)
}

/// Returns the indices of all elements; `count` is their number.
fn elements<M: Exported, R: Reference>(vr: &[R], count: usize) -> Outcome<Vec<u32>> {
    let mut elements = Vec::new();
    reserve(&mut elements, count)?;
    elements.extend(vr.iter().flat_map(|vr| elements_of::<M>(vr.index())));
    Ok(elements)
}

/// Computes time derivatives of outputs (section 4.2.1 of FMI 2.0, 4.1.2 of FMI 3.0). `count` is the number of
/// references and of orders.
///
/// # Safety
/// Each array is NULL or has the given length.
pub(crate) unsafe fn output_derivatives<M: Exported, R: Reference>(
    instance: &mut Instance<M>,
    vr: *const u32,
    count: usize,
    (order, order_name): (*const i32, &str),
    value: *mut f64,
    value_count: usize,
) -> Outcome {
    // SAFETY: the caller guarantees the arrays and their lengths.
    let (vr, order) =
        unsafe { (in_slice(R::cast(vr), count, R::REFERENCES)?, in_slice(order, count, order_name)?) };
    same("values", instance.count_elements(vr)?, value_count)?;
    let written = (value.cast_const(), value_count, R::VALUES);
    apart((vr.as_ptr(), count, R::REFERENCES), written)?;
    apart((order.as_ptr(), count, order_name), written)?;
    // SAFETY: the caller guarantees the array and its length, and it does not overlap the others.
    let value = unsafe { out_slice(value, value_count, R::VALUES) }?;
    if M::ARRAYS && R::ARRAYS {
        // One order applies to the whole array (section 4.1.2 of FMI 3.0).
        let elements = elements::<M, R>(vr, value_count)?;
        let mut orders = Vec::new();
        reserve(&mut orders, value_count)?;
        for (vr, order) in vr.iter().zip(order) {
            orders.extend(elements_of::<M>(vr.index()).map(|_| *order));
        }
        return instance.get_output_derivatives(&elements, &orders, value);
    }
    instance.get_output_derivatives(vr, order, value)
}
