//! Content of a serialized state: [`Saved`], implemented for the Rust types in which a model may store values.

use std::collections::{BTreeMap, VecDeque};

/// A visitor of the values of a model's state. Implementations count the bytes of the values, write the values, or
/// replace them by values that were read.
pub trait StateVisitor {
    /// Visits a floating-point number.
    fn real(&mut self, value: &mut f64);
    /// Visits an integer.
    fn integer(&mut self, value: &mut i64);
    /// Visits a Boolean.
    fn boolean(&mut self, value: &mut bool);
    /// Visits a string.
    fn string(&mut self, value: &mut String);
    /// Visits the number of elements that follow, which have at least one byte each. If fewer bytes than elements
    /// remain when a state is read, the state becomes invalid and the length becomes 0.
    fn length(&mut self, value: &mut usize);
    /// Marks the state as invalid; it is then rejected.
    fn invalid(&mut self);
    /// Returns whether more elements can follow, which is false once the state is invalid.
    fn continues(&self) -> bool {
        true
    }
}

/// A value that can be written to a serialized state and read back.
///
/// It is implemented for numbers of up to 64 bits, Booleans and strings, and for options, boxes, tuples of up to four
/// values, arrays, vectors, queues and ordered maps of such values. [`saved!`](crate::saved) implements it for a
/// struct.
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

/// A `u64` is stored as the `i64` with the same bits.
impl Saved for u64 {
    fn visit(&mut self, visitor: &mut dyn StateVisitor) {
        let mut number = self.cast_signed();
        visitor.integer(&mut number);
        *self = number.cast_unsigned();
    }
}

/// A `usize` is stored in 64 bits. A value that this machine cannot represent makes the state invalid.
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
        // A number that an `f32` cannot represent was not written by an `f32`, so the state is invalid.
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
        // If there is no value, a default value is written, so that the length of a state is constant.
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
        // Malformed bytes may claim any length, so each element is created only after the previous one was read.
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
        // Maps are written in ascending order of keys, so other bytes are invalid.
        if !entries.is_sorted_by(|(one, _), (next, _)| one < next) {
            visitor.invalid();
        }
        *self = entries.into_iter().collect();
    }
}

/// Defines a struct and implements [`Saved`](crate::Saved) for it, so that all its fields belong to a serialized
/// state. With `for`, implements it for an existing struct; the compiler then checks that no field is missing.
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
