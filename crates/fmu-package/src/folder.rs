//! The files of a folder, in the same order on every machine.

use anyhow::{Context, Result, bail};
use std::fs;
use std::path::{Path, PathBuf};

/// The file itself, or all files of a folder and the folders in it, but hidden ones: what of the name comes after
/// the folder's, with forward slashes, and the path.
pub(crate) fn files(path: &Path) -> Result<Vec<(String, PathBuf)>> {
    if !fs::metadata(path).with_context(|| format!("cannot read {}", path.display()))?.is_dir() {
        return Ok(vec![(String::new(), path.to_owned())]);
    }
    let mut all = Vec::new();
    for name in names(path)? {
        let inside = files(&path.join(&name))?;
        all.extend(inside.into_iter().map(|(rest, path)| (format!("/{name}{rest}"), path)));
    }
    Ok(all)
}

/// The names of what is in a folder, but hidden things, sorted.
pub(crate) fn names(folder: &Path) -> Result<Vec<String>> {
    let cannot = || format!("cannot read {}", folder.display());
    let mut names = Vec::new();
    for entry in fs::read_dir(folder).with_context(cannot)? {
        let entry = entry.with_context(cannot)?;
        let Ok(name) = entry.file_name().into_string() else {
            bail!("the name of {} is not UTF-8; rename it", entry.path().display());
        };
        if !name.starts_with('.') {
            names.push(name);
        }
    }
    names.sort();
    Ok(names)
}
