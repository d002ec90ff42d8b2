//! The structure of a system that is written, and the checks of its consistency.

use crate::description::{Attributes, Description};
use crate::error::{Error, request};
use crate::lookup::{Found, is_exact};
use crate::start::{exact, number_of};
use crate::system::definition::check_direction;
use fmi_abi::BaseUnit;
use fmi_abi::write::{Element, unzip};
use fmi_abi::{Causality, Value};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// FMUs and their connections, to be written for others: as SSP, or for libcosim. The FMUs may be for another machine, because they are
/// not loaded. Variables of FMUs are written `component.variable`.
///
/// ```no_run
/// # fn main() -> Result<(), fmu_run::Error> {
/// let structure = fmu_run::SystemStructure {
///     name: "loop",
///     description: "A plant with its controller",
///     components: vec![("law", "law.fmu".into()), ("plant", "plant.fmu".into())],
///     inputs: vec![("reference", "law.r", "0.5".into())],
///     outputs: vec![("angle", "plant.y")],
///     connections: vec![("law.u", "plant.u"), ("plant.y", "law.y")],
///     start: vec![("plant.friction", "true".into())],
///     stop_time: 2.0,
///     step_size: 0.001,
/// };
/// structure.check()?.write_ssp("loop.ssp".as_ref())?;
/// # Ok(())
/// # }
/// ```
///
/// Start values are strings: numbers; `true`, `false`, `1` or `0`; an item of an enumeration; or the value of a String.
#[derive(Clone, Debug)]
pub struct SystemStructure<'a> {
    /// Name for users.
    pub name: &'a str,
    /// Description in one sentence.
    pub description: &'a str,
    /// Components: name and file of the FMU.
    pub components: Vec<(&'a str, PathBuf)>,
    /// Inputs of the system: name, connected input of a component, start value in the unit of the component's input.
    pub inputs: Vec<(&'a str, &'a str, String)>,
    /// Outputs of the system: name, connected output of a component.
    pub outputs: Vec<(&'a str, &'a str)>,
    /// Connections from outputs to inputs.
    pub connections: Vec<(&'a str, &'a str)>,
    /// Start values that replace the start values of the FMUs.
    pub start: Vec<(&'a str, String)>,
    /// Stop time of the default experiment, s; the start time is 0.
    pub stop_time: f64,
    /// Communication step size of the default experiment, s.
    pub step_size: f64,
}

/// The structure of a system whose FMUs have been read and whose connections have been checked.
pub struct CheckedStructure<'a> {
    pub(super) structure: &'a SystemStructure<'a>,
    /// The FMUs of the components: their bytes and model descriptions.
    fmus: Vec<(Vec<u8>, Description)>,
    /// Definitions of the units of all FMUs by name.
    pub(super) units: BTreeMap<String, Option<BaseUnit>>,
}

impl<'a> SystemStructure<'a> {
    /// Reads the FMUs and checks the connections against their model descriptions.
    ///
    /// # Errors
    /// Returns [`Error::Fmu`] if an FMU cannot be read. Returns [`Error::Request`] if a component's name is invalid or
    /// used twice, if two different FMUs share a file name, if a variable is unknown or has the wrong causality, if the
    /// ends of a connection differ in type or unit, if an input is fed twice, or if a start value or time is invalid.
    pub fn check(&'a self) -> Result<CheckedStructure<'a>, Error> {
        let mut checked = CheckedStructure { structure: self, fmus: Vec::new(), units: BTreeMap::new() };
        for (what, value) in [("stop time", self.stop_time), ("step size", self.step_size)] {
            if !(value.is_finite() && value > 0.0) {
                return request(format!("the {what} must be finite and > 0, it is {value}"));
            }
        }
        for (index, (component, path)) in self.components.iter().enumerate() {
            if component.is_empty() || component.contains(['.', '/', '\\']) {
                return request(format!(
                    "'{component}' cannot name a component, because it is empty or has a dot or slash in it"
                ));
            }
            if self.components[..index].iter().any(|(other, _)| other == component) {
                return request(format!("two components are named {component}"));
            }
            let unusable = |why| Error::Fmu(format!("{} is not a usable FMU: {why}", path.display()));
            checked.read(path).map_err(unusable)?;
        }
        checked.check_files()?;
        let mut fed = Vec::new();
        for (_, to, start) in &self.inputs {
            check_start(checked.find(to, Causality::Input)?, to, start)?;
            fed.push(*to);
        }
        for (_, from) in &self.outputs {
            checked.find(from, Causality::Output)?;
        }
        for (from, to) in &self.connections {
            let (a, b) = (checked.variable(from)?, checked.variable(to)?);
            check_direction([from, to], [a.variable, b.variable])?;
            let connects = a.description.connects(a.variable, b.description, b.variable);
            connects.map_err(|why| Error::Request(format!("{from} cannot feed {to}: {why}")))?;
            fed.push(*to);
        }
        fed.sort_unstable();
        if let Some(pair) = fed.windows(2).find(|pair| pair[0] == pair[1]) {
            return request(format!("{} is fed twice", pair[0]));
        }
        for (name, start) in &self.start {
            check_start(checked.variable(name)?, name, start)?;
        }
        Ok(checked)
    }
}

impl CheckedStructure<'_> {
    fn read(&mut self, path: &Path) -> Result<(), String> {
        let bytes = std::fs::read(path).map_err(|error| format!("it cannot be read: {error}"))?;
        let text = String::from_utf8(unzip(&bytes, "modelDescription.xml")?);
        let description = Description::parse(&text.map_err(|error| error.to_string())?)?;
        for (name, unit) in &description.units {
            let before = self.units.entry(name.clone()).or_insert(unit.base);
            if *before != unit.base {
                return Err(format!("its unit {name} differs from the unit of this name in another FMU"));
            }
        }
        self.fmus.push((bytes, description));
        Ok(())
    }

