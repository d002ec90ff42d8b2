//! Bakes the parameters and the guid into the library.
//!
//! `PRW_PARAMETERS` names another file than Table 1 (relative to this folder), `FMU_TUNABLE=1` makes the
//! variant with tunable parameters; `build_fmu` sets both.

#[path = "src/fingerprint.rs"]
mod fingerprint;
#[path = "src/parameter_file.rs"]
mod parameter_file;
#[allow(dead_code, reason = "the model needs the rest")]
#[path = "src/parameters.rs"]
mod parameters;

use anyhow::Context;
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
    let parameters = parameter_file::read(&file)?;
    let table = Path::new(&env::var_os("OUT_DIR").context("cargo sets OUT_DIR")?).join("table_1.rs");
    fs::write(&table, format!("{parameters:?}"))
        .with_context(|| format!("cannot write {}", table.display()))?;
    fmu_package::build_script(&fingerprint::sources(project), fingerprint::start(&parameters))
}
