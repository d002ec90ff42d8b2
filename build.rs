//! Bakes the parameters and the guid into the library.
//!
//! `PRW_PARAMETERS` names another file than Table 1 (relative to this folder), `FMU_TUNABLE=1` makes the
//! variant with tunable parameters; `build_fmu` sets both.

#[path = "src/fingerprint.rs"]
mod fingerprint;
#[allow(dead_code, reason = "build_fmu needs the rest")]
#[path = "src/parameter_file.rs"]
mod parameter_file;

use anyhow::Context;
use parameter_file::ParameterSet;
use std::path::{Path, PathBuf};
use std::{env, fs};

fn main() {
    if let Err(error) = run() {
        println!("cargo::error={error:#}");
    }
}

fn run() -> anyhow::Result<()> {
    let project = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").context("cargo sets CARGO_MANIFEST_DIR")?);
    println!("cargo::rerun-if-env-changed=PRW_PARAMETERS");
    let file = match env::var_os("PRW_PARAMETERS") {
        Some(file) if !file.is_empty() => project.join(file),
        _ => project.join(fingerprint::PARAMETERS),
    };
    println!("cargo::rerun-if-changed={}", file.display());
    let parameters = ParameterSet::read(&file)?;
    let table = Path::new(&env::var_os("OUT_DIR").context("cargo sets OUT_DIR")?).join("table_1.rs");
    fs::write(&table, parameters.to_string()).with_context(|| format!("cannot write {}", table.display()))?;
    fmi2_package::build_script(&fingerprint::sources(project), fingerprint::start(&parameters))
}
