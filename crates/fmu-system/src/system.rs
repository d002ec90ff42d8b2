//! A system, and the checks of its consistency.

use crate::fmu::{Fmu, FmuVariable};
use anyhow::{Context, Result, anyhow, bail, ensure};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// Connected FMUs. Variables of FMUs are written `component.variable`.
///
/// Start values are strings: numbers, `true` or `false`, an item of an enumeration, or the value of a String.
#[derive(Clone, Debug)]
pub struct System<'a> {
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

/// A system whose FMUs have been read and whose connections have been checked.
pub struct CheckedSystem<'a> {
    pub(crate) system: &'a System<'a>,
    fmus: Vec<Fmu>,
    /// Units by name, each with the exponents of SI base units, factor and offset.
    pub(crate) units: BTreeMap<String, Vec<(String, String)>>,
}

impl<'a> System<'a> {
    /// Reads the FMUs and checks the connections against their model descriptions.
    ///
    /// # Errors
    /// Fails if an FMU cannot be read, if a component's name is invalid or used twice, or if two different FMUs share a file name. Fails
    /// if a variable is unknown or has the wrong causality, or if the ends of a connection differ in type or unit. Fails if an input is
    /// fed twice, or if a start value or time is invalid.
    pub fn check(&'a self) -> Result<CheckedSystem<'a>> {
        let mut checked = CheckedSystem { system: self, fmus: Vec::new(), units: BTreeMap::new() };
        for (what, value) in [("stop time", self.stop_time), ("step size", self.step_size)] {
            ensure!(value.is_finite() && value > 0.0, "the {what} must be > 0, it is {value}");
        }
        for (index, (component, path)) in self.components.iter().enumerate() {
            ensure!(
                !component.is_empty() && !component.contains(['.', '/', '\\']),
                "'{component}' cannot name a component, because it is empty or has a dot or slash in it"
            );
            let before = &self.components[..index];
            ensure!(
                before.iter().all(|(other, _)| other != component),
                "two components are named {component}"
            );
            checked.read(path).with_context(|| format!("{} is not a usable FMU", path.display()))?;
        }
        checked.check_files()?;
        let mut fed = Vec::new();
        for (_, to, start) in &self.inputs {
            checked.find(to, "input")?.check_start(to, start)?;
            fed.push(*to);
        }
        for (_, from) in &self.outputs {
            checked.find(from, "output")?;
        }
        for (from, to) in &self.connections {
            let (a, b) = (checked.find(from, "output")?, checked.find(to, "input")?);
            a.check_feeds(b).map_err(|why| anyhow!("{from} cannot feed {to}: {why}"))?;
            fed.push(*to);
        }
        fed.sort_unstable();
        if let Some(pair) = fed.windows(2).find(|pair| pair[0] == pair[1]) {
            bail!("{} is fed twice", pair[0]);
        }
        for (name, start) in &self.start {
            let variable = checked.variable(name)?;
            variable.check_settable(name)?;
            variable.check_start(name, start)?;
        }
        Ok(checked)
    }
}

impl CheckedSystem<'_> {
    fn read(&mut self, path: &Path) -> Result<()> {
        let fmu = Fmu::read(fs::read(path).context("it cannot be read")?)?;
        for (name, unit) in &fmu.description.units {
            let before = self.units.entry(name.clone()).or_insert_with(|| unit.clone());
            ensure!(before == unit, "its unit {name} differs from the unit of this name in another FMU");
        }
        self.fmus.push(fmu);
        Ok(())
    }

    /// Checks that different FMUs have different file names. Components with equal FMUs share one file.
    fn check_files(&self) -> Result<()> {
        let mut files = BTreeMap::new();
        for ((_, path), fmu) in self.system.components.iter().zip(&self.fmus) {
            let (first, content) = files.entry(file_name(path)?).or_insert((path, &fmu.bytes));
            ensure!(
                *content == &fmu.bytes,
                "{} and {} are different and have the same file name; rename one of them",
                first.display(),
                path.display()
            );
        }
        Ok(())
    }

    /// Returns the file name and the content of each FMU, without duplicates.
    pub(crate) fn files(&self) -> Result<BTreeMap<&str, &[u8]>> {
        let fmus = self.system.components.iter().zip(&self.fmus);
        fmus.map(|((_, path), fmu)| Ok((file_name(path)?, fmu.bytes.as_slice()))).collect()
    }

    fn find(&self, name: &str, wanted: &str) -> Result<FmuVariable<'_>> {
        let found = self.variable(name)?;
        let causality = &found.variable.causality;
        ensure!(causality == wanted, "{name} is {causality}, not {wanted}");
        Ok(found)
    }

    pub(crate) fn variable(&self, name: &str) -> Result<FmuVariable<'_>> {
        let (component, own) = split(name);
        let index = self.system.components.iter().position(|(known, _)| *known == component);
        let variable = index.and_then(|index| self.fmus[index].variable(own));
        variable.with_context(|| format!("no FMU has a variable {name}"))
    }

    /// Returns the start values of a component: the full name of each variable, and its value.
    pub(crate) fn own_start(&self, component: &str) -> Vec<(&str, &str)> {
        let start = self.system.start.iter().filter(|(name, _)| split(name).0 == component);
        start.map(|(name, start)| (*name, start.as_str())).collect()
    }
}

/// Splits a name into component and variable.
pub(crate) fn split(end: &str) -> (&str, &str) {
    end.split_once('.').unwrap_or(("", end))
}

pub(crate) fn file_name(path: &Path) -> Result<&str> {
    let name = path.file_name().and_then(|name| name.to_str());
    name.with_context(|| format!("the file name of {} is not UTF-8", path.display()))
}
