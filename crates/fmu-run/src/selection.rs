//! Groups of variables that are set or read together.

use crate::change::Change;
use crate::connector::End;
use crate::error::{Error, request};
use crate::instance::Instance;
use crate::lookup::Found;
use fmi_abi::client::Rejection;
use fmi_abi::{BaseType, Standard, shown_number};
use std::collections::HashMap;

/// Variables that have been looked up by name, and whose values are numbers or Booleans. A row has one value for each name, in
/// their order. Booleans are 0 or 1.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Selection {
    names: Vec<String>,
    groups: Vec<Group>,
    /// Whether all variables are Real and belong to one component, and each name denotes one variable, so that a row is passed to
    /// the FMU unchanged.
    is_direct: bool,
    /// Reason why a caller cannot set the variables: one of them is read-only, a structural parameter or connected to an output, or is
    /// there twice.
    read_only: Option<String>,
}

/// Variables of one component and one type, which one call sets or reads.
#[derive(Clone, Debug, PartialEq)]
struct Group {
    component: usize,
    standard: Standard,
    base: BaseType,
    references: Vec<u32>,
    /// Indices of the values in a row.
    indices: Vec<usize>,
    /// Changes between the value of a connector of the system and the value of its variable, which differ, for example,
    /// in the unit: the index of the variable among the references, the change from the connector to the variable, and
    /// its inverse. Variables with the same value as their connector are not listed.
    changes: Vec<(usize, [Change; 2])>,
}

/// Variables that get values, to find one that gets two. Two names may denote one variable, such as a connector of a system and the
/// variable that it feeds.
#[derive(Default)]
pub(crate) struct Assigned<'a> {
    /// Variables and their names, each with the number of the name.
    all: Vec<(Target, usize, &'a str)>,
    count: usize,
}

impl<'a> Assigned<'a> {
    pub fn add(&mut self, name: &'a str, found: &[Found]) {
        self.all.extend(found.iter().map(|found| (Target::of(*found), self.count, name)));
        self.count += 1;
    }

    /// Fails if a variable is there twice.
    pub fn check(mut self, list: &str) -> Result<(), Error> {
        if self.count < 2 {
            return Ok(());
        }
        self.all.sort_unstable_by_key(|(of, number, _)| (of.reference, of.base as u8, of.component, *number));
        match self.all.windows(2).find(|two| two[0].0 == two[1].0 && two[0].1 != two[1].1) {
            Some([(.., one), (.., other)]) if one == other => {
                request(format!("{one} is twice among the {list}"))
            }
            Some([(.., one), (.., other)]) => {
                request(format!("{one} and {other} among the {list} are the same variable; give one of them"))
            }
            _ => Ok(()),
        }
    }
}

/// Identifies a variable: component, type and value reference.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Target {
    pub component: usize,
    pub base: BaseType,
    pub reference: u32,
}

impl Target {
    pub fn of(found: Found) -> Self {
        Self { component: found.component, base: found.variable.base, reference: found.variable.reference }
    }
}

impl Selection {
    /// Returns the number of names, which is the number of values in a row.
    pub fn len(&self) -> usize {
        self.names.len()
    }

    /// Returns whether there are no names.
    pub fn is_empty(&self) -> bool {
        self.names.is_empty()
    }

    /// Returns the names of the variables.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Adds a name and all variables that it denotes.
    pub(crate) fn push(&mut self, name: &str, found: &[Found]) {
        self.push_with(name, found, |groups, (component, base)| {
            let of_type = |group: &Group| group.component == component && group.base == base;
            groups.iter().position(of_type).unwrap_or(groups.len())
        });
    }

    /// Forbids setting the variables, for this reason.
    pub(crate) fn forbid(&mut self, reason: String) {
        self.read_only.get_or_insert(reason);
    }

    /// Adds a name and all variables that it denotes. `known` maps component and type to the index of a group, which is faster than a
    /// search if there are many groups.
    pub(crate) fn push_to(
        &mut self,
        known: &mut HashMap<(usize, BaseType), usize>,
        name: &str,
        found: &[Found],
    ) {
        self.push_with(name, found, |groups, of_type| *known.entry(of_type).or_insert(groups.len()));
    }

    /// Adds a name. `index_of` returns the index of the group for a component and a type, or the number of groups if there is no such
    /// group.
    fn push_with(
        &mut self,
        name: &str,
        found: &[Found],
        mut index_of: impl FnMut(&[Group], (usize, BaseType)) -> usize,
    ) {
        let row = self.names.len();
        self.names.push(name.to_owned());
        if self.read_only.is_none() {
            let reason = found.iter().find_map(|found| found.check_settable(name).err());
            self.read_only = reason.map(|error| error.to_string());
        }
        for found in found {
            let Target { component, base, reference } = Target::of(*found);
            let index = index_of(&self.groups, (component, base));
            if index == self.groups.len() {
                let (references, indices, changes) = (Vec::new(), Vec::new(), Vec::new());
                let standard = found.description.standard;
                self.groups.push(Group { component, standard, base, references, indices, changes });
            }
            if let Some((_, End { into, out, .. })) = found.connector
                && !into.is_identity()
            {
                let number = self.groups[index].references.len();
                self.groups[index].changes.push((number, [into.clone(), out.clone()]));
            }
            self.groups[index].references.push(reference);
            self.groups[index].indices.push(row);
        }
        let [group] = &*self.groups else { return self.is_direct = false };
        self.is_direct = group.base == BaseType::Real
            && group.indices.len() == self.names.len()
            && group.changes.is_empty();
    }

