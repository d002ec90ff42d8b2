//! What is wrong in a model description.

use crate::attribute::{Typed, unreadable, value, values};
use roxmltree::Node;
use std::cell::RefCell;

/// Maximum number of faults that are listed for each kind.
const MAX_FAULTS: usize = 100;

/// Kinds of faults in a model description.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The name of the model, its guid or instantiation token, a `modelIdentifier`, or the value of a `Start` is missing.
    Attribute,
    /// There are two elements for one interface type, of which the first one counts.
    Interface,
    /// A variable has no value reference.
    Reference,
    /// A variable has no type, or an unknown one.
    Type,
    /// `ModelStructure` or the attribute `derivative` refers to a variable that does not exist, or does not fit together; or a variable is
    /// the derivative of itself.
    Structure,
    /// Two units have one name, of which the last one counts, or two display units of a unit have one name, or a display unit has the
    /// factor 0.
    Unit,
    /// Two types, or two items of a type, have one name or value; or a variable and its declared type have other base types.
    Definition,
    /// The size of an array is neither a number nor a variable, or both, or a variable that is neither a structural parameter nor a constant
    /// of type UInt64.
    Dimension,
    /// `ModelStructure` lists a variable twice, of which the first entry counts, has `dependenciesKind` without a dependency for each, or an
    /// event indicator that is not a continuous floating-point number.
    Unknown,
    /// The tolerance of the default experiment is negative. It counts as missing.
    Experiment,
    /// The value of an attribute is not of the attribute's type. The attribute counts as missing.
    Value,
}

/// The faults that have been found so far, at most [`MAX_FAULTS`] of each kind.
#[derive(Default)]
pub(super) struct Faults(RefCell<Vec<(Fault, String)>>);

impl Faults {
    /// Adds a fault. The message is only made if the fault is listed.
    pub fn add(&self, fault: Fault, why: impl FnOnce() -> String) {
        let mut all = self.0.borrow_mut();
        if all.iter().filter(|(of, _)| *of == fault).count() < MAX_FAULTS {
            all.push((fault, why()));
        }
    }

    /// Reads an attribute. If its value cannot be read, this is a fault, and the attribute counts as missing.
    pub fn read<T: Typed>(&self, node: Node, name: &str) -> Option<T> {
        value(node, name)?.map_err(|text| self.add(Fault::Value, || unreadable::<T>(node, name, text))).ok()
    }

    /// Reads an attribute that is a list. If one of its values cannot be read, this is a fault, and the attribute counts as missing.
    pub fn read_list<T: Typed>(&self, node: Node, name: &str) -> Option<Vec<T>> {
        values(node, name)?.map_err(|text| self.add(Fault::Value, || unreadable::<T>(node, name, text))).ok()
    }

    /// Returns the faults, each with a message.
    pub fn into_list(self) -> Vec<(Fault, String)> {
        self.0.into_inner()
    }
}
