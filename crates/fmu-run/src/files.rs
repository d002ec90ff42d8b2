//! The files of an FMU or a system, in a temporary directory or in a directory of the caller.

use fmi_abi::files::{Limits, Scratch, read_xml, unpack};
use fmi_abi::shown;
use std::path::{Path, PathBuf};

/// File of an SSP that contains the structure of the system.
pub(crate) const STRUCTURE: &str = "SystemStructure.ssd";

/// Directory that contains the files.
#[derive(Debug)]
pub(crate) enum Files {
    /// A temporary directory, which is removed when dropped.
    Temporary(Scratch),
    /// A directory of the caller, which contains the unpacked files.
    Own(PathBuf),
}

/// Kind of archive, recognized by the file in its top directory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Fmu,
    Ssp,
}

impl Kind {
    fn file(self) -> &'static str {
        match self {
            Self::Fmu => "modelDescription.xml",
            Self::Ssp => STRUCTURE,
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Fmu => "an FMU",
            Self::Ssp => "a system (SSP)",
        }
    }
}

impl Files {
    pub fn path(&self) -> &Path {
        match self {
            Self::Temporary(directory) => directory.path(),
            Self::Own(directory) => directory,
        }
    }

    /// Unpacks a zip file within these limits, or uses the files of a directory without copying them. If the content is of the
    /// other kind, the error names that kind.
    pub fn open(path: &Path, kind: Kind, limits: &mut Limits) -> Result<Self, String> {
        let files = if path.is_dir() {
            // The path must be absolute, because the location of the resources, which is passed to the FMU, is derived from it.
            let path = path.canonicalize().map_err(|error| format!("cannot be opened ({error})"))?;
            Self::Own(path)
        } else {
            unpacked(path, kind, limits)?
        };
        if files.path().join(kind.file()).is_file() {
            return Ok(files);
        }
        let (what, file) = (if path.is_dir() { "directory" } else { "zip file" }, kind.file());
        let other = if kind == Kind::Fmu { Kind::Ssp } else { Kind::Fmu };
        if files.path().join(other.file()).is_file() {
            let open = if kind == Kind::Fmu { "System" } else { "Fmu" };
            return Err(format!("is not {} but {}; open it with {open}", kind.name(), other.name()));
        }
        if let Some(below) = below(files.path(), file) {
            return Err(format!(
                "has its {file} in the directory {below}; it must be at the top, so pack the content of that directory"
            ));
        }
        Err(format!("is not {}: the {what} has no {file}", kind.name()))
    }

    /// Returns the content of an XML file in the top directory.
    pub fn xml(&self, name: &str) -> Result<String, String> {
        read_xml(&self.path().join(name)).map_err(|why| format!("{name} {why}"))
    }
}

/// Returns the name of a subdirectory that contains the file.
fn below(directory: &Path, file: &str) -> Option<String> {
    let directories = std::fs::read_dir(directory).ok()?.flatten();
    directories
        .filter(|entry| entry.path().join(file).is_file())
        .map(|entry| shown(&entry.file_name().to_string_lossy()).into_owned())
        .next()
}

fn unpacked(path: &Path, kind: Kind, limits: &mut Limits) -> Result<Files, String> {
    let directory =
        Scratch::new("fmu-run-").map_err(|error| format!("no temporary directory can be made ({error})"))?;
    unpack(path, kind.name(), directory.path(), limits, &mut |entry| {
        if entry.is_inside {
            return Ok(true);
        }
        Err(format!("the entry {} would be outside of the directory", shown(entry.name)))
    })
    .map_err(|why| match why.contains("limit for archives") {
        true => format!("{why}; if you trust it, unpack it and open the directory"),
        false => why,
    })?;
    Ok(Files::Temporary(directory))
}
