//! Compiles the parameters into the library: Table 1 of the paper, or the file that the environment variable
//! `PRW_PARAMETERS` names. A relative path is relative to this directory. `build_fmu --parameters` sets the variable.

use prw_parameters::file;
use std::path::{Path, PathBuf};
use std::{env, fs};

fn main() {
    if let Err(error) = run() {
        println!("cargo::error={error}");
    }
}

fn run() -> Result<(), String> {
    let variable = |name| env::var_os(name).ok_or_else(|| format!("cargo does not set {name}"));
    println!("cargo::rerun-if-env-changed=PRW_PARAMETERS");
    let other = env::var_os("PRW_PARAMETERS").filter(|path| !path.is_empty());
    let path = PathBuf::from(variable("CARGO_MANIFEST_DIR")?)
        .join(other.unwrap_or_else(|| "modelDescription/parameters.json".into()));
    println!("cargo::rerun-if-changed={}", path.display());
    let parameters = file::read(&path)?;
    let table = Path::new(&variable("OUT_DIR")?).join("table_1.rs");
    fs::write(&table, file::rust_expression(&parameters))
        .map_err(|error| format!("cannot write {}: {error}", table.display()))
}
