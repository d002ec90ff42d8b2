//! Content of a serialized state: [`Saved`] for all Rust types in which a model may remember values.

use std::collections::{BTreeMap, VecDeque};

/// Visitor of all values of a model's state; counts, writes or replaces them.
pub trait StateVisitor {
    /// Visits a floating-point value of any type.
    fn real(&mut self, value: &mut f64);
    /// Visits an integer.
    fn integer(&mut self, value: &mut i64);
    /// Visits a Boolean.
    fn boolean(&mut self, value: &mut bool);
    /// Visits a string.
    fn string(&mut self, value: &mut String);
    /// Visits the number of elements that follow; each element has at least one byte. A length beyond the
    /// remaining bytes makes the state invalid and becomes 0.
    fn length(&mut self, value: &mut usize);
    /// Marks the state as invalid; it is then rejected.
    fn invalid(&mut self);
    /// Returns whether more elements may follow: false once the state is invalid.
    fn continues(&self) -> bool {
        true
    }
}

/// A value that can be written to a serialized state and read back.
///
/// Implemented for numbers, Booleans and strings, and for options, boxes, tuples, arrays, vectors, queues and
/// ordered maps of them. [`saved!`](crate::saved) implements it for a struct.
pub trait Saved {
    /// Passes every value to the visitor, always in the same order, for writing and for reading.
    fn visit(&mut self, visitor: &mut dyn StateVisitor);
}

impl Saved for f64 {
    fn visit(&mut self, visitor: &mut dyn StateVisitor) {
        visitor.real(self);
    }
}

impl Saved for bool {
    fn visit(&mut self, visitor: &mut dyn StateVisitor) {
        visitor.boolean(self);
    }
}

impl Saved for String {
    fn visit(&mut self, visitor: &mut dyn StateVisitor) {
        visitor.string(self);
    }
}

macro_rules! integers {
    ($($type:ty)+) => {
        $(impl Saved for $type {
            fn visit(&mut self, visitor: &mut dyn StateVisitor) {
                let mut number = *self as i64;
                visitor.integer(&mut number);
                match Self::try_from(number) {
                    Ok(number) => *self = number,
                    Err(_) => visitor.invalid(),
                }
            }
        })+
    };
}

integers!(i8 i16 i32 i64 isize u8 u16 u32);

/// Stored as the `i64` with the same bits.
impl Saved for u64 {
    fn visit(&mut self, visitor: &mut dyn StateVisitor) {
        let mut number = self.cast_signed();
        visitor.integer(&mut number);
        *self = number.cast_unsigned();
    }
}

/// A value beyond the range of this machine makes the state invalid.
impl Saved for usize {
    fn visit(&mut self, visitor: &mut dyn StateVisitor) {
        let mut number = *self as u64;
        number.visit(visitor);
        match Self::try_from(number) {
            Ok(number) => *self = number,
            Err(_) => visitor.invalid(),
        }
    }
}

impl Saved for f32 {
    fn visit(&mut self, visitor: &mut dyn StateVisitor) {
        let mut number = f64::from(*self);
        visitor.real(&mut number);
        // A number that is not representable as `f32` was not written from one.
        match number as f32 {
            read if f64::from(read) == number || number.is_nan() => *self = read,
            _ => visitor.invalid(),
        }
    }
}

impl<T: Saved, const N: usize> Saved for [T; N] {
    fn visit(&mut self, visitor: &mut dyn StateVisitor) {
        self.iter_mut().for_each(|value| value.visit(visitor));
    }
}

macro_rules! tuples {
    ($(($($type:ident $index:tt),+))+) => {
        $(impl<$($type: Saved),+> Saved for ($($type),+) {
            fn visit(&mut self, visitor: &mut dyn StateVisitor) {
                $( self.$index.visit(visitor); )+
            }
        })+
    };
}

tuples!((A 0, B 1) (A 0, B 1, C 2) (A 0, B 1, C 2, D 3));

impl<T: Saved> Saved for Box<T> {
    fn visit(&mut self, visitor: &mut dyn StateVisitor) {
        (**self).visit(visitor);
    }
}

impl<T: Saved + Default> Saved for Option<T> {
    fn visit(&mut self, visitor: &mut dyn StateVisitor) {
        let mut present = self.is_some();
        visitor.boolean(&mut present);
        // A missing value is written as a default value, so that the length of a state is constant.
        let mut value = self.take().unwrap_or_default();
        value.visit(visitor);
        *self = present.then_some(value);
    }
}

impl<T: Saved + Default> Saved for Vec<T> {
    fn visit(&mut self, visitor: &mut dyn StateVisitor) {
        let mut length = self.len();
        visitor.length(&mut length);
        self.truncate(length);
        self.iter_mut().for_each(|value| value.visit(visitor));
        // Malformed bytes may claim any length, so an element is made only after the previous ones were read.
        while self.len() < length && visitor.continues() {
            let mut value = T::default();
            value.visit(visitor);
            self.push(value);
        }
    }
}

impl<T: Saved + Default> Saved for VecDeque<T> {
    fn visit(&mut self, visitor: &mut dyn StateVisitor) {
        let mut values = Vec::from(std::mem::take(self));
        values.visit(visitor);
        *self = values.into();
    }
}

impl<K: Saved + Default + Ord, V: Saved + Default> Saved for BTreeMap<K, V> {
    fn visit(&mut self, visitor: &mut dyn StateVisitor) {
        let mut entries: Vec<(K, V)> = std::mem::take(self).into_iter().collect();
        entries.visit(visitor);
        // Maps are written in ascending order of keys.
        if !entries.is_sorted_by(|(one, _), (next, _)| one < next) {
            visitor.invalid();
        }
        *self = entries.into_iter().collect();
    }
}

/// Defines a struct whose fields all belong to a serialized state. With `for`, implements
/// [`Saved`](crate::Saved) for an existing struct; the compiler checks that no field is missing.
///
/// ```
/// fmu_export::saved! {
///     /// A sample and when it was taken.
///     #[derive(Clone, Copy, Default)]
///     pub struct Sample {
///         /// Its value.
///         pub value: f64,
///         /// Its time, s.
///         pub time: f64,
///     }
/// }
///
/// struct Pair {
///     samples: [Sample; 2],
///     count: i32,
/// }
/// fmu_export::saved!(for Pair { samples, count });
/// ```
#[macro_export]
macro_rules! saved {
    (for $name:ty { $($field:ident),+ $(,)? }) => {
        impl $crate::Saved for $name {
            fn visit(&mut self, visitor: &mut dyn $crate::StateVisitor) {
                let Self { $($field),+ } = self;
                $( $crate::Saved::visit($field, visitor); )+
            }
        }
    };
    (
        $(#[$attribute:meta])*
        $visibility:vis struct $name:ident {
            $( $(#[$field_attribute:meta])* $field_visibility:vis $field:ident : $type:ty ),* $(,)?
        }
    ) => {
        $(#[$attribute])*
        $visibility struct $name {
            $( $(#[$field_attribute])* $field_visibility $field: $type ),*
        }

        impl $crate::Saved for $name {
            fn visit(&mut self, visitor: &mut dyn $crate::StateVisitor) {
                $( $crate::Saved::visit(&mut self.$field, visitor); )*
            }
        }
    };
}
