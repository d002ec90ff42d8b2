//! Compiles the parameters into the library: Table 1, or the file that `PRW_PARAMETERS` names. A relative
//! path starts at this directory. `build_fmu --parameters` sets the variable.

#[path = "src/parameter_file.rs"]
mod parameter_file;
#[allow(dead_code, reason = "the model needs the rest")]
#[path = "src/parameters.rs"]
mod parameters;

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
    let file = env::var_os("PRW_PARAMETERS").filter(|file| !file.is_empty());
    let file = PathBuf::from(variable("CARGO_MANIFEST_DIR")?)
        .join(file.unwrap_or_else(|| "modelDescription/parameters.json".into()));
    println!("cargo::rerun-if-changed={}", file.display());
    let parameters = parameter_file::read(&file)?;
    let table = Path::new(&variable("OUT_DIR")?).join("table_1.rs");
    fs::write(&table, parameter_file::rust_expression(&parameters))
        .map_err(|error| format!("cannot write {}: {error}", table.display()))
}