    /// Returns the value references if they correspond to the values of a row, because `is_direct` is true or there are no
    /// variables.
    pub(crate) fn references(&self) -> Option<&[u32]> {
        match self.groups.first() {
            None => Some(&[]),
            Some(group) => self.is_direct.then_some(&group.references),
        }
    }

    /// Fails if a caller may not set the variables, or not to the values of these rows.
    #[inline]
    pub(crate) fn check(&self, values: &[f64]) -> Result<(), Error> {
        if self.is_direct && self.read_only.is_none() { Ok(()) } else { self.check_each(values) }
    }

    fn check_each(&self, values: &[f64]) -> Result<(), Error> {
        if let Some(why) = &self.read_only {
            return request(why.clone());
        }
        for Group { standard, base, indices, .. } in &self.groups {
            for (index, row) in
                indices.iter().flat_map(|index| values.chunks_exact(self.len()).map(move |row| (*index, row)))
            {
                fits(&self.names[index], (*base, *standard), &row[index..=index])?;
            }
        }
        Ok(())
    }

    /// Reads the values into a row. `buffer` saves allocations.
    #[inline(always)]
    pub(crate) fn get(
        &self,
        components: &mut [Instance],
        buffer: &mut Vec<f64>,
        row: &mut [f64],
    ) -> Result<(), Rejection> {
        if self.is_direct {
            let Group { component, references, .. } = &self.groups[0];
            return components[*component].get(BaseType::Real, references, row);
        }
        for Group { component, base, references, indices, changes, .. } in &self.groups {
            buffer.resize(references.len(), 0.0);
            components[*component].get(*base, references, buffer)?;
            for (index, [_, out]) in changes {
                buffer[*index] = out.apply(buffer[*index]);
            }
            if matches!(base, BaseType::Int64 | BaseType::UInt64 | BaseType::Enumeration) {
                self.check_rounding(indices, buffer)?;
            }
            indices.iter().zip(&*buffer).for_each(|(index, value)| row[*index] = *value);
        }
        Ok(())
    }

    /// Fails if a 64-bit integer is so large that it may have been rounded.
    fn check_rounding(&self, indices: &[usize], values: &[f64]) -> Result<(), Rejection> {
        match indices.iter().zip(values).find(|(_, value)| value.abs() >= EXACT) {
            None => Ok(()),
            Some((index, value)) => Err(Rejection::without_fmu(
                "get",
                &format!(
                    "{} is about {value}, an integer that floating-point numbers do not have; read it by itself, which returns integers",
                    self.names[*index]
                ),
            )),
        }
    }

    /// Sets the variables to the values of a row. `buffer` saves allocations.
    #[inline(always)]
    pub(crate) fn set(
        &self,
        components: &mut [Instance],
        buffer: &mut Vec<f64>,
        row: &[f64],
    ) -> Result<(), Rejection> {
        if self.is_direct {
            let Group { component, references, .. } = &self.groups[0];
            return components[*component].set(BaseType::Real, references, row);
        }
        for Group { component, base, references, indices, changes, .. } in &self.groups {
            buffer.clear();
            buffer.extend(indices.iter().map(|index| row[*index]));
            for (index, [into, _]) in changes {
                buffer[*index] = into.apply(buffer[*index]);
            }
            components[*component].set(*base, references, buffer)?;
        }
        Ok(())
    }
}

/// Integers below this magnitude are exact in `f64`.
const EXACT: f64 = (1_u64 << f64::MANTISSA_DIGITS) as f64;

/// Checks that variables of this type can have these values. The FMU itself checks values of floating-point variables, unless `f32`
/// cannot represent them. Enumerations have 32 bits in FMI 2.0 and 64 bits in FMI 3.0 (section 2.2.7.2 of FMI 3.0).
pub(crate) fn fits(name: &str, (base, standard): (BaseType, Standard), values: &[f64]) -> Result<(), Error> {
    let (low, high) = match (base, standard) {
        (BaseType::Float32, _) => {
            let too_large = values.iter().find(|value| value.is_finite() && (**value as f32).is_infinite());
            return too_large.map_or(Ok(()), |value| {
                request(format!("{name} is a 32-bit floating-point number and cannot be {value:e}"))
            });
        }
        (BaseType::Boolean, _) => (0.0, 1.0),
        (BaseType::Enumeration, Standard::Fmi2) => (f64::from(i32::MIN), f64::from(i32::MAX)),
        // Larger integers may have been rounded before they came here. By itself, a 64-bit integer is set as an integer.
        (BaseType::Enumeration, Standard::Fmi3) | (BaseType::Int64, _) => (1.0 - EXACT, EXACT),
        (BaseType::UInt64, _) => (0.0, EXACT),
        (base, _) => match base.range() {
            Some((low, high)) => (low as f64, high as f64),
            None => return Ok(()),
        },
    };
    // The upper limits of 64-bit integers are rounded up to powers of two, which are out of range.
    let fits = |value: f64| (low..=high).contains(&value) && !(high > 1e15 && value == high);
    match values.iter().find(|value| value.fract() != 0.0 || !fits(**value)) {
        None => Ok(()),
        Some(value) if base == BaseType::Boolean => {
            request(format!("{name} is a Boolean and cannot be {}", shown_number(*value)))
        }
        Some(value) if value.fract() != 0.0 => {
            request(format!("{name} is an integer and cannot be {}", shown_number(*value)))
        }
        Some(value) => {
            let value = shown_number(*value);
            request(format!("{name} is an integer from {low} to {high} and cannot be {value}"))
        }
    }
}
