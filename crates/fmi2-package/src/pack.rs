//! Makes the FMU, a zip file (section 2.3). The same content gives the same bytes, on every machine.

use crate::content::ContentFile;
use crate::platform::Platform;
use anyhow::{Context, Result, ensure};
use std::fs::{self, File};
use std::io::{Cursor, Write};
use std::path::{Path, PathBuf};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, System, ZipWriter};

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
    for pair in entries.windows(2) {
        ensure!(pair[0].0 != pair[1].0, "{} is there twice", pair[0].0);
    }
    let zip = zip(&entries).context("cannot make the zip file")?;
    write_atomically(destination, |file| Ok(file.write_all(&zip)?))
}

fn read(path: &Path) -> Result<Vec<u8>> {
    fs::read(path).with_context(|| format!("cannot read {}", path.display()))
}

/// A zip file of these entries, in this order.
pub(crate) fn zip(entries: &[(String, Vec<u8>)]) -> Result<Vec<u8>> {
    // Everything that would come from the clock or the machine is fixed here.
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .compression_level(Some(9))
        .last_modified_time(DateTime::default())
        .unix_permissions(0o644)
        .system(System::Unix);
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in entries {
        zip.start_file(name, options)?;
        zip.write_all(bytes)?;
    }
    Ok(zip.finish()?.into_inner())
}

/// Writes a file under a temporary name beside `destination` and gives it its name when it is complete.
/// Tells its size in bytes.
///
/// # Errors
/// When the folder cannot be made, or the file not be written; the destination is then untouched.
pub fn write_atomically(destination: &Path, write: impl FnOnce(&mut File) -> Result<()>) -> Result<u64> {
    let folder = match destination.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    };
    fs::create_dir_all(folder).with_context(|| format!("cannot make the folder {}", folder.display()))?;
    let mut builder = tempfile::Builder::new();
    // Temporary files are private by default; the result is as public as the user's umask says.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut file = builder
        .prefix(".unfinished-")
        .tempfile_in(folder)
        .with_context(|| format!("cannot write in the folder {}", folder.display()))?;
    let failed = || format!("cannot write {}", destination.display());
    write(file.as_file_mut()).with_context(failed)?;
    let size = file.as_file().metadata().with_context(failed)?.len();
    file.persist(destination).with_context(failed)?;
    Ok(size)
}
