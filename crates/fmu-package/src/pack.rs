//! Makes the FMU, a zip file (section 2.3 of FMI 2.0, 2.5.1 of FMI 3.0). The same content gives the same bytes, on every machine.

use crate::content::ContentFile;
use crate::fingerprint::Fingerprint;
use crate::library::{Library, with_stamp};
use anyhow::{Context, Error, Result, ensure};
use fmi_abi::Standard;
use fmi_abi::stamp::NO_GUID;
use fmi_abi::write::{write_atomically, zip};
use std::fs;
use std::io::Write;
use std::path::Path;

/// Names and contents of files.
pub type Files = Vec<(String, Vec<u8>)>;

/// The parts that an FMU is made of.
#[derive(Clone, Copy)]
pub struct Parts<'a> {
    /// The version that the description is for.
    pub fmi: Standard,
    /// The `modelIdentifier`.
    pub identifier: &'a str,
    /// The content of `modelDescription.xml`, with the guid [`NO_GUID`].
    pub description: &'a str,
    /// The content of `terminalsAndIcons/terminalsAndIcons.xml`, if there are terminals.
    pub terminals: Option<&'a str>,
    /// The libraries, one for each platform.
    pub libraries: &'a [Library],
    /// Returns further files that contain the guid, with their names in the FMU: the page, and C sources.
    pub with_guid: &'a dyn Fn(&str) -> Result<Files>,
    /// Other files, with their names in FMI 2.0.
    pub content: &'a [ContentFile],
}

/// An FMU that was written.
#[derive(Clone, Debug)]
pub struct Packed {
    /// The guid: a hash of everything in the FMU, calculated while the guid in it is [`NO_GUID`].
    pub guid: String,
    /// Size of the file in bytes.
    pub size: u64,
}

/// Writes the FMU to `destination`. If anything fails, an existing file does not change.
///
/// # Errors
/// When there is neither a library nor sources, two libraries are for one platform, a file cannot be read, or the destination
/// cannot be written.
pub fn pack(destination: &Path, parts: &Parts) -> Result<Packed> {
    let mut fingerprint = Fingerprint::new();
    for (name, bytes) in parts.entries(NO_GUID)? {
        fingerprint.add(&name, &bytes);
    }
    let guid = fingerprint.guid();
    let zip = zip(&parts.entries(&guid)?).map_err(Error::msg)?;
    let size = write_atomically(destination, |file| file.write_all(&zip)).map_err(Error::msg)?;
    Ok(Packed { guid, size })
}

impl Parts<'_> {
    /// Returns all files of the FMU, with this guid.
    fn entries(&self, guid: &str) -> Result<Files> {
        let Parts { fmi, identifier, description, terminals, libraries, with_guid, content } = *self;
        let mut entries =
            vec![("modelDescription.xml".to_owned(), with_guid_of(description, guid).into_bytes())];
        entries.extend(terminals.map(|text| (TERMINALS.to_owned(), text.as_bytes().to_vec())));
        for Library { platform, bytes, .. } in libraries {
            let name = format!("binaries/{}/{}", platform.directory(fmi), platform.library_name(identifier));
            entries.push((name, with_stamp(bytes, guid, None)?));
        }
        entries.extend(with_guid(guid)?);
        ensure!(
            entries.iter().any(|(name, _)| name.starts_with("binaries/") || name.starts_with("sources/")),
            "an FMU needs at least one library, or sources"
        );
        let has_icon = content.iter().any(|file| file.name == ICON);
        for ContentFile { name, path } in content {
            let name = match (fmi, name.as_str()) {
                // In FMI 3.0, `model.png` is stored as the icon. If the content already has an icon, `model.png` is left out.
                (Standard::Fmi3, "model.png") if has_icon => continue,
                (Standard::Fmi3, "model.png") => ICON,
                (_, name) => name,
            };
            let bytes = fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
            entries.push((name.to_owned(), bytes));
        }
        // The description is first, for tools that read the file as a stream; other entries are sorted by name.
        entries[1..].sort();
        Ok(entries)
    }
}

/// Returns a description with this guid, or instantiation token, instead of [`NO_GUID`].
pub(crate) fn with_guid_of(description: &str, guid: &str) -> String {
    let replaced = |text: String, attribute: &str| {
        text.replacen(&format!("{attribute}=\"{NO_GUID}\""), &format!("{attribute}=\"{guid}\""), 1)
    };
    replaced(replaced(description.to_owned(), "guid"), "instantiationToken")
}

const TERMINALS: &str = "terminalsAndIcons/terminalsAndIcons.xml";
const ICON: &str = "terminalsAndIcons/icon.png";
