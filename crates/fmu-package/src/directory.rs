//! The files in a directory, in the same order on every machine.

use anyhow::{Context, Result, bail};
use std::fs;
use std::path::{Path, PathBuf};

/// Returns all files in a directory and its subdirectories, except hidden files: the path relative to the directory, which begins with
/// a slash, and the full path. For the path of a file, returns this file with an empty relative path.
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

/// Returns the sorted names of the entries in a directory, except hidden entries.
pub(crate) fn names(directory: &Path) -> Result<Vec<String>> {
    let failed = || format!("cannot read {}", directory.display());
    let mut names = Vec::new();
    for entry in fs::read_dir(directory).with_context(failed)? {
        let entry = entry.with_context(failed)?;
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
