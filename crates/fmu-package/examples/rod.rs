//! Packs a compiled library into FMUs for FMI 2.0 and FMI 3.0, for tests: `rod LIBRARY DIRECTORY`.
#![allow(unsafe_code)]

use anyhow::{Result, bail};
use fmu_package::{Changes, Library, LoadedModel, Parts, Platform, Standard, describe, pack};
use std::path::Path;

fn main() -> Result<()> {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let [library, directory] = arguments.as_slice() else { bail!("usage: rod LIBRARY DIRECTORY") };
    // SAFETY: the test has compiled the library with fmu-export.
    let model = unsafe { LoadedModel::load(Path::new(library), None) }?;
    let libraries = [Library::read(Platform::host()?, Path::new(library), false)?];
    let (changes, identifier) = (Changes::default(), model.identifier());
    for fmi in [Standard::Fmi2, Standard::Fmi3] {
        let description = describe(&model, fmi, &changes)?;
        let parts = Parts {
            fmi,
            identifier,
            description: &description,
            terminals: None,
            libraries: &libraries,
            with_guid: &|_| Ok(Vec::new()),
            content: &[],
        };
        let version = if fmi == Standard::Fmi2 { 2 } else { 3 };
        pack(&Path::new(directory).join(format!("{identifier}{version}.fmu")), &parts)?;
    }
    Ok(())
}
