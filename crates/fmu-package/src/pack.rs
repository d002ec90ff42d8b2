//! Makes the FMU, a zip file (section 2.3). The same content gives the same bytes, on every machine.

use crate::content::ContentFile;
use crate::files::{write_atomically, zip};
use crate::platform::Platform;
use anyhow::{Context, Result, ensure};
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

/// A compiled library.
#[derive(Clone, Debug)]
pub struct Library {
    /// What it runs on.
    pub platform: Platform,
    /// The file, under any name.
    pub path: PathBuf,
}

/// Writes the FMU to `destination` and tells its size in bytes. If anything goes wrong, a file that was
/// there before stays as it was.
///
/// # Errors
/// When there is no library, there are two for one platform, a file cannot be read, or the destination
/// cannot be written.
pub fn pack(
    destination: &Path,
    model_identifier: &str,
    description: &str,
    libraries: &[Library],
    content: &[ContentFile],
) -> Result<u64> {
    ensure!(!libraries.is_empty(), "an FMU needs at least one library");
    let mut entries = vec![("modelDescription.xml".to_owned(), description.as_bytes().to_vec())];
    for Library { platform, path } in libraries {
        let name = format!("binaries/{platform}/{}", platform.library_name(model_identifier));
        entries.push((name, read(path).with_context(|| format!("the library for {platform} is missing"))?));
    }
    for ContentFile { name, path } in content {
        entries.push((name.clone(), read(path)?));
    }
    // The description first, where tools that stream look for it; the rest by name.
    entries[1..].sort();
    let zip = zip(&entries)?;
    write_atomically(destination, |file| Ok(file.write_all(&zip)?))
}

fn read(path: &Path) -> Result<Vec<u8>> {
    fs::read(path).with_context(|| format!("cannot read {}", path.display()))
}
