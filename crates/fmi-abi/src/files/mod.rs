//! Reads untrusted files: archives of FMUs and systems, and the XML files and libraries in them. Only regular files are read, each
//! up to a limit.

pub mod binaries;
mod scratch;
mod unpack;

use crate::xml::reserve;
pub use binaries::find_library;
pub use scratch::Scratch;
use std::fs::File;
use std::io::Read;
use std::path::Path;
pub use unpack::{Entry, Limits, unpack};

/// Maximum size of an XML file, in bytes.
pub const MAX_XML: u64 = 256 << 20;

/// Opens a file, if it is a regular file. Other files are rejected, because opening a pipe would wait for a writer, and
/// reading a device may never end.
///
/// # Errors
/// Fails if the file cannot be opened or is not a regular file.
pub fn open(path: &Path) -> Result<File, String> {
    let message = |error: std::io::Error| format!("cannot be opened ({error})");
    if !std::fs::metadata(path).map_err(message)?.is_file() {
        return Err("is not a regular file".to_owned());
    }
    File::open(path).map_err(message)
}

/// Reads a file of at most `most` bytes.
///
/// # Errors
/// Fails if the file cannot be opened or read, has more bytes, or would take too much memory.
pub fn read(path: &Path, most: u64) -> Result<Vec<u8>, String> {
    let file = open(path)?;
    let message = |error: std::io::Error| format!("cannot be read ({error})");
    let length = file.metadata().map_err(message)?.len();
    let too_large = || format!("has more than {} MB", most >> 20);
    if length > most {
        return Err(too_large());
    }
    let capacity = usize::try_from(length).unwrap_or(usize::MAX).saturating_add(1);
    reserve(capacity).map_err(|why| format!("cannot be read: {why}"))?;
    let mut bytes = Vec::with_capacity(capacity);
    file.take(most + 1).read_to_end(&mut bytes).map_err(message)?;
    if bytes.len() as u64 > most { Err(too_large()) } else { Ok(bytes) }
}

/// Reads and decodes an XML file.
///
/// # Errors
/// Fails for the same reasons as [`read`], and if the encoding is none of these: UTF-8, UTF-16 with a byte order mark,
/// ISO-8859-1 and similar encodings.
pub fn read_xml(path: &Path) -> Result<String, String> {
    let bytes = read(path, MAX_XML)?;
    reserve(2 * bytes.len()).map_err(|why| format!("cannot be read: {why}"))?;
    decoded(&bytes)
        .ok_or_else(|| "is not in an encoding that is supported (UTF-8, UTF-16, ISO-8859-1)".to_owned())
}

/// Decodes an XML file: UTF-8, UTF-16 with a byte order mark, or ISO-8859-1 if the XML declaration names it or a
/// similar encoding. Returns `None` for other encodings.
fn decoded(bytes: &[u8]) -> Option<String> {
    let wide = |order: fn([u8; 2]) -> u16| {
        let units = bytes[2..].as_chunks().0.iter().copied().map(order);
        char::decode_utf16(units).collect::<Result<String, _>>().ok()
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
    use super::{decoded, read};
    use std::path::Path;

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
    fn other_files_are_not_read() {
        let why = |path: &Path| read(path, 10).unwrap_err();
        let directory = tempfile::tempdir().unwrap();
        let large = directory.path().join("large");
        std::fs::write(&large, [0; 11]).unwrap();
        assert_eq!(why(&large), "has more than 0 MB");
        assert_eq!(why(directory.path()), "is not a regular file");
        #[cfg(unix)]
        assert_eq!(why(Path::new("/dev/zero")), "is not a regular file");
    }
}
