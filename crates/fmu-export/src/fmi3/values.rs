//! Values of variables (section 2.2.7.2).
//!
//! # Safety
//! As in the [module above](super): each argument is what the standard says it is.

use super::common::same;
use super::{FromOne, types::*};
use crate::boundary::{array, get_texts, output, set_texts};
use crate::export::Exported;
use crate::instance::{Instance, Outcome};
use crate::value::Value;
use fmi_abi::BaseType;
use std::mem::MaybeUninit;

/// The importer's arrays for values that it reads. All variables are scalars: there are as many values as variables.
///
/// # Safety
/// Each is NULL or an array of its length; nobody else uses the values for `'a`.
#[inline]
unsafe fn to_write<'a, T>(
    vr: *const fmi3ValueReference,
    count: usize,
    values: *mut T,
    value_count: usize,
) -> Outcome<(&'a [FromOne], &'a mut [MaybeUninit<T>])> {
    same("values", count, value_count)?;
    // SAFETY: the caller's promise.
    Ok(unsafe { (array(vr.cast(), count, "valueReferences")?, output(values, value_count, "values")?) })
}

/// The importer's arrays of values that it sets.
///
/// # Safety
/// Each is NULL or an array of its length, which stays as it is for `'a`.
#[inline]
unsafe fn to_read<'a, T>(
    vr: *const fmi3ValueReference,
    count: usize,
    values: *const T,
    value_count: usize,
) -> Outcome<(&'a [FromOne], &'a [T])> {
    same("values", count, value_count)?;
    // SAFETY: the caller's promise.
    Ok(unsafe { (array(vr.cast(), count, "valueReferences")?, array(values, value_count, "values")?) })
}

#[inline]
pub unsafe fn fmi3GetFloat64<M: Exported>(
    instance: &mut Instance<M>,
    vr: *const fmi3ValueReference,
    count: usize,
    values: *mut fmi3Float64,
    value_count: usize,
) -> Outcome {
    // SAFETY: by contract arrays of these lengths that do not overlap.
    let (vr, values) = unsafe { to_write(vr, count, values, value_count) }?;
    instance.get_reals(vr, values)
}

#[inline]
pub unsafe fn fmi3SetFloat64<M: Exported>(
    instance: &mut Instance<M>,
    vr: *const fmi3ValueReference,
    count: usize,
    values: *const fmi3Float64,
    value_count: usize,
) -> Outcome {
    // SAFETY: by contract arrays of these lengths.
    let (vr, values) = unsafe { to_read(vr, count, values, value_count) }?;
    instance.set_reals(vr, values)
}

/// Numbers of one type: `Value` has them in a wider one, and no value is outside of the narrow one.
macro_rules! numbers {
    ($($get:ident $set:ident $type:ty: $($base:ident)|+, $kind:ident, $narrow:expr;)+) => {
        $(
            pub unsafe fn $get<M: Exported>(
                instance: &mut Instance<M>,
                vr: *const fmi3ValueReference,
                count: usize,
                values: *mut $type,
                value_count: usize,
            ) -> Outcome {
                // SAFETY: by contract arrays of these lengths that do not overlap.
                let (vr, values) = unsafe { to_write(vr, count, values, value_count) }?;
                instance.get(vr, &[$(BaseType::$base),+], |place, value| {
                    if let Value::$kind(value) = value {
                        values[place].write($narrow(value));
                    }
                })
            }

            pub unsafe fn $set<M: Exported>(
                instance: &mut Instance<M>,
                vr: *const fmi3ValueReference,
                count: usize,
                values: *const $type,
                value_count: usize,
            ) -> Outcome {
                // SAFETY: by contract arrays of these lengths.
                let (vr, values) = unsafe { to_read(vr, count, values, value_count) }?;
                let values = values.iter().map(|value| Value::$kind((*value).into()));
                instance.set(vr, &[$(BaseType::$base),+], values)
            }
        )+
    };
}

/// The number, which its type has.
fn whole<T: TryFrom<i128> + Default>(number: i128) -> T {
    T::try_from(number).unwrap_or_default()
}

numbers! {
    fmi3GetFloat32 fmi3SetFloat32 fmi3Float32: Float32, Real, |value| value as f32;
    fmi3GetInt8 fmi3SetInt8 fmi3Int8: Int8, Integer, whole;
    fmi3GetUInt8 fmi3SetUInt8 fmi3UInt8: UInt8, Integer, whole;
    fmi3GetInt16 fmi3SetInt16 fmi3Int16: Int16, Integer, whole;
    fmi3GetUInt16 fmi3SetUInt16 fmi3UInt16: UInt16, Integer, whole;
    fmi3GetInt32 fmi3SetInt32 fmi3Int32: Integer, Integer, whole;
    fmi3GetUInt32 fmi3SetUInt32 fmi3UInt32: UInt32, Integer, whole;
    // An Enumeration goes through the functions of Int64 (section 2.2.7.2).
    fmi3GetInt64 fmi3SetInt64 fmi3Int64: Int64 | Enumeration, Integer, whole;
    fmi3GetUInt64 fmi3SetUInt64 fmi3UInt64: UInt64, Integer, whole;
}

