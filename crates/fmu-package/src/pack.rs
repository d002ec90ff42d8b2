//! Makes the FMU, a zip file (section 2.3 of FMI 2.0, 2.5.1 of FMI 3.0). The same content gives the same bytes, on every machine.

use crate::content::ContentFile;
use crate::files::{write_atomically, zip};
use crate::platform::Platform;
use anyhow::{Context, Result, ensure};
use fmi_abi::Standard;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

/// A compiled library.
#[derive(Clone, Debug)]
pub struct Library {
    /// The platform that it is for.
    pub platform: Platform,
    /// The file, under any name.
    pub path: PathBuf,
}

/// The parts that an FMU is made of.
#[derive(Clone, Copy, Debug)]
pub struct Parts<'a> {
    /// The version that the description is for.
    pub fmi: Standard,
    /// The `modelIdentifier`.
    pub identifier: &'a str,
    /// The content of `modelDescription.xml`.
    pub description: &'a str,
    /// The content of `terminalsAndIcons/terminalsAndIcons.xml`, if there are terminals.
    pub terminals: Option<&'a str>,
    /// The libraries, one for each platform.
    pub libraries: &'a [Library],
    /// The files in the directory `sources`: names and contents.
    pub sources: &'a [(String, Vec<u8>)],
    /// Other files, with their names in FMI 2.0.
    pub content: &'a [ContentFile],
}

/// Writes the FMU to `destination` and returns its size in bytes. If anything fails, an existing file does not change.
///
/// # Errors
/// When there is neither a library nor sources, two libraries are for one platform, a file cannot be read, or the destination
/// cannot be written.
pub fn pack(destination: &Path, parts: &Parts) -> Result<u64> {
    let Parts { fmi, identifier, description, terminals, libraries, sources, content } = *parts;
    ensure!(!libraries.is_empty() || !sources.is_empty(), "an FMU needs at least one library, or sources");
    let mut entries = vec![("modelDescription.xml".to_owned(), description.as_bytes().to_vec())];
    entries.extend(terminals.map(|text| (TERMINALS.to_owned(), text.as_bytes().to_vec())));
    for Library { platform, path } in libraries {
        let directory = platform.directory(fmi);
        let name = format!("binaries/{directory}/{}", platform.library_name(identifier));
        entries.push((name, read(path).with_context(|| format!("the library for {directory} is missing"))?));
    }
    entries.extend(sources.iter().map(|(name, bytes)| (format!("sources/{name}"), bytes.clone())));
    let has_icon = content.iter().any(|file| file.name == ICON);
    for ContentFile { name, path } in content {
        let name = match (fmi, name.as_str()) {
            // In FMI 3.0, `model.png` is stored as the icon. If the content already has an icon, `model.png` is left out.
            (Standard::Fmi3, "model.png") if has_icon => continue,
            (Standard::Fmi3, "model.png") => ICON,
            (_, name) => name,
        };
        entries.push((name.to_owned(), read(path)?));
    }
    // The description is first, for tools that read the file as a stream; other entries are sorted by name.
    entries[1..].sort();
    let zip = zip(&entries)?;
    write_atomically(destination, |file| Ok(file.write_all(&zip)?))
}

const TERMINALS: &str = "terminalsAndIcons/terminalsAndIcons.xml";
const ICON: &str = "terminalsAndIcons/icon.png";

fn read(path: &Path) -> Result<Vec<u8>> {
    fs::read(path).with_context(|| format!("cannot read {}", path.display()))
}
