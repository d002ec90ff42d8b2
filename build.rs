//! Compiles Table 1 of the paper, `modelDescription/parameters.json`, into the library.

use std::path::Path;
use std::{env, fs};

// The module that the library contains, and the reader of parameter files, which it does not contain.
#[allow(dead_code)]
#[macro_use]
#[path = "src/parameters/mod.rs"]
mod parameters;

#[allow(dead_code)]
#[path = "src/parameters/file.rs"]
mod file;

fn main() {
    if let Err(error) = run() {
        println!("cargo::error={error}");
    }
}

fn run() -> Result<(), String> {
    let variable = |name| env::var_os(name).ok_or_else(|| format!("cargo does not set {name}"));
    let path = Path::new(&variable("CARGO_MANIFEST_DIR")?).join("modelDescription/parameters.json");
    println!("cargo::rerun-if-changed={}", path.display());
    let parameters = file::read(&path)?;
    let table = Path::new(&variable("OUT_DIR")?).join("table_1.rs");
    fs::write(&table, file::rust_expression(&parameters))
        .map_err(|error| format!("cannot write {}: {error}", table.display()))
}
