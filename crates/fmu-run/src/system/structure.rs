//! The structure of a system that is written, and the checks of its consistency.

use super::packed::{FmuVariable, PackedFmu};
use crate::error::{Error, request};
use fmi_abi::Causality;
use fmi_abi::write::Element;
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
/// Start values are strings: numbers, `true` or `false`, an item of an enumeration, or the value of a String.
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
    fmus: Vec<PackedFmu>,
    /// Units by name, each with the exponents of SI base units, factor and offset.
    pub(super) units: BTreeMap<String, Vec<(String, String)>>,
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
            checked.find(to, Causality::Input)?.check_start(to, start).map_err(Error::Request)?;
            fed.push(*to);
        }
        for (_, from) in &self.outputs {
            checked.find(from, Causality::Output)?;
        }
        for (from, to) in &self.connections {
            let (a, b) = (checked.find(from, Causality::Output)?, checked.find(to, Causality::Input)?);
            a.check_feeds(b).map_err(|why| Error::Request(format!("{from} cannot feed {to}: {why}")))?;
            fed.push(*to);
        }
        fed.sort_unstable();
        if let Some(pair) = fed.windows(2).find(|pair| pair[0] == pair[1]) {
            return request(format!("{} is fed twice", pair[0]));
        }
        for (name, start) in &self.start {
            let variable = checked.variable(name)?;
            variable
                .check_settable(name)
                .and_then(|()| variable.check_start(name, start))
                .map_err(Error::Request)?;
        }
        Ok(checked)
    }
}

impl CheckedStructure<'_> {
    fn read(&mut self, path: &Path) -> Result<(), String> {
        let fmu = PackedFmu::read(path)?;
        for (name, unit) in &fmu.description.units {
            let before = self.units.entry(name.clone()).or_insert_with(|| unit.clone());
            if before != unit {
                return Err(format!("its unit {name} differs from the unit of this name in another FMU"));
            }
        }
        self.fmus.push(fmu);
        Ok(())
    }

    /// Checks that different FMUs have different file names. Components with equal FMUs share one file.
    fn check_files(&self) -> Result<(), Error> {
        let mut files = BTreeMap::new();
        for ((_, path), fmu) in self.structure.components.iter().zip(&self.fmus) {
            let (first, content) = files.entry(file_name(path)?).or_insert((path, &fmu.bytes));
            if *content != &fmu.bytes {
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
        fmus.map(|((_, path), fmu)| Ok((file_name(path)?, fmu.bytes.as_slice()))).collect()
    }

    fn find(&self, name: &str, wanted: Causality) -> Result<FmuVariable<'_>, Error> {
        let found = self.variable(name)?;
        let causality = found.variable.causality;
        if causality != wanted {
            return request(format!("{name} is {causality}, not {wanted}"));
        }
        Ok(found)
    }

    pub(super) fn variable(&self, name: &str) -> Result<FmuVariable<'_>, Error> {
        let (component, own) = split(name);
        let index = self.structure.components.iter().position(|(known, _)| *known == component);
        let variable = index.and_then(|index| self.fmus[index].variable(own));
        variable.ok_or_else(|| Error::Request(format!("no FMU has a variable {name}")))
    }

    /// Returns the start values of a component: the full name of each variable, and its value.
    pub(super) fn own_start(&self, component: &str) -> Vec<(&str, &str)> {
        let start = self.structure.start.iter().filter(|(name, _)| split(name).0 == component);
        start.map(|(name, start)| (*name, start.as_str())).collect()
    }
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
