//! Start values: from names to value references.

use crate::error::{Error, request};
use crate::selection::{Place, fits};
use crate::system::{Found, StartValue, System};
use fmi_abi::BaseType;
use std::borrow::Cow;
use std::ffi::{CStr, CString};

/// A start value of a variable. Texts are for texts and name the items of enumerations; `true` and `false` are for Booleans.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Start<'a> {
    /// The same number in all runs or instances; 0 and 1 for Booleans.
    Same(f64),
    /// A number for each.
    Each(&'a [f64]),
    /// The same text in all.
    Text(&'a str),
    /// A text for each.
    EachText(&'a [String]),
}

impl Start<'_> {
    /// How many runs or instances it is for, if it is not for any number.
    pub(crate) fn count(&self) -> Option<usize> {
        match self {
            Self::Same(_) | Self::Text(_) => None,
            Self::Each(values) => Some(values.len()),
            Self::EachText(texts) => Some(texts.len()),
        }
    }
}

/// Start values after all checks: of each variable one for all runs or instances, or one for each.
#[derive(Clone, Debug, Default)]
pub(crate) struct StartValues<'a> {
    numbers: Vec<(Place, Cow<'a, [f64]>)>,
    texts: Vec<(Place, Vec<CString>)>,
}

impl<'a> StartValues<'a> {
    /// Those that a system came with, and in their place those that are given.
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

    /// Those that are given, each variable once.
    pub fn given(system: &System, given: &[(&str, Start<'a>)]) -> Result<Self, Error> {
        let mut all = Self::default();
        for (place, (name, start)) in given.iter().enumerate() {
            if given[..place].iter().any(|(before, _)| before == name) {
                return request(format!("{name} is twice among the start values"));
            }
            all.put(Self::found(system, name, *start)?);
        }
        Ok(all)
    }

    /// Others, in the place of those of the same variables.
    pub fn put(&mut self, new: Self) {
        let is_new = |place: &Place| {
            new.numbers.iter().any(|(of, _)| of == place) || new.texts.iter().any(|(of, _)| of == place)
        };
        self.numbers.retain(|(place, _)| !is_new(place));
        self.texts.retain(|(place, _)| !is_new(place));
        self.numbers.extend(new.numbers);
        self.texts.extend(new.texts);
    }

    /// The numbers of a run or an instance.
    pub fn numbers(&self, of: usize) -> impl Iterator<Item = (Place, f64)> {
        self.numbers.iter().filter_map(move |(place, values)| Some((*place, *one(values, of)?)))
    }

    /// The texts of a run or an instance.
    pub fn texts(&self, of: usize) -> impl Iterator<Item = (Place, &CStr)> {
        self.texts.iter().filter_map(move |(place, texts)| Some((*place, one(texts, of)?.as_c_str())))
    }

    /// With memory of its own.
    pub fn into_owned(self) -> StartValues<'static> {
        let own = |(place, numbers): (_, Cow<[f64]>)| (place, Cow::Owned(numbers.into_owned()));
        StartValues { numbers: self.numbers.into_iter().map(own).collect(), texts: self.texts }
    }

    fn found(system: &System, name: &str, start: Start<'a>) -> Result<Self, Error> {
        let mut all = Self::default();
        for found in system.find_startable(name)? {
            let place = Place::of(found);
            let texts: Vec<&str> = match start {
                Start::Same(number) => {
                    all.numbers.push((place, checked(found, name, Cow::Owned(vec![number]))?));
                    continue;
                }
                Start::Each(numbers) => {
                    all.numbers.push((place, checked(found, name, Cow::Borrowed(numbers))?));
                    continue;
                }
                Start::Text(text) => vec![text],
                Start::EachText(texts) => texts.iter().map(String::as_str).collect(),
            };
            if place.base == BaseType::String {
                let texts = texts.iter().map(|text| CString::new(*text)).collect::<Result<_, _>>();
                let Ok(texts) = texts else {
                    return request(format!("the start value of {name} must not contain a character NUL"));
                };
                all.texts.push((place, texts));
            } else {
                let numbers = texts.iter().map(|text| number_of(found, name, text));
                all.numbers.push((place, numbers.collect::<Result<_, _>>()?));
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
    fits(name, found.of.base, &numbers)?;
    Ok(numbers)
}

/// What a text stands for, if it is no text.
fn number_of(found: Found, name: &str, text: &str) -> Result<f64, Error> {
    if found.of.base == BaseType::Boolean
        && let Ok(truth) = text.parse::<bool>()
    {
        return Ok(f64::from(u8::from(truth)));
    }
    match found.description.items(found.of) {
        Some(items) => {
            let number =
                items.iter().find(|(item, _)| item == text).and_then(|(_, number)| number.parse().ok());
            let known: Vec<_> = items.iter().map(|(item, _)| item.as_str()).collect();
            let why = || format!("{name} is one of {}, its start value cannot be {text:?}", known.join(", "));
            number.ok_or_else(|| Error::Request(why()))
        }
        None => request(format!("{name} is {}, its start value cannot be {text:?}", found.of.what())),
    }
}
