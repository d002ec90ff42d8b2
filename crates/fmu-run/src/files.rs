//! The files of an FMU or a system: unpacked to a temporary directory, or in a directory of the caller.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use tempfile::TempDir;
use zip::ZipArchive;

/// Directory with the files.
#[derive(Debug)]
pub(crate) enum Files {
    /// Removed when dropped.
    Temporary(TempDir),
    /// A directory that the caller has unpacked.
    Own(PathBuf),
}

/// The file at the top that shows what an archive is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Fmu,
    Ssp,
}

impl Kind {
    fn file(self) -> &'static str {
        match self {
            Self::Fmu => "modelDescription.xml",
            Self::Ssp => "SystemStructure.ssd",
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

    /// Unpacks a zip file; takes a directory as it is. The message of an error says what the file is instead.
    pub fn open(path: &Path, kind: Kind) -> Result<Self, String> {
        let files = if path.is_dir() {
            // The FMU gets absolute paths of its resources.
            let path = path.canonicalize().map_err(|error| format!("cannot be opened ({error})"))?;
            Self::Own(path)
        } else {
            unpacked(path, kind)?
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

    /// Returns the content of an XML file at the top.
    pub fn xml(&self, name: &str) -> Result<String, String> {
        let bytes = std::fs::read(self.path().join(name));
        decoded(&bytes.map_err(|error| format!("{name} cannot be read ({error})"))?).ok_or_else(|| {
            format!("{name} is not in an encoding that is supported (UTF-8, UTF-16, ISO-8859-1)")
        })
    }
}

/// Returns a directory at the top that contains the file.
fn below(directory: &Path, file: &str) -> Option<String> {
    let directories = std::fs::read_dir(directory).ok()?.flatten();
    directories
        .filter(|entry| entry.path().join(file).is_file())
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .next()
}

fn unpacked(path: &Path, kind: Kind) -> Result<Files, String> {
    let mut file = File::open(path).map_err(|error| format!("cannot be opened ({error})"))?;
    let mut start = [0; 64];
    let length = file.read(&mut start).map_err(|error| format!("cannot be read ({error})"))?;
    let mut archive = ZipArchive::new(file).map_err(|error| {
        let why = instead(&start[..length]).unwrap_or_else(|| format!("it cannot be read as one: {error}"));
        format!("is not {}, which is a zip file: {why}", kind.name())
    })?;
    let directory = tempfile::Builder::new().prefix("fmu-run-").tempdir();
    let directory = directory.map_err(|error| format!("no temporary directory can be made ({error})"))?;
    for index in 0..archive.len() {
        extract(&mut archive, index, directory.path())
            .map_err(|why| format!("cannot be unpacked ({why})"))?;
    }
    Ok(Files::Temporary(directory))
}

/// Extracts an entry. Links are skipped, because they could lead out of the directory. Permissions are ignored, except that
/// programs stay executable: some tools write entries that the owner could not read.
fn extract(archive: &mut ZipArchive<File>, index: usize, directory: &Path) -> Result<(), String> {
    let mut entry = archive.by_index(index).map_err(|error| error.to_string())?;
    // Some tools of Windows write backslashes.
    let name = entry.name().map_err(|error| error.to_string())?.replace('\\', "/");
    let path = entry.enclosed_name().map(|_| Path::new(&name));
    let is_inside = |path: &&Path| {
        path.components()
            .all(|part| matches!(part, std::path::Component::Normal(_) | std::path::Component::CurDir))
    };
    let Some(path) = path.filter(is_inside) else {
        return Err(format!("the entry {name} would be outside of the directory"));
    };
    if entry.is_symlink() {
        return Ok(());
    }
    let to = directory.join(path);
    let message = |error: std::io::Error| format!("{name}: {error}");
    if name.ends_with('/') {
        return std::fs::create_dir_all(&to).map_err(message);
    }
    if let Some(parent) = to.parent() {
        std::fs::create_dir_all(parent).map_err(message)?;
    }
    let mut file = File::create(&to).map_err(message)?;
    std::io::copy(&mut entry, &mut file).map_err(message)?;
    #[cfg(unix)]
    if entry.unix_mode().is_some_and(|mode| mode & 0o111 != 0) {
        use std::os::unix::fs::PermissionsExt;
        file.set_permissions(std::fs::Permissions::from_mode(0o755)).map_err(message)?;
    }
    Ok(())
}

/// Returns what a file is that is not a zip file, from its first bytes.
fn instead(start: &[u8]) -> Option<String> {
    let text = start.trim_ascii_start();
    let why = match text {
        [] => "it is empty",
        _ if text.starts_with(b"version https://git-lfs") => {
            "it is a pointer of Git LFS to the file, which `git lfs pull` fetches"
        }
        _ if text.len() >= 9 && text[..9].eq_ignore_ascii_case(b"<!doctype")
            || text.starts_with(b"<html") =>
        {
            "it is a web page; the download may have failed"
        }
        _ if text.starts_with(b"<?xml") => "it is an XML file; open the FMU that contains it",
        [0x7f, b'E', b'L', b'F', ..] | [b'M', b'Z', ..] => "it is a shared library or a program",
        [0x1f, 0x8b, ..] | [b'7', b'z', 0xbc, 0xaf, ..] | [b'R', b'a', b'r', b'!', ..] => {
            "it is an archive of another format"
        }
        _ => return None,
    };
    Some(why.to_owned())
}

/// Decodes an XML file: UTF-8, UTF-16 with a byte order mark, or ISO-8859-1, which the XML declaration names.
fn decoded(bytes: &[u8]) -> Option<String> {
    let wide = |order: fn([u8; 2]) -> u16| {
        let units: Vec<u16> = bytes[2..].as_chunks().0.iter().copied().map(order).collect();
        String::from_utf16(&units).ok()
    };
    match bytes {
        [0xff, 0xfe, ..] => return wide(u16::from_le_bytes),
        [0xfe, 0xff, ..] => return wide(u16::from_be_bytes),
        _ => {}
    }
    if let Ok(text) = std::str::from_utf8(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes)) {
        return Some(text.to_owned());
    }
    let declaration = String::from_utf8_lossy(&bytes[..bytes.len().min(200)]).to_ascii_lowercase();
    let is_latin = ["iso-8859-1", "iso-8859-15", "windows-1252", "latin1", "us-ascii"]
        .iter()
        .any(|name| declaration.contains(name));
    is_latin.then(|| bytes.iter().copied().map(char::from).collect())
}

#[cfg(test)]
mod tests {
    use super::{decoded, instead};

    #[test]
    fn encodings() {
        let utf16: Vec<u8> = "\u{feff}<a>\u{e4}</a>".encode_utf16().flat_map(u16::to_le_bytes).collect();
        assert_eq!(decoded(&utf16).as_deref(), Some("<a>\u{e4}</a>"));
        assert_eq!(decoded("\u{feff}<a>\u{e4}</a>".as_bytes()).as_deref(), Some("<a>\u{e4}</a>"));
        let latin = b"<?xml version=\"1.0\" encoding=\"ISO-8859-1\"?><a>\xe4</a>";
        assert!(decoded(latin).unwrap().ends_with("<a>\u{e4}</a>"));
        assert_eq!(decoded(b"<a>\xe4</a>"), None);
    }

    #[test]
    fn files_that_are_no_archive() {
        for (start, why) in [
            (&b""[..], "empty"),
            (b"version https://git-lfs.github.com/spec/v1\n", "git lfs pull"),
            (b"\n<!DOCTYPE html>", "web page"),
            (b"<?xml version", "XML"),
            (b"\x7fELF\x02\x01", "library"),
            (b"\x1f\x8b\x08", "another format"),
        ] {
            assert!(instead(start).unwrap().contains(why));
        }
        assert_eq!(instead(b"text"), None);
    }
}
