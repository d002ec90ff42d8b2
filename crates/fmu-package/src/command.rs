//! The command `build_fmu`, which is the same for every model.

use crate::builder::Builder;
use crate::options::BuildOptions;
use crate::stages::{Plan, check, compile, describe, pack, page};
use crate::terminal::exit;
use anyhow::Result;
use clap::FromArgMatches;
use std::process::ExitCode;

/// The `main` of a `build_fmu`: reads the arguments of the program and builds the FMUs.
pub fn build(builder: Result<Builder>) -> ExitCode {
    exit(builder.and_then(|builder| {
        let usage = format!("{} [OPTIONS]", builder.command);
        let matches = BuildOptions::command("build_fmu", "Builds the FMUs of a model", &usage).get_matches();
        builder.run(&BuildOptions::from_arg_matches(&matches)?)
    }))
}

impl Builder {
    /// Compiles the libraries, checks the model with the library for this machine, writes the descriptions, packs the FMUs, and reports
    /// them on stdout. With `options.describe`, only writes a description.
    ///
    /// # Errors
    /// When the model contradicts itself, a library cannot be compiled or is of another model, or a file cannot be written.
    pub fn run(&self, options: &BuildOptions) -> Result<()> {
        let plan = Plan::of(self, options)?;
        let compiled = compile(&plan)?;
        let described = describe(&plan, compiled)?;
        if let Some(path) = &plan.description {
            return described.write(path);
        }
        let checked = check(&plan, described)?;
        let paged = page(&plan, checked)?;
        pack(&plan, paged)
    }
}
