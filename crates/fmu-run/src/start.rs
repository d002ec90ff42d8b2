//! Start values: from names to value references.

use crate::error::{Error, request};
use crate::found::Found;
use crate::selection::{Target, fits};
use crate::system::{StartValue, System};
use fmi_abi::BaseType;
use std::borrow::Cow;
use std::ffi::{CStr, CString};

/// Start value of a variable. A string is a value of a string variable, an item of an enumeration, or `true`
/// or `false` for a Boolean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Start<'a> {
    /// One number for all runs or instances; 0 or 1 for a Boolean.
    Same(f64),
    /// A number for each run or instance.
    Each(&'a [f64]),
    /// One string for all runs or instances.
    Text(&'a str),
    /// A string for each run or instance.
    EachText(&'a [String]),
}

impl Start<'_> {
    /// Returns the number of runs or instances, if the value is given for each.
    pub(crate) fn count(&self) -> Option<usize> {
        match self {
            Self::Same(_) | Self::Text(_) => None,
            Self::Each(values) => Some(values.len()),
            Self::EachText(texts) => Some(texts.len()),
        }
    }
}

/// Checked start values. Each variable has one value for all runs or instances, or one for each.
#[derive(Clone, Debug, Default)]
pub(crate) struct StartValues<'a> {
    numbers: Vec<(Target, Cow<'a, [f64]>)>,
    texts: Vec<(Target, Vec<CString>)>,
}

impl<'a> StartValues<'a> {
    /// Returns the start values of the system, replaced by the given values.
    pub fn of(system: &System, given: &[(&str, Start<'a>)]) -> Result<Self, Error> {
        let mut all = Self::default();
        for (name, value) in system.start() {
            let start = match value {
                StartValue::Number(number) => Start::Same(*number),
                StartValue::Text(text) => Start::Text(text),
            };
            all.put(StartValues::found(system, name, start)?.into_owned());
        }
        all.put(Self::given(system, given)?);
        Ok(all)
    }

    /// Returns the given start values; each variable may occur only once.
    pub fn given(system: &System, given: &[(&str, Start<'a>)]) -> Result<Self, Error> {
        let mut all = Self::default();
        for (index, (name, start)) in given.iter().enumerate() {
            if given[..index].iter().any(|(before, _)| before == name) {
                return request(format!("{name} is twice among the start values"));
            }
            all.put(Self::found(system, name, *start)?);
        }
        Ok(all)
    }

    /// Adds start values and removes earlier values of the same variables.
    pub fn put(&mut self, new: Self) {
        let is_new = |index: &Target| {
            new.numbers.iter().any(|(of, _)| of == index) || new.texts.iter().any(|(of, _)| of == index)
        };
        self.numbers.retain(|(index, _)| !is_new(index));
        self.texts.retain(|(index, _)| !is_new(index));
        self.numbers.extend(new.numbers);
        self.texts.extend(new.texts);
    }

    /// Returns the numbers of a run or an instance.
    pub fn numbers(&self, of: usize) -> impl Iterator<Item = (Target, f64)> {
        self.numbers.iter().filter_map(move |(index, values)| Some((*index, *one(values, of)?)))
    }

    /// Returns the strings of a run or an instance.
    pub fn texts(&self, of: usize) -> impl Iterator<Item = (Target, &CStr)> {
        self.texts.iter().filter_map(move |(index, texts)| Some((*index, one(texts, of)?.as_c_str())))
    }

    /// Copies borrowed values.
    pub fn into_owned(self) -> StartValues<'static> {
        let own = |(index, numbers): (_, Cow<[f64]>)| (index, Cow::Owned(numbers.into_owned()));
        StartValues { numbers: self.numbers.into_iter().map(own).collect(), texts: self.texts }
    }

    fn found(system: &System, name: &str, start: Start<'a>) -> Result<Self, Error> {
        let mut all = Self::default();
        for found in system.find_startable(name)? {
            let index = Target::of(found);
            let texts: Vec<&str> = match start {
                Start::Same(number) => {
                    all.numbers.push((index, checked(found, name, Cow::Owned(vec![number]))?));
                    continue;
                }
                Start::Each(numbers) => {
                    all.numbers.push((index, checked(found, name, Cow::Borrowed(numbers))?));
                    continue;
                }
                Start::Text(text) => vec![text],
                Start::EachText(texts) => texts.iter().map(String::as_str).collect(),
            };
            if index.base == BaseType::String {
                let texts = texts.iter().map(|text| CString::new(*text)).collect::<Result<_, _>>();
                let Ok(texts) = texts else {
                    return request(format!("the start value of {name} must not contain a character NUL"));
                };
                all.texts.push((index, texts));
            } else {
                let numbers = texts.iter().map(|text| number_of(found, name, text));
                all.numbers.push((index, numbers.collect::<Result<_, _>>()?));
            }
        }
        Ok(all)
    }
}

fn one<T>(values: &[T], of: usize) -> Option<&T> {
    if values.len() == 1 { values.first() } else { values.get(of) }
}

fn checked<'a>(found: Found, name: &str, numbers: Cow<'a, [f64]>) -> Result<Cow<'a, [f64]>, Error> {
    found.check_number(name)?;
    fits(name, found.variable.base, &numbers)?;
    Ok(numbers)
}

/// Returns the number for a string, for a variable that is no string.
fn number_of(found: Found, name: &str, text: &str) -> Result<f64, Error> {
    if found.variable.base == BaseType::Boolean
        && let Ok(boolean) = text.parse::<bool>()
    {
        return Ok(f64::from(u8::from(boolean)));
    }
    match found.description.items(found.variable) {
        Some(items) => {
            let number =
                items.iter().find(|(item, _)| item == text).and_then(|(_, number)| number.parse().ok());
            let known: Vec<_> = items.iter().map(|(item, _)| item.as_str()).collect();
            let why = || format!("{name} is one of {}, its start value cannot be {text:?}", known.join(", "));
            number.ok_or_else(|| Error::Request(why()))
        }
        None => request(format!(
            "{name} is {}, its start value cannot be {text:?}",
            found.variable.kind_in_words()
        )),
    }
}
