//! Variables that are set or read together.

use crate::error::{Error, request};
use crate::instance::Instance;
use crate::refusal::Refusal;
use crate::system::{Found, System};
use fmi_abi::BaseType;

/// Variables that are numbers, found once by their names. A row of values has one for each, in this order; 0 and 1 stand for
/// Booleans.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Selection {
    names: Vec<String>,
    groups: Vec<Group>,
    /// All are Real variables of one component, so that a row goes over as it is.
    is_direct: bool,
    /// Why a caller cannot set them, if one is read-only or fed by an output.
    read_only: Option<String>,
}

/// Those of one component.
#[derive(Clone, Debug, Default, PartialEq)]
struct Group {
    part: usize,
    /// The value references of those that are Real, set and read by one call, and their places in a row.
    reals: Vec<u32>,
    places: Vec<usize>,
    others: Vec<(BaseType, u32, usize)>,
}

/// Where a value goes: component, type and value reference.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Place {
    pub part: usize,
    pub base: BaseType,
    pub reference: u32,
}

impl Place {
    pub fn of(found: Found) -> Self {
        Self { part: found.part, base: found.of.base, reference: found.of.reference }
    }
}

impl Selection {
    /// The number of variables.
    pub fn len(&self) -> usize {
        self.names.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.names.is_empty()
    }

    /// Their names.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// One more: all that its name stands for.
    pub(crate) fn push(&mut self, name: &str, found: &[Found]) {
        let row = self.names.len();
        self.names.push(name.to_owned());
        let read_only = found.iter().find_map(|found| found.check_settable(name).err());
        self.read_only = self.read_only.take().or(read_only.map(|error| error.to_string()));
        for Place { part, base, reference } in found.iter().copied().map(Place::of) {
            let place = self.groups.iter().position(|group| group.part == part);
            let place = place.unwrap_or_else(|| {
                self.groups.push(Group { part, ..Group::default() });
                self.groups.len() - 1
            });
            let group = &mut self.groups[place];
            match base {
                BaseType::Real => {
                    group.reals.push(reference);
                    group.places.push(row);
                }
                base => group.others.push((base, reference, row)),
            }
        }
        self.is_direct = self.groups.len() == 1 && self.groups[0].places.len() == self.names.len();
    }

    /// The value references, if all are Real variables of one component.
    pub(crate) fn references(&self) -> Option<&[u32]> {
        match self.groups.first() {
            None => Some(&[]),
            Some(group) => self.is_direct.then_some(&group.reals),
        }
    }

    /// Fails unless a caller may set them to the values of these rows.
    #[inline]
    pub(crate) fn check(&self, values: &[f64]) -> Result<(), Error> {
        if self.is_direct && self.read_only.is_none() { Ok(()) } else { self.check_each(values) }
    }

    fn check_each(&self, values: &[f64]) -> Result<(), Error> {
        if let Some(why) = &self.read_only {
            return request(why.clone());
        }
        for (base, _, place) in self.groups.iter().flat_map(|group| &group.others) {
            for row in values.chunks_exact(self.len()) {
                fits(&self.names[*place], *base, &row[*place..=*place])?;
            }
        }
        Ok(())
    }

    /// The values into a row, over a buffer.
    #[inline]
    pub(crate) fn get(
        &self,
        parts: &mut [Instance],
        buffer: &mut Vec<f64>,
        row: &mut [f64],
    ) -> Result<(), Refusal> {
        if self.is_direct {
            let group = &self.groups[0];
            return parts[group.part].get_reals(&group.reals, row);
        }
        for Group { part, reals, places, others } in &self.groups {
            let instance = &mut parts[*part];
            if !reals.is_empty() {
                buffer.resize(reals.len(), 0.0);
                instance.get_reals(reals, buffer)?;
                for (place, value) in places.iter().zip(&*buffer) {
                    row[*place] = *value;
                }
            }
            for (base, reference, place) in others {
                row[*place] = instance.get_number(*base, *reference)?;
            }
        }
        Ok(())
    }

    /// Sets the values of a row, over a buffer.
    #[inline]
    pub(crate) fn set(
        &self,
        parts: &mut [Instance],
        buffer: &mut Vec<f64>,
        row: &[f64],
    ) -> Result<(), Refusal> {
        if self.is_direct {
            let group = &self.groups[0];
            return parts[group.part].set_reals(&group.reals, row);
        }
        for Group { part, reals, places, others } in &self.groups {
            let instance = &mut parts[*part];
            if !reals.is_empty() {
                buffer.clear();
                buffer.extend(places.iter().map(|place| row[*place]));
                instance.set_reals(reals, buffer)?;
            }
            for (base, reference, place) in others {
                instance.set_number(*base, *reference, row[*place])?;
            }
        }
        Ok(())
    }
}

impl System {
    /// Finds variables by their names.
    ///
    /// # Errors
    /// [`Error::Request`], when there is none of a name, or it is no number.
    pub fn select(&self, names: &[impl AsRef<str>]) -> Result<Selection, Error> {
        let mut selection = Selection::default();
        for name in names.iter().map(AsRef::as_ref) {
            selection.push(name, &self.find_numbers(name)?);
        }
        Ok(selection)
    }
}

/// Whole numbers and Booleans take no other values. What a Real takes is the FMU's to say.
pub(crate) fn fits(name: &str, base: BaseType, values: &[f64]) -> Result<(), Error> {
    let (low, high) = match base {
        BaseType::Boolean => (0.0, 1.0),
        BaseType::Enumeration => (f64::from(i32::MIN), f64::from(i32::MAX)),
        base => match base.range() {
            Some((low, high)) => (low as f64, high as f64),
            None => return Ok(()),
        },
    };
    match values.iter().find(|value| value.fract() != 0.0 || !(low..=high).contains(*value)) {
        None => Ok(()),
        Some(value) if base == BaseType::Boolean => {
            request(format!("{name} is a Boolean and cannot be {value}"))
        }
        Some(value) => {
            request(format!("{name} is a whole number from {low} to {high} and cannot be {value}"))
        }
    }
}
