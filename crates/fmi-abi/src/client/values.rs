//! Values of variables: the getters and setters of each type in FMI 2.0 and FMI 3.0.
//!
//! `set_numbers` and `get_numbers` pass all numeric types as `f64`, which is fast to copy. `set_values` and `get_values` pass
//! [`Value`]s, which hold every type exactly. An array variable of FMI 3.0 has several values.

use super::instance::{Instance, call};
use super::rejection::Rejection;
use crate::c_types::{c_char, c_int};
use crate::calls::{Functions, string};
use crate::{BaseType, Standard, Value};
use std::ffi::CString;
use std::ptr::null;

/// A number type of the FMI functions, with conversions from and to `f64` and [`Value`].
trait Number: Copy + Default {
    fn from_f64(value: f64) -> Self;
    fn to_f64(self) -> f64;
    fn from_value(value: &Value) -> Self;
    fn to_value(self) -> Value;

    /// Converts `values` and calls a setter with them.
    #[inline]
    fn set(values: &[f64], setter: impl FnOnce(*const Self) -> c_int) -> c_int {
        with_buffer(values.len(), |numbers: &mut [Self]| {
            numbers.iter_mut().zip(values).for_each(|(number, value)| *number = Self::from_f64(*value));
            setter(numbers.as_ptr())
        })
    }

    /// Calls a getter and converts its results to `values`.
    #[inline]
    fn get(values: &mut [f64], getter: impl FnOnce(*mut Self) -> c_int) -> c_int {
        with_buffer(values.len(), |numbers: &mut [Self]| {
            let code = getter(numbers.as_mut_ptr());
            values.iter_mut().zip(numbers).for_each(|(value, number)| *value = number.to_f64());
            code
        })
    }

    /// Converts `values` and calls a setter with them.
    fn set_values(values: &[Value], setter: impl FnOnce(*const Self) -> c_int) -> c_int {
        let numbers: Vec<Self> = values.iter().map(Self::from_value).collect();
        setter(numbers.as_ptr())
    }

    /// Calls a getter and converts its results to `values`.
    fn get_values(values: &mut [Value], getter: impl FnOnce(*mut Self) -> c_int) -> c_int {
        let mut numbers = vec![Self::default(); values.len()];
        let code = getter(numbers.as_mut_ptr());
        values.iter_mut().zip(numbers).for_each(|(value, number)| *value = number.to_value());
        code
    }
}

/// Calls `body` with a buffer of this length, which is on the stack for up to 8 numbers.
#[inline]
fn with_buffer<T: Number>(length: usize, body: impl FnOnce(&mut [T]) -> c_int) -> c_int {
    match [T::default(); 8].get_mut(..length) {
        Some(few) => body(few),
        None => body(&mut vec![T::default(); length]),
    }
}

/// Converts a value to a number type. Strings and bytes become 0.
macro_rules! number_of {
    ($value:ident as $type:ty) => {
        match $value {
            Value::Real(number) => *number as $type,
            Value::Integer(number) => *number as $type,
            Value::Boolean(boolean) => u8::from(*boolean) as $type,
            Value::String(_) | Value::Binary(_) => 0 as $type,
        }
    };
}

macro_rules! number {
    ($kind:ident: $($type:ty)*) => { $(impl Number for $type {
        fn from_f64(value: f64) -> Self {
            value as Self
        }

        fn to_f64(self) -> f64 {
            self as f64
        }

        fn from_value(value: &Value) -> Self {
            number_of!(value as $type)
        }

        fn to_value(self) -> Value {
            Value::$kind(self.into())
        }
    })* };
}
number!(Real: f32);
number!(Integer: i8 u8 i16 u16 i32 u32 i64 u64);

impl Number for f64 {
    fn from_f64(value: f64) -> Self {
        value
    }

    fn to_f64(self) -> f64 {
        self
    }

    fn from_value(value: &Value) -> Self {
        number_of!(value as f64)
    }

    fn to_value(self) -> Value {
        Value::Real(self)
    }

    #[inline]
    fn set(values: &[f64], setter: impl FnOnce(*const Self) -> c_int) -> c_int {
        setter(values.as_ptr())
    }

    #[inline]
    fn get(values: &mut [f64], getter: impl FnOnce(*mut Self) -> c_int) -> c_int {
        getter(values.as_mut_ptr())
    }
}

