//! Calls that set and read variables and vectors.

use super::reads::Read;
use super::{Writer, access};
use crate::call_sequence::{Arg, Kind, Values};
use crate::description::{kind_of, type_name};

impl Writer<'_> {
    /// Groups variables by type, without clocks and variables of unknown size. Returns for each type its name in getters and
    /// setters, its C type, and the positions of its variables in `indices`.
    fn by_type(&self, indices: &[usize]) -> Vec<(&'static str, Kind, Vec<usize>)> {
        let standard = self.description.standard;
        let mut groups: Vec<(&str, Kind, Vec<usize>)> = Vec::new();
        for (position, index) in indices.iter().enumerate() {
            let variable = &self.description.variables[*index];
            let (Some(base), Some(_)) = (variable.base, variable.size) else { continue };
            let name = type_name(standard, base);
            match groups.iter_mut().find(|group| group.0 == name) {
                Some(group) => group.2.push(position),
                None => groups.push((name, kind_of(standard, base), vec![position])),
            }
        }
        groups
    }

    fn reference(&self, index: usize) -> u64 {
        u64::from(self.description.variables[index].reference)
    }

    /// Sets the values of variables, with a call for each type.
    pub fn set(&mut self, instance: usize, values: &[(usize, Values)]) -> Vec<u32> {
        let indices: Vec<usize> = values.iter().map(|(index, _)| *index).collect();
        let mut ids = Vec::new();
        for (name, kind, positions) in self.by_type(&indices) {
            let references = positions.iter().map(|at| self.reference(indices[*at])).collect();
            let (mut numbers, mut texts) = (Vec::new(), Vec::new());
            for position in positions {
                match &values[position].1 {
                    Values::Numbers(_, bits) => numbers.extend(bits),
                    Values::Strings(all) => texts.extend(all.iter().cloned()),
                }
            }
            let total = numbers.len() + texts.len();
            let values = match name {
                "Binary" => {
                    let blobs: Vec<Vec<u8>> = texts.into_iter().flatten().collect();
                    let sizes = blobs.iter().map(|blob| blob.len() as u64).collect();
                    vec![Arg::In(Kind::Size, sizes), Arg::Blobs(blobs)]
                }
                "String" => vec![Arg::Strings(texts)],
                _ => vec![Arg::In(kind, numbers)],
            };
            let args = access(self.description.standard, references, values, total);
            ids.push(self.call(instance, &format!("Set{name}"), args));
        }
        ids
    }

    /// Sets the numbers of a variable.
    pub fn set_numbers(&mut self, instance: usize, index: usize, numbers: &[f64]) -> Vec<u32> {
        self.set(instance, &[(index, Values::new(self.description.kind(index), numbers.iter().copied()))])
    }

    /// Reads the variables at these indices with a call for each type. In Initialization Mode, reads only the variables that may
    /// be read in this mode.
    pub fn read_these(&mut self, instance: usize, indices: &[usize]) -> Vec<Read> {
        if !self.modes.is_initializing(instance) {
            return self.read_anyway(instance, indices);
        }
        let allowed = |index: &usize| self.description.is_readable_while_initializing(*index);
        let indices: Vec<usize> = indices.iter().copied().filter(allowed).collect();
        self.read_anyway(instance, &indices)
    }

    /// Reads all variables at these indices with a call for each type. In Initialization Mode, an FMU of FMI 2.0 may reject some
    /// of these calls, which is not a finding.
    pub fn read_anyway(&mut self, instance: usize, indices: &[usize]) -> Vec<Read> {
        let mut reads = Vec::new();
        for (name, kind, positions) in self.by_type(indices) {
            let size = |index: usize| self.description.variables[index].size.unwrap_or(1);
            let group: Vec<_> = positions.iter().map(|at| (indices[*at], size(indices[*at]))).collect();
            let references = group.iter().map(|(index, _)| self.reference(*index)).collect();
            let total: usize = group.iter().map(|(_, size)| size).sum();
            let sizes = (name == "Binary").then_some(Arg::Out(Kind::Size, total));
            let values = sizes.into_iter().chain([Arg::Out(kind, total)]);
            let args = access(self.description.standard, references, values, total);
            reads.push(Read { id: self.call(instance, &format!("Get{name}"), args), variables: group });
        }
        reads
    }

    /// Reads the variables that most checks read.
    pub fn read(&mut self, instance: usize) -> Vec<Read> {
        self.read_these(instance, self.readable)
    }

    /// Reads the variables and, in Model Exchange, the continuous states, their derivatives and the event indicators.
    pub fn read_all(&mut self, instance: usize) -> Vec<Read> {
        let mut reads = self.read(instance);
        if !self.trajectory.is_stepped() {
            let vectors = self.vectors(instance).into_iter().flatten();
            reads.extend(vectors.map(|id| Read { id, variables: Vec::new() }));
        }
        reads
    }
}
