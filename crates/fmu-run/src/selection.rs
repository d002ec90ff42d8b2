//! Variables that are set or read together.

use crate::description::Variable;
use crate::error::Error;
use crate::fmu::Fmu;
use crate::instance::Instance;
use crate::refusal::Refusal;
use fmi_abi::BaseType;
use std::ffi::CString;

/// Variables of an FMU that are numbers, found once by their names. A row of values has one for each, in this order; 0 and 1
/// stand for Booleans.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Selection {
    /// The value references of those that are Real, set and read by one call, and their places in a row.
    reals: Vec<u32>,
    places: Vec<usize>,
    others: Vec<(BaseType, u32, usize)>,
}

impl Selection {
    /// The number of variables.
    pub fn len(&self) -> usize {
        self.reals.len() + self.others.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    pub(crate) fn push(&mut self, of: &Variable) {
        let place = self.len();
        match of.base {
            BaseType::Real => {
                self.reals.push(of.reference);
                self.places.push(place);
            }
            base => self.others.push((base, of.reference, place)),
        }
    }

    /// The value references, if all are Real.
    pub(crate) fn references(&self) -> Option<&[u32]> {
        self.others.is_empty().then_some(&self.reals)
    }

    /// The values into a row, over a buffer.
    #[inline]
    pub(crate) fn get(
        &self,
        instance: &mut Instance,
        buffer: &mut Vec<f64>,
        row: &mut [f64],
    ) -> Result<(), Refusal> {
        if self.others.is_empty() {
            return if self.reals.is_empty() { Ok(()) } else { instance.get_reals(&self.reals, row) };
        }
        if !self.reals.is_empty() {
            buffer.resize(self.reals.len(), 0.0);
            instance.get_reals(&self.reals, buffer)?;
            for (place, value) in self.places.iter().zip(&*buffer) {
                row[*place] = *value;
            }
        }
        for (base, reference, place) in &self.others {
            row[*place] = instance.get_number(*base, *reference)?;
        }
        Ok(())
    }

    /// Sets the values of a row, over a buffer.
    #[inline]
    pub(crate) fn set(
        &self,
        instance: &mut Instance,
        buffer: &mut Vec<f64>,
        row: &[f64],
    ) -> Result<(), Refusal> {
        if self.others.is_empty() {
            return if self.reals.is_empty() { Ok(()) } else { instance.set_reals(&self.reals, row) };
        }
        if !self.reals.is_empty() {
            buffer.clear();
            buffer.extend(self.places.iter().map(|place| row[*place]));
            instance.set_reals(&self.reals, buffer)?;
        }
        for (base, reference, place) in &self.others {
            instance.set_number(*base, *reference, row[*place])?;
        }
        Ok(())
    }
}

impl Fmu {
    /// Finds variables by their names.
    ///
    /// # Errors
    /// [`Error::Request`], when there is none of a name, or it is no number.
    pub fn select(&self, names: &[impl AsRef<str>]) -> Result<Selection, Error> {
        let mut selection = Selection::default();
        for name in names {
            selection.push(number(self, name.as_ref())?);
        }
        Ok(selection)
    }
}

pub(crate) fn request<T>(message: String) -> Result<T, Error> {
    Err(Error::Request(message))
}

/// The variable of this name; one of a similar name is told where there is none.
fn find<'f>(fmu: &'f Fmu, name: &str) -> Result<&'f Variable, Error> {
    let description = fmu.description();
    if let Some(found) = description.variable(name) {
        return Ok(found);
    }
    let names = description.variables.iter().map(|variable| variable.name.as_str());
    let near = names.min_by_key(|known| strsim::levenshtein(&known.to_lowercase(), &name.to_lowercase()));
    let hint = near.map_or(String::new(), |near| format!("; did you mean {near:?}?"));
    request(format!("{} has no variable {name:?}{hint}", description.model_name))
}

/// The variable of this name, if it is a number.
pub(crate) fn number<'f>(fmu: &'f Fmu, name: &str) -> Result<&'f Variable, Error> {
    let of = find(fmu, name)?;
    if matches!(of.base, BaseType::String | BaseType::Binary) {
        return request(format!("{name} is no number"));
    }
    Ok(of)
}

/// The value reference and the text of a start value.
pub(crate) fn text_of_start(fmu: &Fmu, name: &str, text: &str) -> Result<(u32, CString), Error> {
    let of = find(fmu, name)?;
    if of.base != BaseType::String {
        return request(format!("{name} is a number, its start value cannot be {text:?}"));
    }
    match CString::new(text) {
        Ok(text) => Ok((of.reference, text)),
        Err(_) => request(format!("the start value of {name} must not contain a character NUL")),
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