/// Invokes the macro `$with` with the setter and the getter of a numeric base type in the FMI version of the library. For FMI 3.0 it
/// also passes `$n`, the number of values, which is the last argument of these functions.
macro_rules! functions {
    ($with:ident, $library:expr, $base:expr, $n:ident) => {
        match ($library.functions(), $base) {
            (Functions::Fmi2(f), BaseType::Real | BaseType::Float32) => $with!(f fmi2SetReal fmi2GetReal),
            (Functions::Fmi2(f), BaseType::Boolean) => $with!(f fmi2SetBoolean fmi2GetBoolean),
            (Functions::Fmi2(f), _) => $with!(f fmi2SetInteger fmi2GetInteger),
            (Functions::Fmi3(f), BaseType::Real) => $with!(f fmi3SetFloat64 fmi3GetFloat64 $n),
            (Functions::Fmi3(f), BaseType::Float32) => $with!(f fmi3SetFloat32 fmi3GetFloat32 $n),
            (Functions::Fmi3(f), BaseType::Integer) => $with!(f fmi3SetInt32 fmi3GetInt32 $n),
            (Functions::Fmi3(f), BaseType::Int8) => $with!(f fmi3SetInt8 fmi3GetInt8 $n),
            (Functions::Fmi3(f), BaseType::UInt8) => $with!(f fmi3SetUInt8 fmi3GetUInt8 $n),
            (Functions::Fmi3(f), BaseType::Int16) => $with!(f fmi3SetInt16 fmi3GetInt16 $n),
            (Functions::Fmi3(f), BaseType::UInt16) => $with!(f fmi3SetUInt16 fmi3GetUInt16 $n),
            (Functions::Fmi3(f), BaseType::UInt32) => $with!(f fmi3SetUInt32 fmi3GetUInt32 $n),
            (Functions::Fmi3(f), BaseType::UInt64) => $with!(f fmi3SetUInt64 fmi3GetUInt64 $n),
            (Functions::Fmi3(f), BaseType::Int64 | BaseType::Enumeration) => {
                $with!(f fmi3SetInt64 fmi3GetInt64 $n)
            }
            (Functions::Fmi3(f), _) => $with!(f fmi3SetBoolean fmi3GetBoolean $n),
        }
    };
}

impl Instance {
    /// Sets numeric variables of one type. Booleans are 0 or 1.
    ///
    /// # Errors
    /// The FMU rejects the values.
    ///
    /// # Panics
    /// Panics if there are fewer values than variables.
    #[inline]
    pub fn set_numbers(&mut self, base: BaseType, vr: &[u32], values: &[f64]) -> Result<(), Rejection> {
        let n = self.checked_count(vr, values.len());
        let (handle, pointer, count) = (self.handle("set")?, vr.as_ptr(), vr.len());
        macro_rules! set {
            ($functions:ident $set:ident $get:ident $($n:ident)?) => {
                // SAFETY: the instance is alive; the slices have the passed lengths.
                (stringify!($set), Number::set(values, |numbers| unsafe {
                    ($functions.$set)(handle, pointer, count, numbers $(, $n)?)
                }))
            };
        }
        let (function, code) = functions!(set, self.library, base, n);
        self.check(function, code)
    }

    /// Reads numeric variables of one type into `values`. Booleans are 0 or 1.
    ///
    /// # Errors
    /// The FMU rejects the call.
    ///
    /// # Panics
    /// Panics if there are fewer values than variables.
    #[inline]
    pub fn get_numbers(&mut self, base: BaseType, vr: &[u32], values: &mut [f64]) -> Result<(), Rejection> {
        let n = self.checked_count(vr, values.len());
        let (handle, pointer, count) = (self.handle("get")?, vr.as_ptr(), vr.len());
        macro_rules! get {
            ($functions:ident $set:ident $get:ident $($n:ident)?) => {
                // SAFETY: the instance is alive; the slices have the passed lengths.
                (stringify!($get), Number::get(values, |numbers| unsafe {
                    ($functions.$get)(handle, pointer, count, numbers $(, $n)?)
                }))
            };
        }
        let (function, code) = functions!(get, self.library, base, n);
        if base == BaseType::Boolean {
            values.iter_mut().for_each(|value| *value = f64::from(u8::from(*value != 0.0)));
        }
        self.check(function, code)
    }

    /// Checks that there are at least as many values as variables, and returns the number of values. In FMI 3.0 there
    /// are more if variables are arrays.
    #[inline]
    fn checked_count(&self, vr: &[u32], values: usize) -> usize {
        assert!(values >= vr.len(), "{values} values for {} variables", vr.len());
        values
    }

    /// Sets variables of one type to exact values, i.e. without conversion to `f64`.
    ///
    /// # Errors
    /// The FMU rejects the values, a string contains NUL, or the type is Binary and the FMU is of FMI 2.0.
    ///
    /// # Panics
    /// Panics if there are fewer values than variables.
    pub fn set_values(&mut self, base: BaseType, vr: &[u32], values: &[Value]) -> Result<(), Rejection> {
        let n = self.checked_count(vr, values.len());
        match base {
            BaseType::String => return self.set_strings(vr, values),
            BaseType::Binary => return self.set_binaries(vr, values),
            _ => {}
        }
        let (handle, pointer, count) = (self.handle("set")?, vr.as_ptr(), vr.len());
        macro_rules! set {
            ($functions:ident $set:ident $get:ident $($n:ident)?) => {
                // SAFETY: the instance is alive; the slices have the passed lengths.
                (stringify!($set), Number::set_values(values, |numbers| unsafe {
                    ($functions.$set)(handle, pointer, count, numbers $(, $n)?)
                }))
            };
        }
        let (function, code) = functions!(set, self.library, base, n);
        self.check(function, code)
    }

