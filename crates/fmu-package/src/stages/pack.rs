//! Packs the FMUs, and reports them.

use super::Plan;
use super::describe::Described;
use super::page::Paged;
use crate::cross::{GLIBC, ZIGBUILD};
use crate::library::Library;
use crate::pack::{self, Packed, Parts};
use crate::sources::DESCRIPTION;
use crate::terminal::short;
use crate::universal::join_for_macos;
use anyhow::Result;
use fmi_abi::Standard;
use fmi_abi::files::binaries::Binary;
use std::fs;
use std::path::Path;

/// Writes an FMU for each version, and prints its path, size, platforms, guid and variant. Then prints notes on the FMUs.
///
/// # Errors
/// When an FMU cannot be made or written.
pub(crate) fn pack(plan: &Plan, mut paged: Paged) -> Result<()> {
    let is_for_fmi2 = paged.described.descriptions.iter().any(|(fmi, _)| *fmi == Standard::Fmi2);
    if is_for_fmi2 {
        join_for_macos(&mut paged.described.compiled.libraries)?;
    }
    let Described { compiled, descriptions, terminals, .. } = &paged.described;
    let content = plan.content_without_page();
    for (fmi, description) in descriptions {
        let parts = Parts {
            fmi: *fmi,
            identifier: compiled.model.identifier(),
            description,
            // If an FMU for FMI 2.0 has terminals, FMI Library reports a fatal mismatch, although it continues.
            terminals: terminals.as_deref().filter(|_| *fmi == Standard::Fmi3),
            libraries: &compiled.libraries,
            with_guid: &|guid| paged.with_guid(plan, guid),
            content: &content,
        };
        write(plan, &parts)?;
    }
    warn_of_glibc(plan, &compiled.libraries);
    warn_of_path(plan, &compiled.libraries);
    if let Some(kept) = &plan.kept {
        compare_with_kept(plan, kept, descriptions);
    }
    Ok(())
}

/// Writes an FMU into the directory of its FMI version, and reports it.
fn write(plan: &Plan, parts: &Parts) -> Result<()> {
    let directory = match parts.fmi {
        Standard::Fmi2 if plan.wasm2c.is_some() => plan.out.join("source"),
        Standard::Fmi2 => plan.out.clone(),
        Standard::Fmi3 => plan.out.join("fmi3"),
    };
    let fmu = directory.join(format!("{}.fmu", parts.identifier));
    let Packed { guid, size } = pack::pack(&fmu, parts)?;
    let mut platforms: Vec<_> =
        parts.libraries.iter().map(|library| library.platform.directory(parts.fmi)).collect();
    platforms.sort_unstable();
    if plan.wasm2c.is_some() {
        platforms.push("C sources");
    }
    let variant = plan.builder.variant.iter().map(|label| format!(", {label}")).collect::<String>();
    let tunable = if plan.tunable { ", tunable" } else { "" };
    let size = size.div_ceil(1000);
    println!("{}: {size} kB, {}{variant}{tunable}, guid {guid}", short(&fmu), platforms.join(", "));
    Ok(())
}

/// Prints a note if the library for this machine needs a newer glibc than a library that is compiled with `--target`.
fn warn_of_glibc(plan: &Plan, libraries: &[Library]) {
    // A library with additional cargo settings is only for development on this machine.
    let is_shipped = plan.builder.settings.is_empty() && plan.targets.is_empty() && plan.binaries.is_empty();
    let needed = |library: &Library| Binary::all(&library.bytes).ok()?.first()?.needed_glibc();
    if let Some((major, minor)) = libraries.first().filter(|_| is_shipped).and_then(needed)
        && format!("{major}.{minor}") != GLIBC
    {
        let target = format!("{}-unknown-linux-gnu", std::env::consts::ARCH);
        eprintln!(
            "note: the library needs glibc {major}.{minor} or later, so it does not load on older systems; for glibc {GLIBC}, add --target {target} \
             (with {ZIGBUILD}: pip install {ZIGBUILD})"
        );
    }
}

/// Prints a warning if a library contains the absolute path of the package, which does not exist on other computers.
fn warn_of_path(plan: &Plan, libraries: &[Library]) {
    let directory = &plan.builder.sources.directory;
    let directory = fs::canonicalize(directory).unwrap_or_else(|_| directory.clone());
    if libraries.iter().any(|library| names_path(&library.bytes, &directory)) {
        eprintln!(
            "warning: the library contains the path {}, which other computers do not have, as from env!(\"CARGO_MANIFEST_DIR\"); put files \
             into modelDescription/resources and open them with `setup.resource`",
            directory.display()
        );
    }
}

/// Returns whether a library without debug information contains this path.
fn names_path(library: &[u8], path: &Path) -> bool {
    let path = path.to_string_lossy();
    let has = |text: &str| library.windows(text.len()).any(|window| window == text.as_bytes());
    path.len() > 1 && has(&path) && !has(".debug_info")
}

/// Prints a note if the committed description is out of date.
fn compare_with_kept(plan: &Plan, kept: &Path, descriptions: &[(Standard, String)]) {
    if let Some((fmi, description)) = descriptions.first()
        && plan.builder.fmi.first() == Some(fmi)
        && let Ok(text) = fs::read_to_string(kept)
        && text != *description
    {
        eprintln!(
            "note: {DESCRIPTION} in the sources is out of date; update it with\n      {} --describe",
            plan.builder.command
        );
    }
}

#[cfg(test)]
mod tests {
    use super::names_path;
    use std::path::Path;

    #[test]
    fn a_path_is_found_unless_it_is_debug_information() {
        let path = Path::new("/home/me/tank");
        assert!(names_path(b"\0/home/me/tank/table.csv\0", path));
        assert!(!names_path(b"\0src/lib.rs\0", path));
        assert!(!names_path(b"\0/home/me/tank\0.debug_info\0", path));
        assert!(!names_path(b"/", Path::new("/")));
    }
}
