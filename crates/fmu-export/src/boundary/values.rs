//! Getters and setters, which exchange values with arrays of the importer (section 2.1.7 of FMI 2.0, 2.2.7.2 of FMI
//! 3.0).

use super::{reserve, string};
use crate::export::Exported;
use crate::instance::{Instance, Outcome, Reference};
use fmi_abi::BaseType;
use fmi_abi::Value;
use fmi_abi::c_types::c_char;
use std::ffi::{CStr, CString};
use std::fmt::Display;
use std::mem::MaybeUninit;

/// Defines the getters and setters of an FMI version under their C names. Each entry contains the names of a getter and
/// a setter, each followed by the function below that implements it, then the C type and the base types of the
/// variables. In FMI 3.0 the functions also take the number of values.
macro_rules! getters_and_setters {
    (
        $reference:ty, $value_count:tt;
        $($get:ident $get_values:ident, $set:ident $set_values:ident, $type:ty: $bases:expr;)+
    ) => {
        $(
            getters_and_setters! {
                @each $reference, $value_count, $get $get_values, $set $set_values, $type, $bases
            }
        )+
    };
    (
        @each $reference:ty, [$($value_count:ident)?],
        $get:ident $get_values:ident, $set:ident $set_values:ident, $type:ty, $bases:expr
    ) => {
        #[inline]
        pub unsafe fn $get<M: Exported>(
            instance: &mut Instance<M>,
            vr: *const u32,
            count: usize,
            values: *mut $type
            $(, $value_count: usize)?
        ) -> Outcome {
            use crate::boundary::{apart, in_slice, of_elements, out_slice, same};
            use crate::instance::Reference;
            let value_count = [$($value_count,)? count][0];
            let are_apart =
                || apart((vr, count, <$reference>::REFERENCES), (values, value_count, <$reference>::VALUES));
            // SAFETY: by contract, the pointers are NULL or point to arrays of these lengths. `apart` has
            // compared them.
            unsafe {
                if M::ARRAYS && <$reference>::ARRAYS {
                    return of_elements::<M, $reference>(instance, vr, count, value_count, |instance, vr| {
                        are_apart()?;
                        $get_values(instance, vr, out_slice(values, value_count, <$reference>::VALUES)?, &$bases)
                    });
                }
                same("values", count, value_count)?;
                are_apart()?;
                let vr: &[$reference] = in_slice(<$reference>::cast(vr), count, <$reference>::REFERENCES)?;
                $get_values(instance, vr, out_slice(values, value_count, <$reference>::VALUES)?, &$bases)
            }
        }

        #[inline]
        pub unsafe fn $set<M: Exported>(
            instance: &mut Instance<M>,
            vr: *const u32,
            count: usize,
            values: *const $type
            $(, $value_count: usize)?
        ) -> Outcome {
            use crate::boundary::{in_slice, of_elements, same};
            use crate::instance::Reference;
            let value_count = [$($value_count,)? count][0];
            // SAFETY: by contract, the pointers are NULL or point to arrays of these lengths; `char` pointers are
            // NULL or strings.
            unsafe {
                if M::ARRAYS && <$reference>::ARRAYS {
                    return of_elements::<M, $reference>(instance, vr, count, value_count, |instance, vr| {
                        $set_values(instance, vr, in_slice(values, value_count, <$reference>::VALUES)?, &$bases)
                    });
                }
                same("values", count, value_count)?;
                let vr: &[$reference] = in_slice(<$reference>::cast(vr), count, <$reference>::REFERENCES)?;
                $set_values(instance, vr, in_slice(values, value_count, <$reference>::VALUES)?, &$bases)
            }
        }
    };
}
pub(crate) use getters_and_setters;

#[inline]
pub(crate) fn get_reals<M: Exported, R: Reference>(
    instance: &mut Instance<M>,
    vr: &[R],
    values: &mut [MaybeUninit<f64>],
    _: &[BaseType],
) -> Outcome {
    instance.get_reals(vr, values)
}

#[inline]
pub(crate) fn set_reals<M: Exported, R: Reference>(
    instance: &mut Instance<M>,
    vr: &[R],
    values: &[f64],
    _: &[BaseType],
) -> Outcome {
    instance.set_reals(vr, values)
}