    /// Checks that different FMUs have different file names. Components with equal FMUs share one file.
    fn check_files(&self) -> Result<(), Error> {
        let mut files = BTreeMap::new();
        for ((_, path), (bytes, _)) in self.structure.components.iter().zip(&self.fmus) {
            let (first, content) = files.entry(file_name(path)?).or_insert((path, bytes));
            if *content != bytes {
                let (one, other) = (first.display(), path.display());
                return request(format!(
                    "{one} and {other} are different and have the same file name; rename one of them"
                ));
            }
        }
        Ok(())
    }

    /// Returns the file name and the content of each FMU, without duplicates.
    pub(super) fn files(&self) -> Result<BTreeMap<&str, &[u8]>, Error> {
        let fmus = self.structure.components.iter().zip(&self.fmus);
        fmus.map(|((_, path), (bytes, _))| Ok((file_name(path)?, bytes.as_slice()))).collect()
    }

    fn find(&self, name: &str, wanted: Causality) -> Result<Found<'_>, Error> {
        let found = self.variable(name)?;
        let causality = found.variable.causality;
        if causality != wanted {
            return request(format!("{name} is {causality}, not {wanted}"));
        }
        Ok(found)
    }

    pub(super) fn variable(&self, name: &str) -> Result<Found<'_>, Error> {
        let (component, own) = split(name);
        let component = self.structure.components.iter().position(|(known, _)| *known == component);
        let found = component.and_then(|component| {
            let (_, description) = &self.fmus[component];
            let variable = description.variable(own)?;
            Some(Found { component, variable, description, source: None, connector: None })
        });
        found.ok_or_else(|| Error::Request(format!("no FMU has a variable {name}")))
    }

    /// Returns the start values of a component: the full name of each variable, and its value.
    pub(super) fn own_start(&self, component: &str) -> Vec<(&str, &str)> {
        let start = self.structure.start.iter().filter(|(name, _)| split(name).0 == component);
        start.map(|(name, start)| (*name, start.as_str())).collect()
    }
}

/// Fails if a system cannot set the start value of this variable, or if the string is not a valid value: a number in the range, a Boolean,
/// a string, or an item of the enumeration.
fn check_start(found: Found, name: &str, text: &str) -> Result<(), Error> {
    found.check_start(name)?;
    let Attributes { min, max, base, .. } = &**found.variable;
    let number: Option<f64> = match found.variable.kind() {
        "Real" => text.parse().ok(),
        "Integer" => text.parse::<i64>().ok().map(|value| value as f64),
        _ => None,
    };
    let Some(value) = number else {
        let value = Value::from(text);
        return if is_exact(*base) {
            exact(found, name, value).map(drop)
        } else {
            number_of(found, name, &value).map(drop)
        };
    };
    let must = |rule: String| request(format!("the start value of {name} must {rule}, it is {value}"));
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
    Ok(())
}

/// Writes `root` and what it contains as an XML document in UTF-8.
pub(super) fn document(root: &Element) -> Result<Vec<u8>, Error> {
    root.document().map(String::into_bytes).map_err(|error| Error::Fmu(error.to_string()))
}

/// Splits a name into component and variable.
pub(super) fn split(end: &str) -> (&str, &str) {
    end.split_once('.').unwrap_or(("", end))
}

pub(super) fn file_name(path: &Path) -> Result<&str, Error> {
    let name = path.file_name().and_then(|name| name.to_str());
    name.ok_or_else(|| Error::Request(format!("the file name of {} is not UTF-8", path.display())))
}
