//! What depends on what (section 2.2.9 of FMI 3.0).

use super::{Instance, Outcome, independent};
use crate::export::Exported;
use crate::mode::Mode;
use crate::variable::{Causality, Initial, Variability, Variable};

impl<M: Exported> Instance<M> {
    /// The places of what a variable depends on directly.
    ///
    /// Known is what the table says by [`depends_on`](Variable::depends_on). Where it says nothing, these are all knowns
    /// there are, as in a description without dependencies. The description may say less, where fmu-package has found
    /// out more by trying.
    pub fn dependencies(&self, place: u32) -> Outcome<Vec<u32>> {
        let Some(variable) = self.find(place) else { return self.refuse_place(place) };
        let initial = matches!(self.mode(), Mode::Instantiated | Mode::Initialization);
        let is_output = variable.causality() == Causality::Output;
        let is_unknown = matches!(variable.initial(), Some(Initial::Calculated | Initial::Approx))
            || is_output && !initial && variable.variability() != Variability::Constant;
        if !is_unknown {
            return Ok(Vec::new());
        }
        if !initial && variable.is_state() {
            return Ok(vec![place]);
        }
        let is_known = |known: &Variable<M>| match known.causality() {
            Causality::Input | Causality::Independent => true,
            _ if initial => {
                known.initial() == Some(Initial::Exact) && known.variability() != Variability::Constant
            }
            _ => known.is_state(),
        };
        if let Some(declared) = variable.dependencies() {
            return Ok(declared.filter(|known| is_known(&M::TABLE[*known as usize])).collect());
        }
        let known = (0..).zip(M::TABLE).filter(|(_, known)| is_known(known));
        let mut all: Vec<u32> = known.map(|(place, _)| place).collect();
        let (time, _) = independent::<M>();
        if time as usize == M::TABLE.len() {
            all.push(time);
        }
        Ok(all)
    }
}
