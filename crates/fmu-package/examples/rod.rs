//! The FMUs of a model with arrays, for tests: rod LIBRARY FOLDER.

use anyhow::{Result, bail};
use fmu_package::{Changes, Fmi, Library, Parts, Platform, fmi2, fmi3, pack};
use std::path::Path;

#[path = "../../fmu-export/tests/toys/rod.rs"]
#[allow(dead_code, missing_docs)]
mod rod;

fn main() -> Result<()> {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let [library, folder] = arguments.as_slice() else { bail!("usage: rod LIBRARY FOLDER") };
    let libraries = [Library { platform: Platform::host()?, path: library.into() }];
    let changes = Changes::default();
    for (fmi, description, name) in [
        (Fmi::V2, fmi2::describe::<rod::Rod>(&changes)?, "rod2.fmu"),
        (Fmi::V3, fmi3::describe::<rod::Rod>(&changes)?, "rod3.fmu"),
    ] {
        let parts = Parts {
            fmi,
            identifier: "rod",
            description: &description,
            terminals: None,
            libraries: &libraries,
            sources: &[],
            content: &[],
        };
        pack(&Path::new(folder).join(name), &parts)?;
    }
    Ok(())
}