    /// Reads `n` values of variables of one type exactly, i.e. without conversion to `f64`. If some variables are
    /// arrays, there are more values than variables.
    ///
    /// # Errors
    /// The FMU rejects the call, or the type is Binary and the FMU is of FMI 2.0.
    ///
    /// # Panics
    /// Panics if there are fewer values than variables.
    pub fn get_values(&mut self, base: BaseType, vr: &[u32], n: usize) -> Result<Vec<Value>, Rejection> {
        self.checked_count(vr, n);
        match base {
            BaseType::String => return self.get_strings(vr, n),
            BaseType::Binary => return self.get_binaries(vr, n),
            _ => {}
        }
        let (handle, pointer, count) = (self.handle("get")?, vr.as_ptr(), vr.len());
        let mut values = vec![Value::Integer(0); n];
        macro_rules! get {
            ($functions:ident $set:ident $get:ident $($n:ident)?) => {
                // SAFETY: the instance is alive; the slices have the passed lengths.
                (stringify!($get), Number::get_values(&mut values, |numbers| unsafe {
                    ($functions.$get)(handle, pointer, count, numbers $(, $n)?)
                }))
            };
        }
        let (function, code) = functions!(get, self.library, base, n);
        self.check(function, code)?;
        if base == BaseType::Boolean {
            values.iter_mut().for_each(|value| *value = Value::Boolean(*value != Value::Integer(0)));
        }
        Ok(values)
    }

    fn set_strings(&mut self, vr: &[u32], values: &[Value]) -> Result<(), Rejection> {
        let strings: Result<Vec<_>, _> = values.iter().map(|value| CString::new(value.to_string())).collect();
        let Ok(strings) = strings else {
            return Err(self.own_rejection("set", "a string must not contain a character NUL".to_owned()));
        };
        let pointers: Vec<*const c_char> = strings.iter().map(|string| string.as_ptr()).collect();
        let (vr, count, strings, n) = (vr.as_ptr(), vr.len(), pointers.as_ptr(), pointers.len());
        call!(self, fmi2SetString(vr, count, strings), fmi3SetString(vr, count, strings, n))
    }

    fn get_strings(&mut self, vr: &[u32], n: usize) -> Result<Vec<Value>, Rejection> {
        let mut strings = vec![null::<c_char>(); n];
        let (vr, count, values) = (vr.as_ptr(), vr.len(), strings.as_mut_ptr());
        call!(self, fmi2GetString(vr, count, values), fmi3GetString(vr, count, values, n))?;
        // SAFETY: the strings belong to the FMU and are valid until the next call.
        let owned = |text| unsafe { string(text) }.unwrap_or_default().to_string_lossy().into_owned();
        Ok(strings.into_iter().map(|text| Value::String(owned(text))).collect())
    }

    fn set_binaries(&mut self, vr: &[u32], values: &[Value]) -> Result<(), Rejection> {
        let bytes = |value: &Value| match value {
            // The pointer is not NULL, even if the value is empty.
            Value::Binary(bytes) => (bytes.len(), bytes.as_ptr()),
            _ => (0, [].as_ptr()),
        };
        let (sizes, bytes): (Vec<usize>, Vec<*const u8>) = values.iter().map(bytes).unzip();
        let (vr, count) = (vr.as_ptr(), vr.len());
        call!(fmi3 self, fmi3SetBinary(vr, count, sizes.as_ptr(), bytes.as_ptr(), bytes.len()))
    }

    fn get_binaries(&mut self, vr: &[u32], n: usize) -> Result<Vec<Value>, Rejection> {
        let (mut sizes, mut values) = (vec![0_usize; n], vec![null::<u8>(); n]);
        let (vr, count) = (vr.as_ptr(), vr.len());
        call!(fmi3 self, fmi3GetBinary(vr, count, sizes.as_mut_ptr(), values.as_mut_ptr(), n))?;
        let bytes = |(value, size): (*const u8, usize)| {
            let mut bytes = Vec::new();
            if value.is_null() || size == 0 {
                return Ok(Value::Binary(bytes));
            }
            if bytes.try_reserve_exact(size).is_err() {
                let why = format!("the value has {size} bytes, for which there is not enough memory");
                return Err(self.own_rejection("fmi3GetBinary", why));
            }
            // SAFETY: the FMU returned this size, which the address space can contain; the bytes are valid until the next call.
            bytes.extend_from_slice(unsafe { std::slice::from_raw_parts(value, size) });
            Ok(Value::Binary(bytes))
        };
        values.into_iter().zip(sizes).map(bytes).collect()
    }

    /// Returns whether the FMI version has variables of this type.
    pub fn has_type(&self, base: BaseType) -> bool {
        self.standard() == Standard::Fmi3 || base.is_in_fmi2()
    }
}
