//! Conversions of values on their way from an output to an input.

use std::sync::Arc;

/// A conversion: between units, or a transformation of SSP (section 4.5.2 of SSP 1.0). The default changes nothing.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Change(Vec<Operation>);

#[derive(Clone, Debug, PartialEq)]
enum Operation {
    /// factor * value + offset.
    Linear(f64, f64),
    /// Pairs of a value and the value that replaces it; all other values stay. If `is_inverse`, the values of each pair are swapped.
    /// Many connections may share the pairs.
    Map { pairs: Arc<[(f64, f64)]>, is_inverse: bool },
}

impl Change {
    /// Returns the change to factor * value + offset.
    pub fn linear(factor: f64, offset: f64) -> Self {
        if (factor, offset) == (1.0, 0.0) {
            Self::default()
        } else {
            Self(vec![Operation::Linear(factor, offset)])
        }
    }

    /// Returns the change that replaces values: each pair is a value and its replacement.
    pub fn map(pairs: Vec<(f64, f64)>) -> Self {
        Self(vec![Operation::Map { pairs: pairs.into(), is_inverse: false }])
    }

    /// Returns this change followed by another one.
    #[must_use]
    pub fn then(mut self, next: &Self) -> Self {
        for operation in &next.0 {
            match (self.0.last_mut(), operation) {
                (Some(Operation::Linear(f, o)), Operation::Linear(factor, offset)) => {
                    (*f, *o) = (factor * *f, factor * *o + offset);
                }
                _ => self.0.push(operation.clone()),
            }
        }
        self
    }

    /// Returns the opposite change. Values that the change does not result in become NaN, or stay as they are.
    pub fn inverse(&self) -> Self {
        let inverse = |operation: &Operation| match operation {
            Operation::Linear(factor, offset) => Operation::Linear(1.0 / factor, -offset / factor),
            Operation::Map { pairs, is_inverse } => {
                Operation::Map { pairs: Arc::clone(pairs), is_inverse: !is_inverse }
            }
        };
        Self(self.0.iter().rev().map(inverse).collect())
    }

    pub fn is_identity(&self) -> bool {
        self.0.is_empty()
    }

    /// Returns how often the change replaces single values.
    pub fn maps(&self) -> usize {
        self.0.iter().filter(|operation| matches!(operation, Operation::Map { .. })).count()
    }

    /// Returns whether the change calculates with values, which must be Real.
    pub fn is_linear(&self) -> bool {
        self.0.iter().any(|operation| matches!(operation, Operation::Linear(..)))
    }

    pub fn apply(&self, value: f64) -> f64 {
        self.0.iter().fold(value, |value, operation| match operation {
            Operation::Linear(factor, offset) => factor * value + offset,
            Operation::Map { pairs, is_inverse: false } => {
                pairs.iter().find(|(from, _)| *from == value).map_or(value, |(_, to)| *to)
            }
            Operation::Map { pairs, is_inverse: true } => {
                pairs.iter().find(|(_, to)| *to == value).map_or(value, |(from, _)| *from)
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::Change;

    #[test]
    fn changes_follow_each_other_and_are_inverted() {
        let change = Change::linear(2.0, 1.0).then(&Change::linear(4.0, 0.5));
        assert_eq!((change.apply(1.0), change.inverse().apply(12.5)), (12.5, 1.0));
        let switch = Change::map(vec![(0.0, 1.0), (1.0, 0.0)]).then(&Change::linear(1.0, 0.0));
        assert_eq!([0.0, 1.0, 2.0].map(|value| switch.apply(value)), [1.0, 0.0, 2.0]);
        let both = switch.then(&change);
        assert_eq!((both.apply(0.0), both.inverse().apply(both.apply(0.0))), (12.5, 0.0));
        assert!(
            Change::linear(1.0, 0.0).is_identity() && Change::linear(0.0, 1.0).inverse().apply(1.0).is_nan()
        );
    }
}