pub(crate) fn get_float32<M: Exported, R: Reference>(
    instance: &mut Instance<M>,
    vr: &[R],
    values: &mut [MaybeUninit<f32>],
    bases: &[BaseType],
) -> Outcome {
    instance.get(vr, bases, &mut |index, value| {
        if let Value::Real(value) = value {
            values[index].write(value as f32);
        }
    })
}

pub(crate) fn set_float32<M: Exported, R: Reference>(
    instance: &mut Instance<M>,
    vr: &[R],
    values: &[f32],
    bases: &[BaseType],
) -> Outcome {
    instance.set(vr, bases, &|index| Value::Real(values[index].into()))
}

/// Gets integers. `Value` stores them in a wider type, but each one fits into the type of its variable.
pub(crate) fn get_integers<M: Exported, R: Reference, T: TryFrom<i128> + Default>(
    instance: &mut Instance<M>,
    vr: &[R],
    values: &mut [MaybeUninit<T>],
    bases: &[BaseType],
) -> Outcome {
    instance.get(vr, bases, &mut |index, value| {
        if let Value::Integer(value) = value {
            values[index].write(T::try_from(value).unwrap_or_default());
        }
    })
}

pub(crate) fn set_integers<M: Exported, R: Reference, T: Into<i128> + Copy>(
    instance: &mut Instance<M>,
    vr: &[R],
    values: &[T],
    bases: &[BaseType],
) -> Outcome {
    instance.set(vr, bases, &|index| Value::Integer(values[index].into()))
}

pub(crate) fn get_booleans<M: Exported, R: Reference, T: From<bool>>(
    instance: &mut Instance<M>,
    vr: &[R],
    values: &mut [MaybeUninit<T>],
    bases: &[BaseType],
) -> Outcome {
    instance.get(vr, bases, &mut |index, value| {
        values[index].write((value == Value::Boolean(true)).into());
    })
}

/// Sets Booleans. Because they are numbers in C, a caller may pass any number, so numbers other than 0 and 1 are
/// rejected.
pub(crate) fn set_booleans<M: Exported, R: Reference, T: From<bool> + PartialEq + Display>(
    instance: &mut Instance<M>,
    vr: &[R],
    values: &[T],
    bases: &[BaseType],
) -> Outcome {
    instance.check_types(vr, bases)?;
    let known = [false, true].map(T::from);
    if let Some(index) = values.iter().position(|value| !known.contains(value)) {
        return instance.reject_value(vr, bases, index, |name| {
            format!("{name} must be 0 (false) or 1 (true), it is {}", values[index])
        });
    }
    instance.set(vr, bases, &|index| Value::Boolean(values[index] == known[1]))
}

/// Gets strings. The instance owns the strings, and they are valid at least until the next call on it.
pub(crate) fn get_strings<M: Exported, R: Reference>(
    instance: &mut Instance<M>,
    vr: &[R],
    values: &mut [MaybeUninit<*const c_char>],
    bases: &[BaseType],
) -> Outcome {
    instance.check_types(vr, bases)?;
    let mut strings = Vec::new();
    reserve(&mut strings, vr.len())?;
    instance.get(vr, bases, &mut |_, value| {
        if let Value::String(value) = value {
            // Replaces NULs, because C would read a NUL as the end of the string.
            strings.push(CString::new(value.replace('\0', " ")).unwrap_or_default());
        }
    })?;
    values.iter_mut().zip(&strings).for_each(|(value, string)| {
        value.write(string.as_ptr());
    });
    instance.strings = strings;
    Ok(())
}

/// Sets strings.
///
/// # Safety
/// Each value is NULL or a NUL-terminated string.
pub(crate) unsafe fn set_strings<M: Exported, R: Reference>(
    instance: &mut Instance<M>,
    vr: &[R],
    values: &[*const c_char],
    bases: &[BaseType],
) -> Outcome {
    instance.check_types(vr, bases)?;
    // SAFETY: by contract, each value is NULL or a string.
    let text = |index: usize| unsafe { string(values[index]) }.map(CStr::to_str);
    for index in 0..values.len() {
        let fault = match text(index) {
            Some(Ok(_)) => continue,
            Some(Err(_)) => "not UTF-8",
            None => "NULL",
        };
        return instance.reject_value(vr, bases, index, |name| format!("the string for {name} is {fault}"));
    }
    instance.set(vr, bases, &|index| {
        Value::String(text(index).and_then(Result::ok).unwrap_or_default().to_owned())
    })
}
