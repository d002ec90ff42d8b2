//! Values of variables, and the Rust types that hold them.

use crate::saved::{Saved, StateVisitor};
use crate::types::Item;
use fmi_abi::{BaseType, Value};

/// A Rust type that can hold a variable's value: `f64`, `i32`, `bool`, `String`, an enum made by
/// [`enumeration!`](crate::enumeration) or, only for FMI 3.0, `f32`, `Vec<u8>` and the other integers from `i8` to
/// `u64`.
pub trait Scalar: Saved {
    /// FMI base type.
    const BASE: BaseType;

    /// Returns the value.
    fn value(&self) -> Value;

    /// Sets the value. Ignores a value of another type and a number that the integer type or enum does not have; this
    /// crate rejects them earlier.
    fn assign(&mut self, value: &Value);

    /// Returns the [`value`](Self::value) of a Real; NaN for all other types. `f64` overrides it to avoid the
    /// conversion.
    #[inline]
    fn real(&self) -> f64 {
        self.value().real()
    }

    /// [Sets](Self::assign) the value of a Real. `f64` overrides it to avoid the conversion.
    #[inline]
    fn set_real(&mut self, value: f64) {
        self.assign(&Value::Real(value));
    }

    /// Returns a reference to the number if the type is `f64`.
    #[doc(hidden)]
    #[inline]
    fn as_real(&self) -> Option<&f64> {
        None
    }
}

/// A Rust type for the field of a variable: a [`Scalar`], or an array of scalars such as `[f64; 8]` or
/// `[[f64; 2]; 3]`.
#[diagnostic::on_unimplemented(
    message = "no variable can have a value of the type `{Self}`",
    label = "the type is `{Self}`",
    note = "values are f64, f32, integers from i8 to u64, bool, String, Vec<u8>, enums made by enumeration!, and \
            arrays of them, such as [f64; 8]"
)]
pub trait Place: Saved {
    /// Type of an element.
    type Element: Scalar;

    /// Number of elements in each dimension.
    const DIMENSIONS: Dimensions;

    /// Returns an element. Elements are numbered from 0, row by row; a scalar is its own element 0.
    fn element(&self, number: usize) -> &Self::Element;

    /// Returns an element as a mutable reference; see [`element`](Self::element).
    fn element_mut(&mut self, number: usize) -> &mut Self::Element;

    /// Returns a reference to the number if the type is `f64`.
    #[doc(hidden)]
    #[inline]
    fn as_real(&self) -> Option<&f64> {
        if Self::DIMENSIONS.is_scalar() { Scalar::as_real(self.element(0)) } else { None }
    }
}

impl<T: Scalar> Place for T {
    type Element = T;
    const DIMENSIONS: Dimensions = Dimensions::SCALAR;

    #[inline]
    fn element(&self, _: usize) -> &T {
        self
    }

    #[inline]
    fn element_mut(&mut self, _: usize) -> &mut T {
        self
    }
}

impl<T: Place, const N: usize> Place for [T; N] {
    type Element = T::Element;
    const DIMENSIONS: Dimensions = T::DIMENSIONS.of_array(N);

    #[inline]
    fn element(&self, number: usize) -> &T::Element {
        let row = T::DIMENSIONS.length();
        self[number / row].element(number % row)
    }

    #[inline]
    fn element_mut(&mut self, number: usize) -> &mut T::Element {
        let row = T::DIMENSIONS.length();
        self[number / row].element_mut(number % row)
    }
}

/// Sizes of an array in each dimension; the last is the length of a row. Empty for a scalar.
#[doc(hidden)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Dimensions {
    sizes: [usize; 3],
    /// Number of dimensions, at most 3.
    count: usize,
}

impl Dimensions {
    pub(crate) const SCALAR: Self = Self { sizes: [0; 3], count: 0 };

    const fn of_array(self, size: usize) -> Self {
        assert!(self.count < 3, "the array of a variable can have at most three dimensions");
        let [a, b, _] = self.sizes;
        Self { sizes: [size, a, b], count: self.count + 1 }
    }

    pub(crate) const fn sizes(&self) -> &[usize] {
        self.sizes.split_at(self.count).0
    }

    /// Returns the number of elements.
    pub(crate) const fn length(&self) -> usize {
        let (mut length, mut index) = (1, 0);
        while index < self.count {
            length *= self.sizes[index];
            index += 1;
        }
        length
    }

    pub(crate) const fn is_scalar(&self) -> bool {
        self.count == 0
    }

    pub(crate) const fn is(&self, other: &Self) -> bool {
        let [a, b, c] = self.sizes;
        let [d, e, f] = other.sizes;
        self.count == other.count && a == d && b == e && c == f
    }
}

impl Scalar for f64 {
    const BASE: BaseType = BaseType::Real;

    fn value(&self) -> Value {
        Value::Real(*self)
    }

