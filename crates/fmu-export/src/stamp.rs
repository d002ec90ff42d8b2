//! The values that fmu-package writes into the compiled library: the guid, and start values of a variant.
#![allow(
    unsafe_code,
    reason = "fmu-package changes these values, so the compiler must not assume the compiled ones"
)]

use crate::export::Exported;
use crate::hash::{EMPTY, fnv1a};
use crate::model::{Error, Setup};
use crate::table::Variables;
use fmi_abi::stamp::Stamp;
use fmi_abi::{BaseType, Value};

/// Returns the stamp of a model as it is in the library.
pub(crate) fn stamp<M: Exported>() -> &'static Stamp {
    let stamp = M::stamp();
    // SAFETY: reads a local variable. Because the read is volatile, the compiler does not know that the reference leads to the static whose
    // bytes it has seen, and which fmu-package changes.
    unsafe { (&raw const stamp).read_volatile() }
}

/// Returns the guid of the FMU to which this library belongs. It consists of zeros until fmu-package has packed the library.
pub fn guid<M: Exported>() -> String {
    stamp::<M>().guid().to_owned()
}

/// Creates a model with the start values of the FMU: start values in the stamp replace the values that
/// [`Model::new`](crate::Model::new) sets.
#[inline]
pub(crate) fn new_model<M: Exported>(setup: &Setup) -> Result<M, Error> {
    // Returns the model without moving it, because it may be large.
    if stamp::<M>().starts().next().is_none() { M::new(setup) } else { new_variant(setup) }
}

#[cold]
#[inline(never)]
fn new_variant<M: Exported>(setup: &Setup) -> Result<M, Error> {
    let mut model = M::new(setup)?;
    for (index, value) in stamp::<M>().starts() {
        let Some(variable) = M::TABLE.get(index as usize) else { continue };
        let value = match variable.base() {
            BaseType::Real | BaseType::Float32 => Value::Real(value),
            BaseType::Boolean => Value::Boolean(value != 0.0),
            _ => Value::Integer(value as _),
        };
        variable.set(&mut model, &value);
        model.calculate_start();
    }
    model.update()?;
    Ok(model)
}

/// Returns a hash of the lines of the table: names, types, causalities, variabilities and dimensions. Libraries in one FMU must agree in
/// these, because they share a description.
#[doc(hidden)]
pub const fn hash_of_interface<M: Variables>() -> u64 {
    let (mut hash, mut line) = (EMPTY, 0);
    while line < M::LINES.len() {
        let of = &M::LINES[line];
        hash = fnv1a(hash, of.name().as_bytes());
        hash = fnv1a(hash, &[of.base() as u8, of.causality() as u8, of.variability() as u8]);
        let (sizes, mut direction) = (of.dimensions(), 0);
        while direction < sizes.len() {
            hash = fnv1a(hash, &(sizes[direction] as u64).to_le_bytes());
            direction += 1;
        }
        line += 1;
    }
    hash
}
