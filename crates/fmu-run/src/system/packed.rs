//! The FMUs of a system that is written.

use crate::description::{Attributes, Description, Variable};
use fmi_abi::Variability;
use fmi_abi::write::unzip;
use std::path::Path;

/// An FMU that is packed into a system.
pub(super) struct PackedFmu {
    pub bytes: Vec<u8>,
    pub description: Description,
}

/// Names and numbers of the items of an enumeration.
pub(super) type Items = [(String, String)];

impl PackedFmu {
    /// Reads an FMU.
    pub fn read(path: &Path) -> Result<Self, String> {
        let bytes = std::fs::read(path).map_err(|error| format!("it cannot be read: {error}"))?;
        let text = String::from_utf8(unzip(&bytes, "modelDescription.xml")?);
        let description = Description::parse(&text.map_err(|error| error.to_string())?)?;
        Ok(Self { bytes, description })
    }

    /// Returns a variable of the FMU.
    pub fn variable(&self, name: &str) -> Option<FmuVariable<'_>> {
        Some(FmuVariable { fmu: self, variable: self.description.variable(name)? })
    }
}

/// A variable of an FMU.
#[derive(Clone, Copy)]
pub(super) struct FmuVariable<'a> {
    fmu: &'a PackedFmu,
    pub variable: &'a Variable,
}

impl<'a> FmuVariable<'a> {
    /// Returns the type name that SSP 1.0 and OSP use.
    pub fn kind(self) -> &'static str {
        self.variable.kind()
    }

    /// Fails if the variable must not be connected to this input.
    pub fn check_feeds(self, input: Self) -> Result<(), String> {
        self.fmu.description.connects(self.variable, &input.fmu.description, input.variable)
    }

    /// Returns the name and the items of its enumeration, if it has one.
    pub fn items(self) -> Option<(&'a str, &'a Items)> {
        let name = self.variable.declared_type.as_deref()?;
        let (name, items) = self.fmu.description.enumerations.get_key_value(name)?;
        Some((name, items))
    }

    /// Returns the number of an item of its enumeration.
    pub fn number_of(self, item: &str) -> Option<&'a str> {
        let (_, items) = self.items()?;
        items.iter().find(|(name, _)| name == item).map(|(_, number)| number.as_str())
    }

    /// Fails if a system cannot set the start value of this variable.
    pub fn check_settable(self, name: &str) -> Result<(), String> {
        let Variable { start, .. } = self.variable;
        let Attributes { variability, causality, .. } = &**self.variable;
        let is_constant = *variability == Some(Variability::Constant);
        match start.is_some() && !is_constant {
            true => Ok(()),
            false => Err(format!("{name} is {causality} and takes no start value")),
        }
    }

    /// Fails if the string is not a valid value: a number in the range, `true` or `false`, a string, or an item
    /// of the enumeration.
    pub fn check_start(self, name: &str, text: &str) -> Result<(), String> {
        let number: Option<f64> = match self.kind() {
            "Real" => text.parse().ok(),
            "Integer" => text.parse::<i64>().ok().map(|value| value as f64),
            _ => None,
        };
        if let Some(value) = number {
            let Attributes { min, max, base, .. } = &**self.variable;
            let must = |rule: String| Err(format!("the start value of {name} must {rule}, it is {value}"));
            if !value.is_finite() {
                return must("be a finite number".to_owned());
            }
            let [lowest, highest] = match base.range() {
                Some((lowest, highest)) => [Some(lowest as f64), Some(highest as f64)],
                None => [None, None],
            };
            if let Some(min) = min.or(lowest).filter(|min| value < *min) {
                return must(format!("not be below {min}"));
            }
            if let Some(max) = max.or(highest).filter(|max| value > *max) {
                return must(format!("not be above {max}"));
            }
        }
        let possible = match self.kind() {
            "Real" | "Integer" => number.is_some(),
            "Boolean" => text.parse::<bool>().is_ok(),
            "Enumeration" => self.number_of(text).is_some(),
            "Binary" => false,
            _ => true,
        };
        match possible {
            true => Ok(()),
            false => {
                Err(format!("{name} is {}, its start value cannot be '{}'", self.kind(), text.escape_debug()))
            }
        }
    }
}