    fn assign(&mut self, value: &Value) {
        if let Value::Real(value) = value {
            *self = *value;
        }
    }

    #[inline]
    fn real(&self) -> f64 {
        *self
    }

    #[inline]
    fn set_real(&mut self, value: f64) {
        *self = value;
    }

    #[inline]
    fn as_real(&self) -> Option<&f64> {
        Some(self)
    }
}

macro_rules! scalar {
    ($($type:ty: $kind:ident;)+) => {
        $(impl Scalar for $type {
            const BASE: BaseType = BaseType::$kind;

            fn value(&self) -> Value {
                Value::$kind(self.clone())
            }

            fn assign(&mut self, value: &Value) {
                if let Value::$kind(value) = value {
                    self.clone_from(value);
                }
            }
        })+
    };
}

scalar! {
    Vec<u8>: Binary;
    bool: Boolean;
    String: String;
}

impl Scalar for f32 {
    const BASE: BaseType = BaseType::Float32;

    fn value(&self) -> Value {
        Value::Real(f64::from(*self))
    }

    fn assign(&mut self, value: &Value) {
        if let Value::Real(value) = value {
            *self = *value as f32;
        }
    }
}

macro_rules! integers {
    ($($type:ty: $kind:ident;)+) => {
        $(impl Scalar for $type {
            const BASE: BaseType = BaseType::$kind;

            fn value(&self) -> Value {
                Value::Integer(i128::from(*self))
            }

            fn assign(&mut self, value: &Value) {
                if let Value::Integer(value) = value
                    && let Ok(value) = Self::try_from(*value)
                {
                    *self = value;
                }
            }
        })+
    };
}

integers! {
    i8: Int8;
    u8: UInt8;
    i16: Int16;
    u16: UInt16;
    i32: Integer;
    u32: UInt32;
    i64: Int64;
    u64: UInt64;
}

/// An enum that is an FMI enumeration. [`enumeration!`](crate::enumeration) implements it.
pub trait Enumeration: Copy + 'static {
    /// Items, in the order of declaration.
    const ITEMS: &'static [Item];

    /// Returns the value with this number; `None` if there is none.
    fn from_number(number: i32) -> Option<Self>;

    /// Returns the number of the value.
    fn number(self) -> i32;
}

/// Implements [`Saved::visit`] for the enums of [`enumeration!`](crate::enumeration).
#[doc(hidden)]
pub fn visit_enumeration<T: Enumeration>(value: &mut T, visitor: &mut dyn StateVisitor) {
    let mut number = i64::from(value.number());
    visitor.integer(&mut number);
    match i32::try_from(number).ok().and_then(T::from_number) {
        Some(read) => *value = read,
        None => visitor.invalid(),
    }
}

/// Defines an enum that is an FMI enumeration, with names, numbers and descriptions.
///
/// ```
/// fmu_export::enumeration! {
///     /// What a valve does.
///     pub enum Valve {
///         /// Nothing passes
///         Closed = 1,
///         /// Everything passes
///         Open = 2,
///     }
/// }
/// const VALVE: fmu_export::Type = fmu_export::Type::enumeration("Valve", <Valve as fmu_export::Enumeration>::ITEMS);
/// ```
#[macro_export]
macro_rules! enumeration {
    (
        $(#[$attribute:meta])*
        $visibility:vis enum $name:ident {
            $( $(#[doc = $text:literal])* $item:ident = $number:literal ),+ $(,)?
        }
    ) => {
        $(#[$attribute])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        $visibility enum $name {
            $( $(#[doc = $text])* $item = $number ),+
        }

        impl $crate::Enumeration for $name {
            const ITEMS: &'static [$crate::Item] = &[
                $( $crate::Item {
                    name: ::core::stringify!($item),
                    value: $number,
                    description: ::core::concat!($($text),*).trim_ascii(),
                } ),+
            ];

            fn from_number(number: i32) -> ::core::option::Option<Self> {
                match number {
                    $( $number => ::core::option::Option::Some(Self::$item), )+
                    _ => ::core::option::Option::None,
                }
            }

            fn number(self) -> i32 {
                self as i32
            }
        }

        impl $crate::Saved for $name {
            fn visit(&mut self, visitor: &mut dyn $crate::StateVisitor) {
                $crate::visit_enumeration(self, visitor);
            }
        }

        impl $crate::Scalar for $name {
            const BASE: $crate::BaseType = $crate::BaseType::Enumeration;

            fn value(&self) -> $crate::Value {
                $crate::Value::Integer($crate::Enumeration::number(*self).into())
            }

            fn assign(&mut self, value: &$crate::Value) {
                if let $crate::Value::Integer(number) = value
                    && let ::core::result::Result::Ok(number) = i32::try_from(*number)
                    && let ::core::option::Option::Some(item) = <Self as $crate::Enumeration>::from_number(number)
                {
                    *self = item;
                }
            }
        }
    };
}
