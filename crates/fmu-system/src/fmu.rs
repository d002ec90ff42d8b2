//! Reads the data of an FMU that a system needs.

use anyhow::{Result, anyhow, bail, ensure};
use fmu_package::files::unzip;
use fmu_run::{Attributes, Description, Variable};

/// An FMU that has been read.
pub struct Fmu {
    pub bytes: Vec<u8>,
    pub description: Description,
}

/// Names and numbers of the items of an enumeration.
pub type Items = [(String, String)];

impl Fmu {
    /// Reads an FMU from the content of its file.
    pub fn read(bytes: Vec<u8>) -> Result<Self> {
        let text = String::from_utf8(unzip(&bytes, "modelDescription.xml")?)?;
        Ok(Self { bytes, description: Description::parse(&text).map_err(|why| anyhow!(why))? })
    }

    /// Returns a variable of the FMU.
    pub fn variable(&self, name: &str) -> Option<FmuVariable<'_>> {
        Some(FmuVariable { fmu: self, variable: self.description.variable(name)? })
    }
}

/// A variable of an FMU.
#[derive(Clone, Copy)]
pub struct FmuVariable<'a> {
    fmu: &'a Fmu,
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
    pub fn check_settable(self, name: &str) -> Result<()> {
        let Variable { start, .. } = self.variable;
        let Attributes { variability, causality, .. } = &**self.variable;
        let is_constant = variability.as_deref() == Some("constant");
        ensure!(start.is_some() && !is_constant, "{name} is {causality} and takes no start value");
        Ok(())
    }

    /// Fails if the string is not a valid value: a number in the range, `true` or `false`, a string, or an item
    /// of the enumeration.
    pub fn check_start(self, name: &str, text: &str) -> Result<()> {
        let number: Option<f64> = match self.kind() {
            "Real" => text.parse().ok(),
            "Integer" => text.parse::<i64>().ok().map(|value| value as f64),
            _ => None,
        };
        if let Some(value) = number {
            let Attributes { min, max, base, .. } = &**self.variable;
            ensure!(value.is_finite(), "the start value of {name} must be a finite number, it is {value}");
            let [lowest, highest] = match base.range() {
                Some((lowest, highest)) => [Some(lowest as f64), Some(highest as f64)],
                None => [None, None],
            };
            if let Some(min) = min.or(lowest).filter(|min| value < *min) {
                bail!("the start value of {name} must not be below {min}, it is {value}");
            }
            if let Some(max) = max.or(highest).filter(|max| value > *max) {
                bail!("the start value of {name} must not be above {max}, it is {value}");
            }
        }
        let possible = match self.kind() {
            "Real" | "Integer" => number.is_some(),
            "Boolean" => text.parse::<bool>().is_ok(),
            "Enumeration" => self.number_of(text).is_some(),
            "Binary" => false,
            _ => true,
        };
        ensure!(possible, "{name} is {}, its start value cannot be '{}'", self.kind(), text.escape_debug());
        Ok(())
    }
}
