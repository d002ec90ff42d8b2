//! A field that saved states may lack.

use crate::mistake::mistake;
use fmu_export::{Saved, StateVisitor};

/// A field that is missing in saved states if the mistake has its name.
#[derive(Clone)]
pub struct Field<T> {
    name: &'static str,
    pub value: T,
}

impl<T> Field<T> {
    pub fn new(name: &'static str, value: T) -> Self {
        Self { name, value }
    }
}

impl<T: Saved> Saved for Field<T> {
    fn visit(&mut self, visitor: &mut dyn StateVisitor) {
        if mistake() != self.name {
            self.value.visit(visitor);
        }
    }
}
