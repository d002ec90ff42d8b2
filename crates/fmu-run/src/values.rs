//! Values of variables. Each type has its functions in FMI 2.0 and FMI 3.0; arrays are set and read at once.

use crate::instance::{Instance, call};
use crate::library::Functions;
use crate::rejection::Rejection;
use fmi_abi::BaseType;
use fmi_abi::c_types::c_int;
use fmi_abi::fmi3::types::fmi3String;
use std::ffi::{CStr, CString};
use std::ptr::null;
use std::sync::Arc;

/// Number type of an FMI function.
trait Number: Copy + Default {
    fn from_f64(value: f64) -> Self;
    fn to_f64(self) -> f64;

    /// Calls a setter with these values.
    #[inline]
    fn set(values: &[f64], setter: impl FnOnce(*const Self) -> c_int) -> c_int {
        with_buffer(values.len(), |numbers: &mut [Self]| {
            numbers.iter_mut().zip(values).for_each(|(number, value)| *number = Self::from_f64(*value));
            setter(numbers.as_ptr())
        })
    }

    /// Calls a getter for as many values.
    #[inline]
    fn get(values: &mut [f64], getter: impl FnOnce(*mut Self) -> c_int) -> c_int {
        with_buffer(values.len(), |numbers: &mut [Self]| {
            let code = getter(numbers.as_mut_ptr());
            values.iter_mut().zip(numbers).for_each(|(value, number)| *value = number.to_f64());
            code
        })
    }
}

/// Calls `body` with a buffer, which needs no allocation for a few numbers.
#[inline]
fn with_buffer<T: Number>(length: usize, body: impl FnOnce(&mut [T]) -> c_int) -> c_int {
    match [T::default(); 8].get_mut(..length) {
        Some(few) => body(few),
        None => body(&mut vec![T::default(); length]),
    }
}

macro_rules! number {
    ($($type:ty)*) => { $(impl Number for $type {
        fn from_f64(value: f64) -> Self {
            value as Self
        }

        fn to_f64(self) -> f64 {
            self as f64
        }
    })* };
}
number!(f32 i8 u8 i16 u16 i32 u32 i64 u64);

impl Number for f64 {
    fn from_f64(value: f64) -> Self {
        value
    }

