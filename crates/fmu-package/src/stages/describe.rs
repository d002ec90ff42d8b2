//! Describes the model for each FMI version.

use super::Plan;
use super::compile::Compiled;
use crate::c_sources::compiled_files;
use crate::connectors::terminals;
use crate::describe::{self, Changes};
use crate::model::LoadedModel;
use crate::terminal::short;
use anyhow::{Context, Error, Result};
use fmi_abi::Standard;
use fmi_abi::write::write_atomically;
use std::fs;
use std::io::Write;
use std::path::Path;

/// A model with its descriptions.
pub(crate) struct Described {
    pub compiled: Compiled,
    /// The descriptions for the versions to build, of which there is at least one.
    pub descriptions: Vec<(Standard, String)>,
    /// The description for FMI 2.0, for the page; `None` if a variable has a type that FMI 2.0 lacks.
    pub fmi2: Option<String>,
    /// The content of `terminalsAndIcons.xml`, if there are terminals.
    pub terminals: Option<String>,
}

/// Checks the model and describes it.
///
/// # Errors
/// When the model contradicts itself.
pub(crate) fn describe(plan: &Plan, compiled: Compiled) -> Result<Described> {
    let model = &compiled.model;
    let source_files =
        compiled.module.as_ref().map_or(Vec::new(), |_| compiled_files(model.identifier()).into());
    let changes = Changes { tunable_parameters: plan.tunable, source_files };
    let terminals = terminals(model, &plan.builder.terminals, &plan.content)?;
    let label = plan.builder.variant.as_deref().unwrap_or(model.identifier());
    let description = |fmi| describe::describe(model, fmi, &changes).with_context(|| label.to_owned());
    let mut descriptions = Vec::new();
    for fmi in versions(plan, model) {
        descriptions.push((fmi, description(fmi)?));
        if plan.description.is_some() {
            break;
        }
    }
    let (first, text) = descriptions.first().context("there is no version to describe it for")?;
    let fmi2 = match first {
        Standard::Fmi2 => Some(text.clone()),
        Standard::Fmi3 if plan.description.is_none() && is_in_fmi2(model) => {
            Some(description(Standard::Fmi2)?)
        }
        Standard::Fmi3 => None,
    };
    Ok(Described { descriptions, fmi2, terminals, compiled })
}

/// Returns the FMI version in the options. Otherwise returns the default versions, without FMI 2.0 if it lacks the type of a variable and
/// FMI 3.0 is also a default version.
fn versions(plan: &Plan, model: &LoadedModel) -> Vec<Standard> {
    let default = &plan.builder.fmi;
    if let Some(fmi) = plan.fmi {
        return vec![fmi];
    }
    let lacking = model.table.variables.iter().find(|variable| !variable.base.is_in_fmi2());
    let Some(variable) = lacking.filter(|_| default.contains(&Standard::Fmi3)) else {
        return default.clone();
    };
    println!("{} is {}, which FMI 2.0 lacks: for FMI 3.0 only", variable.name, variable.base);
    vec![Standard::Fmi3]
}

/// Whether FMI 2.0 has the types of all variables.
fn is_in_fmi2(model: &LoadedModel) -> bool {
    model.table.variables.iter().all(|variable| variable.base.is_in_fmi2())
}

impl Described {
    /// Writes the description for the first version, unless the file is up to date, so that cargo does not see a changed file.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        let (_, description) = &self.descriptions[0];
        if fs::read(path).ok().as_deref() == Some(description.as_bytes()) {
            println!("{} is up to date", short(path));
            return Ok(());
        }
        write_atomically(path, |file| file.write_all(description.as_bytes())).map_err(Error::msg)?;
        println!("{} written", short(path));
        Ok(())
    }
}
