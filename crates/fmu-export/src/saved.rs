//! What a serialized state holds: [`Saved`] for every Rust type that a model may remember something in.

use std::collections::{BTreeMap, VecDeque};

/// Sees every value of a model's state in turn; counts it, writes it or replaces it.
pub trait StateVisitor {
    /// A floating-point value, of any kind.
    fn real(&mut self, value: &mut f64);
    /// A whole number.
    fn integer(&mut self, value: &mut i64);
    /// A truth value.
    fn boolean(&mut self, value: &mut bool);
    /// A text.
    fn text(&mut self, value: &mut String);
    /// How many elements follow, each of one byte at least. Reading more than there can be makes the state invalid, and
    /// there are none.
    fn length(&mut self, value: &mut usize);
    /// What was read cannot be: the state is refused.
    fn invalid(&mut self);
    /// Whether there may be more: not after what was read has been found invalid.
    fn goes_on(&self) -> bool {
        true
    }
}

/// A value that can be written into a serialized state and read back.
///
/// Implemented for numbers, truth values, texts, and for options, boxes, tuples, arrays, vectors, queues and ordered maps of such;
/// [`saved!`](crate::saved) implements it for a struct.
pub trait Saved {
    /// Shows every value to the visitor, always in the same order: the same list serves to write and to read.
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
        visitor.text(self);
    }
}

macro_rules! whole_numbers {
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

whole_numbers!(i8 i16 i32 i64 isize u8 u16 u32);

/// The same bits as an `i64`.
impl Saved for u64 {
    fn visit(&mut self, visitor: &mut dyn StateVisitor) {
        let mut number = self.cast_signed();
        visitor.integer(&mut number);
        *self = number.cast_unsigned();
    }
}

/// What fits another machine only is refused there.
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
        // What is no `f32` has not been written by one.
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
    ($(($($type:ident $place:tt),+))+) => {
        $(impl<$($type: Saved),+> Saved for ($($type),+) {
            fn visit(&mut self, visitor: &mut dyn StateVisitor) {
                $( self.$place.visit(visitor); )+
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
        // A value that is missing takes its place all the same: the length of a state does not vary.
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
        // Hostile bytes may claim any length: an element is made when those before it were there.
        while self.len() < length && visitor.goes_on() {
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
        // No map was written in another order.
        if !entries.is_sorted_by(|(one, _), (next, _)| one < next) {
            visitor.invalid();
        }
        *self = entries.into_iter().collect();
    }
}

/// Defines a struct all of whose fields belong to a serialized state; or says that of one that is defined elsewhere,
/// where the compiler sees to it that no field is missing.
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