    fn to_f64(self) -> f64 {
        self
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

/// Expands a macro with the setter and the getter for a base type in the FMI version of the library. The
/// functions of FMI 3.0 have the number of values as last argument.
macro_rules! functions {
    ($with:ident, $library:expr, $base:expr, $n:ident) => {
        match (&$library.functions, $base) {
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
    /// Sets numeric variables of one type; 0 or 1 for a Boolean.
    #[inline]
    pub(crate) fn set_numbers(
        &mut self,
        base: BaseType,
        vr: &[u32],
        values: &[f64],
    ) -> Result<(), Rejection> {
        assert_eq!(vr.len(), values.len());
        if self.arrays.among(vr) {
            return self.set_elements(base, vr, values);
        }
        self.set_variables(base, vr, values)
    }

    /// Reads numeric variables of one type; 0 or 1 for a Boolean.
    #[inline]
    pub(crate) fn get_numbers(
        &mut self,
        base: BaseType,
        vr: &[u32],
        values: &mut [f64],
    ) -> Result<(), Rejection> {
        assert_eq!(vr.len(), values.len());
        if self.arrays.among(vr) {
            return self.get_elements(base, vr, values);
        }
        self.get_variables(base, vr, values)
    }

    /// Sets variables of the FMU; arrays have several values.
    #[inline]
    fn set_variables(&mut self, base: BaseType, vr: &[u32], values: &[f64]) -> Result<(), Rejection> {
        let (handle, pointer, count, n) = (self.handle("set")?, vr.as_ptr(), vr.len(), values.len());
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

    /// Reads variables of the FMU; arrays have several values.
    #[inline]
    fn get_variables(&mut self, base: BaseType, vr: &[u32], values: &mut [f64]) -> Result<(), Rejection> {
        let (handle, pointer, count, n) = (self.handle("get")?, vr.as_ptr(), vr.len(), values.len());
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

    #[cold]
    fn get_elements(&mut self, base: BaseType, vr: &[u32], values: &mut [f64]) -> Result<(), Rejection> {
        let expanded = self.arrays.expanded(vr);
        let mut all = vec![0.0; expanded.count];
        self.get_variables(base, &expanded.references, &mut all)?;
        expanded.indices.iter().zip(values).for_each(|(index, value)| *value = all[*index]);
        Ok(())
    }

    /// Sets variables of which some are array elements; the other elements of the arrays keep their values.
    #[cold]
    fn set_elements(&mut self, base: BaseType, vr: &[u32], values: &[f64]) -> Result<(), Rejection> {
        let expanded = self.arrays.expanded(vr);
        let mut all = vec![0.0; expanded.count];
        if self.early.is_some() {
            for (array, begin) in &expanded.arrays {
                let known = self.early_numbers(*array);
                all[*begin..][..known.len()].copy_from_slice(&known);
            }
        } else if !expanded.is_complete() {
            self.get_variables(base, &expanded.references, &mut all)?;
        }
        expanded.indices.iter().zip(values).for_each(|(index, value)| all[*index] = *value);
        self.set_variables(base, &expanded.references, &all)?;
        if let Some(early) = &mut self.early {
            for (array, begin) in expanded.arrays {
                let length = self.arrays.length(self.arrays.all()[array].reference);
                early.numbers.insert(array, all[begin..][..length].to_vec());
            }
        }
        Ok(())
    }

    /// Returns the values of an array before the initialization: the values that were set, or the start
    /// values.
    fn early_numbers(&self, array: usize) -> Vec<f64> {
        if let Some(known) = self.early.as_ref().and_then(|early| early.numbers.get(&array)) {
            return known.clone();
        }
        let array = &self.arrays.all()[array];
        let number = |number| match array.start(number) {
            Some("true") => 1.0,
            start => start.and_then(|start| start.parse().ok()).unwrap_or_default(),
        };
        (0..self.arrays.length(array.reference)).map(number).collect()
    }

    /// Sets a string; the other elements of an array keep their values.
    pub(crate) fn set_text(&mut self, vr: u32, value: &CStr) -> Result<(), Rejection> {
        let (vr, texts) = match self.arrays.find(vr) {
            None => (vr, vec![value.to_owned()]),
            Some((array, number)) => {
                let vr = self.arrays.all()[array].reference;
                let mut texts = self.array_texts(array)?;
                texts[number] = value.to_owned();
                if let Some(early) = &mut self.early {
                    early.texts.insert(array, texts.clone());
                }
                (vr, texts)
            }
        };
        let pointers: Vec<_> = texts.iter().map(|text| text.as_ptr()).collect();
        let (values, n) = (pointers.as_ptr(), pointers.len());
        call!(self, fmi2SetString(&vr, 1, values), fmi3SetString(&vr, 1, values, n))
    }

    pub(crate) fn get_text(&mut self, vr: u32) -> Result<String, Rejection> {
        let (vr, number) = match self.arrays.find(vr) {
            None => (vr, 0),
            Some((array, number)) => (self.arrays.all()[array].reference, number),
        };
        Ok(self.texts(vr)?.swap_remove(number).to_string_lossy().into_owned())
    }

    /// Returns the strings of an array: before the initialization, those that were set, or the start values.
    fn array_texts(&mut self, array: usize) -> Result<Vec<CString>, Rejection> {
        let arrays = Arc::clone(&self.arrays);
        let (array, index) = (&arrays.all()[array], array);
        let Some(early) = &self.early else { return self.texts(array.reference) };
        let start = |number| CString::new(array.start(number).unwrap_or_default()).unwrap_or_default();
        let known = early.texts.get(&index).cloned();
        Ok(known.unwrap_or_else(|| (0..arrays.length(array.reference)).map(start).collect()))
    }

    /// Returns all strings of a variable of the FMU.
    fn texts(&mut self, vr: u32) -> Result<Vec<CString>, Rejection> {
        let mut texts = vec![null(); self.arrays.length(vr)];
        let (values, n) = (texts.as_mut_ptr(), texts.len());
        call!(self, fmi2GetString(&vr, 1, values), fmi3GetString(&vr, 1, values, n))?;
        // SAFETY: the strings belong to the FMU and are valid until the next call.
        let owned =
            |text: &fmi3String| unsafe { (!text.is_null()).then(|| CStr::from_ptr(*text).to_owned()) };
        Ok(texts.iter().map(owned).map(Option::unwrap_or_default).collect())
    }
}
