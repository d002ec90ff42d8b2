//! A system, and whether it fits together.

use crate::fmu::{Fmu, Own};
use anyhow::{Context, Result, anyhow, bail, ensure};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// FMUs that are wired to each other. Variables of FMUs are written `component.variable`.
///
/// Start values are written as texts: numbers, `true` or `false`, the name of an enumeration's item, or what a String
/// is to be.
#[derive(Clone, Debug)]
pub struct System<'a> {
    /// The name, for people.
    pub name: &'a str,
    /// One sentence.
    pub description: &'a str,
    /// The FMUs: the name of the component, the file.
    pub components: Vec<(&'a str, PathBuf)>,
    /// Inputs of the system: name, the input it feeds, start value in that input's unit.
    pub inputs: Vec<(&'a str, &'a str, String)>,
    /// Outputs of the system: name, the output it shows.
    pub outputs: Vec<(&'a str, &'a str)>,
    /// Output to input.
    pub connections: Vec<(&'a str, &'a str)>,
    /// Start values that differ from those of the FMUs.
    pub start: Vec<(&'a str, String)>,
    /// The proposed end of the experiment, s; it starts at 0.
    pub stop_time: f64,
    /// The proposed communication step size, s.
    pub step_size: f64,
}

/// A system whose FMUs have been read and whose wiring has been checked.
pub struct CheckedSystem<'a> {
    pub(crate) system: &'a System<'a>,
    fmus: Vec<Fmu>,
    /// By their names, each with the exponents of SI's base units, factor and offset.
    pub(crate) units: BTreeMap<String, Vec<(String, String)>>,
}

impl<'a> System<'a> {
    /// Reads the FMUs and checks the wiring against what they say of themselves.
    ///
    /// # Errors
    /// When an FMU cannot be read, two components share a name or two different FMUs a file name, a variable is
    /// not there or has the wrong causality, two ends of a connection differ in type or unit, an input is fed
    /// twice, or a start value or time is impossible.
    pub fn check(&'a self) -> Result<CheckedSystem<'a>> {
        let mut checked = CheckedSystem { system: self, fmus: Vec::new(), units: BTreeMap::new() };
        for (what, value) in [("stop time", self.stop_time), ("step size", self.step_size)] {
            ensure!(value.is_finite() && value > 0.0, "the {what} must be > 0, it is {value}");
        }
        for (place, (component, path)) in self.components.iter().enumerate() {
            ensure!(
                !component.is_empty() && !component.contains(['.', '/', '\\']),
                "'{component}' cannot name a component, because it is empty or has a dot or slash in it"
            );
            let before = &self.components[..place];
            ensure!(
                before.iter().all(|(other, _)| other != component),
                "two components are named {component}"
            );
            checked.read(path).with_context(|| format!("{} is no usable FMU", path.display()))?;
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
            ensure!(before == unit, "its unit {name} differs from that of another FMU");
        }
        self.fmus.push(fmu);
        Ok(())
    }

    /// Several components may be instances of one FMU; it is packed once.
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

    /// The FMUs, each once: file name and content.
    pub(crate) fn files(&self) -> Result<BTreeMap<&str, &[u8]>> {
        let fmus = self.system.components.iter().zip(&self.fmus);
        fmus.map(|((_, path), fmu)| Ok((file_name(path)?, fmu.bytes.as_slice()))).collect()
    }

    fn find(&self, name: &str, wanted: &str) -> Result<Own<'_>> {
        let found = self.variable(name)?;
        let causality = &found.variable.causality;
        ensure!(causality == wanted, "{name} is {causality}, not {wanted}");
        Ok(found)
    }

    pub(crate) fn variable(&self, name: &str) -> Result<Own<'_>> {
        let (component, own) = split(name);
        let place = self.system.components.iter().position(|(known, _)| *known == component);
        let variable = place.and_then(|place| self.fmus[place].variable(own));
        variable.with_context(|| format!("no FMU has a variable {name}"))
    }

    /// The start values of a component's own variables: full name and value.
    pub(crate) fn own_start(&self, component: &str) -> Vec<(&str, &str)> {
        let start = self.system.start.iter().filter(|(name, _)| split(name).0 == component);
        start.map(|(name, start)| (*name, start.as_str())).collect()
    }
}

/// Component and variable.
pub(crate) fn split(end: &str) -> (&str, &str) {
    end.split_once('.').unwrap_or(("", end))
}

pub(crate) fn file_name(path: &Path) -> Result<&str> {
    let name = path.file_name().and_then(|name| name.to_str());
    name.with_context(|| format!("the file name of {} is not UTF-8", path.display()))
}
