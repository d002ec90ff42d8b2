//! Reads and sets variables, including array elements. All elements of an array are read or set with one call of the FMU.

use crate::arrays::Expanded;
use crate::instance::Instance;
use fmi_abi::client::Rejection;
use fmi_abi::{BaseType, Value};
use std::sync::Arc;

impl Instance {
    /// Sets numeric variables of one type. Booleans are 0 or 1.
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
        self.client.set_numbers(base, vr, values)
    }

    /// Reads numeric variables of one type. Booleans are 0 or 1.
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
        self.client.get_numbers(base, vr, values)
    }

    #[cold]
    fn get_elements(&mut self, base: BaseType, vr: &[u32], values: &mut [f64]) -> Result<(), Rejection> {
        let expanded = self.arrays.expanded(vr);
        let mut all = vec![0.0; expanded.count];
        self.client.get_numbers(base, &expanded.references, &mut all)?;
        expanded.indices.iter().zip(values).for_each(|(index, value)| *value = all[*index]);
        Ok(())
    }

    /// Sets variables, some of which are array elements. All other elements of the arrays keep their values.
    #[cold]
    fn set_elements(&mut self, base: BaseType, vr: &[u32], values: &[f64]) -> Result<(), Rejection> {
        let expanded = self.arrays.expanded(vr);
        let mut all = vec![0.0; expanded.count];
        if self.array_starts.is_some() {
            for (array, begin) in &expanded.arrays {
                let known = self.start_numbers(*array);
                all[*begin..][..known.len()].copy_from_slice(&known);
            }
        } else if !expanded.is_complete() {
            self.client.get_numbers(base, &expanded.references, &mut all)?;
        }
        expanded.indices.iter().zip(values).for_each(|(index, value)| all[*index] = *value);
        self.client.set_numbers(base, &expanded.references, &all)?;
        if let Some(starts) = &mut self.array_starts {
            for (array, begin) in expanded.arrays {
                let length = self.arrays.length(self.arrays.all()[array].reference);
                starts.numbers.insert(array, all[begin..][..length].to_vec());
            }
        }
        Ok(())
    }

    /// Returns the values of an array before Initialization Mode: those that were set, or the start values.
    fn start_numbers(&self, array: usize) -> Vec<f64> {
        if let Some(known) = self.array_starts.as_ref().and_then(|starts| starts.numbers.get(&array)) {
            return known.clone();
        }
        let array = &self.arrays.all()[array];
        let number = |number| match array.start(number).map(|start| &**start) {
            Some("true") => 1.0,
            start => start.and_then(|start| start.parse().ok()).unwrap_or_default(),
        };
        (0..self.arrays.length(array.reference)).map(number).collect()
    }

    /// Sets variables of one type to exact values, i.e. without conversion to `f64`, so that strings, bytes and 64-bit integers are
    /// possible. All other elements of arrays keep their values.
    pub(crate) fn set_values(
        &mut self,
        base: BaseType,
        vr: &[u32],
        values: &[Value],
    ) -> Result<(), Rejection> {
        assert_eq!(vr.len(), values.len());
        if !self.arrays.among(vr) {
            return self.client.set_values(base, vr, values);
        }
        let expanded = self.arrays.expanded(vr);
        let mut all = vec![Value::Integer(0); expanded.count];
        if self.array_starts.is_some() {
            for (array, begin) in &expanded.arrays {
                let known = self.start_values(*array);
                all[*begin..][..known.len()].clone_from_slice(&known);
            }
        } else if !expanded.is_complete() {
            all = self.client.get_values(base, &expanded.references, expanded.count)?;
        }
        expanded.indices.iter().zip(values).for_each(|(index, value)| all[*index].clone_from(value));
        self.client.set_values(base, &expanded.references, &all)?;
        if let Some(starts) = &mut self.array_starts {
            for (array, begin) in expanded.arrays {
                let length = self.arrays.length(self.arrays.all()[array].reference);
                starts.values.insert(array, all[begin..][..length].to_vec());
            }
        }
        Ok(())
    }

    /// Reads exact values of variables of one type.
    pub(crate) fn get_values(&mut self, base: BaseType, vr: &[u32]) -> Result<Vec<Value>, Rejection> {
        if !self.arrays.among(vr) {
            return self.client.get_values(base, vr, vr.len());
        }
        let Expanded { references, count, indices, .. } = self.arrays.expanded(vr);
        let all = self.client.get_values(base, &references, count)?;
        Ok(indices.iter().map(|index| all[*index].clone()).collect())
    }

    /// Returns the exact values of an array before Initialization Mode: those that were set, or the start values.
    fn start_values(&self, array: usize) -> Vec<Value> {
        if let Some(known) = self.array_starts.as_ref().and_then(|starts| starts.values.get(&array)) {
            return known.clone();
        }
        let arrays = Arc::clone(&self.arrays);
        let array = &arrays.all()[array];
        let start = |number| {
            array.start(number).and_then(|start| Value::read(array.base, start)).unwrap_or(Value::Integer(0))
        };
        (0..arrays.length(array.reference)).map(start).collect()
    }
}