pub unsafe fn fmi3GetBoolean<M: Exported>(
    instance: &mut Instance<M>,
    vr: *const fmi3ValueReference,
    count: usize,
    values: *mut fmi3Boolean,
    value_count: usize,
) -> Outcome {
    // SAFETY: by contract arrays of these lengths that do not overlap.
    let (vr, values) = unsafe { to_write(vr, count, values, value_count) }?;
    instance.get(vr, &[BaseType::Boolean], |place, value| {
        values[place].write(fmi3Boolean::from(value == Value::Boolean(true)));
    })
}

pub unsafe fn fmi3SetBoolean<M: Exported>(
    instance: &mut Instance<M>,
    vr: *const fmi3ValueReference,
    count: usize,
    values: *const fmi3Boolean,
    value_count: usize,
) -> Outcome {
    // SAFETY: by contract arrays of these lengths.
    let (vr, values) = unsafe { to_read(vr, count, values, value_count) }?;
    if let Some(place) = values.iter().position(|value| *value > 1) {
        return instance.refuse_value(vr, &[BaseType::Boolean], place, |name| {
            format!("{name} must be 0 (false) or 1 (true), it is {}", values[place])
        });
    }
    instance.set(vr, &[BaseType::Boolean], values.iter().map(|value| Value::Boolean(*value == fmi3True)))
}

pub unsafe fn fmi3GetString<M: Exported>(
    instance: &mut Instance<M>,
    vr: *const fmi3ValueReference,
    count: usize,
    values: *mut fmi3String,
    value_count: usize,
) -> Outcome {
    // SAFETY: by contract arrays of these lengths that do not overlap.
    let (vr, values) = unsafe { to_write(vr, count, values, value_count) }?;
    get_texts(instance, vr, values)
}

pub unsafe fn fmi3SetString<M: Exported>(
    instance: &mut Instance<M>,
    vr: *const fmi3ValueReference,
    count: usize,
    values: *const fmi3String,
    value_count: usize,
) -> Outcome {
    // SAFETY: by contract arrays of these lengths.
    let (vr, values) = unsafe { to_read(vr, count, values, value_count) }?;
    // SAFETY: by contract strings.
    unsafe { set_texts(instance, vr, values) }
}

/// The bytes are the instance's until the next call on it.
pub unsafe fn fmi3GetBinary<M: Exported>(
    instance: &mut Instance<M>,
    vr: *const fmi3ValueReference,
    count: usize,
    sizes: *mut usize,
    values: *mut fmi3Binary,
    value_count: usize,
) -> Outcome {
    // SAFETY: by contract arrays of these lengths that do not overlap.
    let ((vr, values), sizes) =
        unsafe { (to_write(vr, count, values, value_count)?, output(sizes, value_count, "valueSizes")?) };
    let mut found = Vec::with_capacity(count);
    instance.get(vr, &[BaseType::Binary], |_, value| {
        if let Value::Binary(bytes) = value {
            found.push(bytes);
        }
    })?;
    for ((bytes, size), value) in found.iter().zip(sizes).zip(values) {
        size.write(bytes.len());
        value.write(bytes.as_ptr());
    }
    instance.bytes = found;
    Ok(())
}

pub unsafe fn fmi3SetBinary<M: Exported>(
    instance: &mut Instance<M>,
    vr: *const fmi3ValueReference,
    count: usize,
    sizes: *const usize,
    values: *const fmi3Binary,
    value_count: usize,
) -> Outcome {
    // SAFETY: by contract arrays of these lengths.
    let ((vr, values), sizes) =
        unsafe { (to_read(vr, count, values, value_count)?, array(sizes, value_count, "valueSizes")?) };
    let mut bytes = Vec::with_capacity(count);
    for ((vr, size), value) in vr.iter().zip(sizes).zip(values) {
        let name = instance.name(*vr, BaseType::Binary)?;
        // SAFETY: by contract NULL or an array of this length.
        bytes.push(Value::Binary(unsafe { array(*value, *size, name) }?.to_vec()));
    }
    instance.set(vr, &[BaseType::Binary], bytes.iter().cloned())
}
