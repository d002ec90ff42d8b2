//! Generates the C sources of a model, for tests: `c_sources FILE.rs IDENTIFIER DIRECTORY`. The model is a single file that uses only
//! fmu-export. The environment variable `WASM2C` is the path of wasm2c.

use anyhow::{Context, Result, bail, ensure};
use fmu_package::{LINKING, WEBASSEMBLY, c_sources, check_tools};
use std::path::{Path, absolute};
use std::process::Command;

fn main() -> Result<()> {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let [file, identifier, directory] = arguments.as_slice() else {
        bail!("usage: c_sources FILE.rs IDENTIFIER DIRECTORY");
    };
    let wasm2c = std::env::var_os("WASM2C").unwrap_or_else(|| "wasm2c".into());
    check_tools(&wasm2c)?;
    let target = tempfile::tempdir()?;
    let of_target = |name: &str| target.path().join(WEBASSEMBLY).join(name);
    run(Command::new("cargo")
        .args(["build", "--locked", "--package", "fmu-export", "--lib", "--target", WEBASSEMBLY])
        .env("CARGO_TARGET_DIR", target.path())
        .current_dir(env!("CARGO_MANIFEST_DIR")))?;
    let module = target.path().join("module.wasm");
    run(Command::new("rustc")
        .args(["--edition=2024", "--crate-type=cdylib", "-O", "--target", WEBASSEMBLY])
        .args(LINKING)
        .arg("--extern")
        .arg(format!("fmu_export={}", of_target("debug/libfmu_export.rlib").display()))
        .arg(format!("-Ldependency={}", of_target("debug/deps").display()))
        .arg("-o")
        .arg(&module)
        .arg(absolute(file)?))?;
    for (name, content) in c_sources(&wasm2c, &std::fs::read(&module)?, identifier)? {
        std::fs::write(Path::new(directory).join(name), content)?;
    }
    Ok(())
}

fn run(command: &mut Command) -> Result<()> {
    let status = command.status().with_context(|| format!("cannot start {command:?}"))?;
    ensure!(status.success(), "{command:?} failed");
    Ok(())
}
