//! Reads and sets variables, including array elements. All elements of an array are read or set with one call of the FMU.

use crate::arrays::{Array, ArrayStartValues};
use crate::instance::Instance;
use fmi_abi::client::{Instance as Client, Rejection};
use fmi_abi::{BaseType, Value, boolean};
use std::collections::HashMap;

type Called = Result<(), Rejection>;

/// Type in which values are passed: `f64`, which is fast, with 0 or 1 for a Boolean; or [`Value`], which also represents strings, bytes
/// and 64-bit integers.
pub(crate) trait Scalar: Clone {
    const ZERO: Self;

    fn get(client: &mut Client, base: BaseType, vr: &[u32], values: &mut [Self]) -> Called;

    fn set(client: &mut Client, base: BaseType, vr: &[u32], values: &[Self]) -> Called;

    /// Returns the values of arrays that were set before Initialization Mode.
    fn set_before(starts: &mut ArrayStartValues) -> &mut HashMap<usize, Vec<Self>>;

    /// Parses a start value.
    fn read(base: BaseType, start: &str) -> Option<Self>;
}

impl Scalar for f64 {
    const ZERO: Self = 0.0;

    #[inline]
    fn get(client: &mut Client, base: BaseType, vr: &[u32], values: &mut [Self]) -> Called {
        client.get_numbers(base, vr, values)
    }

    #[inline]
    fn set(client: &mut Client, base: BaseType, vr: &[u32], values: &[Self]) -> Called {
        client.set_numbers(base, vr, values)
    }

    fn set_before(starts: &mut ArrayStartValues) -> &mut HashMap<usize, Vec<Self>> {
        &mut starts.numbers
    }

    fn read(base: BaseType, start: &str) -> Option<Self> {
        match base {
            BaseType::Boolean => boolean(start).map(|start| f64::from(u8::from(start))),
            _ => start.parse().ok(),
        }
    }
}

impl Scalar for Value {
    const ZERO: Self = Self::Integer(0);

    fn get(client: &mut Client, base: BaseType, vr: &[u32], values: &mut [Self]) -> Called {
        client.get_values(base, vr, values.len()).map(|found| values.clone_from_slice(&found))
    }

    fn set(client: &mut Client, base: BaseType, vr: &[u32], values: &[Self]) -> Called {
        client.set_values(base, vr, values)
    }

    fn set_before(starts: &mut ArrayStartValues) -> &mut HashMap<usize, Vec<Self>> {
        &mut starts.values
    }

    fn read(base: BaseType, start: &str) -> Option<Self> {
        Self::read(base, start)
    }
}

impl Instance {
    /// Reads variables of one type.
    #[inline]
    pub(crate) fn get<T: Scalar>(&mut self, base: BaseType, vr: &[u32], values: &mut [T]) -> Called {
        assert_eq!(vr.len(), values.len());
        if self.arrays.among(vr) {
            return self.get_elements(base, vr, values);
        }
        T::get(&mut self.client, base, vr, values)
    }

    /// Sets variables of one type.
    #[inline]
    pub(crate) fn set<T: Scalar>(&mut self, base: BaseType, vr: &[u32], values: &[T]) -> Called {
        assert_eq!(vr.len(), values.len());
        if self.arrays.among(vr) {
            return self.set_elements(base, vr, values);
        }
        T::set(&mut self.client, base, vr, values)
    }

    #[cold]
    fn get_elements<T: Scalar>(&mut self, base: BaseType, vr: &[u32], values: &mut [T]) -> Called {
        let expanded = self.arrays.expanded(vr);
        let mut all = vec![T::ZERO; expanded.count];
        T::get(&mut self.client, base, &expanded.references, &mut all)?;
        expanded.indices.iter().zip(values).for_each(|(index, value)| value.clone_from(&all[*index]));
        Ok(())
    }

    /// Sets variables, some of which are array elements. All other elements of the arrays keep their values.
    #[cold]
    fn set_elements<T: Scalar>(&mut self, base: BaseType, vr: &[u32], values: &[T]) -> Result<(), Rejection> {
        let Self { client, arrays, array_starts, description, .. } = self;
        let expanded = arrays.expanded(vr);
        let mut all = vec![T::ZERO; expanded.count];
        match array_starts {
            _ if expanded.is_complete() => {}
            None => T::get(client, base, &expanded.references, &mut all)?,
            Some(starts) => {
                for (index, begin) in &expanded.arrays {
                    let (array, before) = (&arrays.all()[*index], T::set_before(starts));
                    let to = &mut all[*begin..][..array.length];
                    match before.get(index) {
                        Some(known) => to.clone_from_slice(known),
                        None if declared(array, !description.structure.is_empty(), to) => {}
                        None => T::get(client, base, &[array.reference], to)?,
                    }
                }
            }
        }
        expanded.indices.iter().zip(values).for_each(|(index, value)| all[*index].clone_from(value));
        T::set(client, base, &expanded.references, &all)?;
        if let Some(starts) = array_starts {
            for (index, begin) in &expanded.arrays {
                let length = arrays.all()[*index].length;
                T::set_before(starts).insert(*index, all[*begin..][..length].to_vec());
            }
        }
        Ok(())
    }
}

/// Writes the start values in the model description to `to`. Returns whether they are known: separate start values of the elements are
/// not if a structural parameter has been changed, because they are for the default sizes (section 2.4.7.5 of FMI 3.0).
fn declared<T: Scalar>(array: &Array, is_configured: bool, to: &mut [T]) -> bool {
    if is_configured && array.has_separate_starts() {
        return false;
    }
    to.iter_mut().enumerate().all(|(number, to)| {
        let start = array.start(number).and_then(|start| T::read(array.base, start));
        start.map(|start| *to = start).is_some()
    })
}
