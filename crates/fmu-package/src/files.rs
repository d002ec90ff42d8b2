//! Zip files, and files that are whole or not there.

use anyhow::{Context, Result, ensure};
use std::fs::{self, File};
use std::io::{Cursor, Read, Write};
use std::path::Path;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, System, ZipArchive, ZipWriter};

/// A zip file of these entries (name, content), in this order. The same entries give the same bytes, on every machine.
///
/// # Errors
/// When two entries have one name and stand beside each other, as they do in a sorted list.
pub fn zip(entries: &[(String, Vec<u8>)]) -> Result<Vec<u8>> {
    for pair in entries.windows(2) {
        ensure!(pair[0].0 != pair[1].0, "{} is there twice", pair[0].0);
    }
    // Everything that would come from the clock or the machine is fixed here.
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .compression_level(Some(9))
        .last_modified_time(DateTime::default())
        .unix_permissions(0o644)
        .system(System::Unix);
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    let mut write = || {
        for (name, bytes) in entries {
            zip.start_file(name, options)?;
            zip.write_all(bytes)?;
        }
        anyhow::Ok(())
    };
    write().context("cannot make the zip file")?;
    Ok(zip.finish().context("cannot make the zip file")?.into_inner())
}

/// The content of an entry of a zip file.
///
/// # Errors
/// When it is no zip file, or has no such entry.
pub fn unzip(zip: &[u8], name: &str) -> Result<Vec<u8>> {
    let mut archive = ZipArchive::new(Cursor::new(zip))?;
    let mut content = Vec::new();
    archive.by_name(name)?.read_to_end(&mut content)?;
    Ok(content)
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
