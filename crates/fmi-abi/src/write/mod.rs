//! Writes archives and XML documents that are the same bytes on every machine, and files atomically.

mod element;

pub use element::{Element, filled};
use std::fs::{self, File};
use std::io::{self, Cursor, Read, Write};
use std::path::Path;
use zip::result::ZipResult;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, System, ZipArchive, ZipWriter};

/// Returns a zip file of these entries (name, content), in this order. The same entries give the same bytes, on every machine.
///
/// # Errors
/// When two consecutive entries have the same name.
pub fn zip(entries: &[(String, Vec<u8>)]) -> Result<Vec<u8>, String> {
    if let Some(pair) = entries.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        return Err(format!("{} occurs twice in the zip file", pair[0].0));
    }
    // These settings would otherwise depend on the clock or the machine.
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .compression_level(Some(9))
        .last_modified_time(DateTime::default())
        .unix_permissions(0o644)
        .system(System::Unix);
    let write = || -> ZipResult<Vec<u8>> {
        let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
        for (name, bytes) in entries {
            zip.start_file(name, options)?;
            zip.write_all(bytes)?;
        }
        Ok(zip.finish()?.into_inner())
    };
    write().map_err(|error| format!("cannot make the zip file: {error}"))
}

/// Returns the content of an entry of a zip file.
///
/// # Errors
/// When it is not a zip file, or when the entry is missing.
pub fn unzip(zip: &[u8], name: &str) -> Result<Vec<u8>, String> {
    let read = || -> ZipResult<Vec<u8>> {
        let mut content = Vec::new();
        ZipArchive::new(Cursor::new(zip))?.by_name(name)?.read_to_end(&mut content)?;
        Ok(content)
    };
    read().map_err(|error| error.to_string())
}

/// Beginning of the names of temporary files.
const UNFINISHED: &str = ".unfinished-";

/// Removes the temporary files that no process has locked, because their processes were killed. This is done only on Unix, where the files
/// are locked. Failures are ignored: they only leave a file behind.
fn remove_abandoned(directory: &Path) {
    for entry in fs::read_dir(directory).into_iter().flatten().flatten() {
        let is_temporary = entry.file_name().to_string_lossy().starts_with(UNFINISHED);
        if !cfg!(unix) || !is_temporary || !entry.file_type().is_ok_and(|of| of.is_file()) {
            continue;
        }
        let file = File::options().write(true).open(entry.path());
        if file.is_ok_and(|file| file.try_lock().is_ok()) {
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// Writes a file under a temporary name next to `destination`, renames it when it is complete, and returns its size in bytes.
///
/// # Errors
/// When the directory or the file cannot be written, or `write` fails; the destination then does not change.
pub fn write_atomically(
    destination: &Path,
    write: impl FnOnce(&mut File) -> io::Result<()>,
) -> Result<u64, String> {
    let directory = match destination.parent() {
        Some(directory) if directory != Path::new("") => directory,
        _ => Path::new("."),
    };
    let during = |what: &'static str, path: &Path| {
        let begin = format!("cannot {what} {}: ", path.display());
        move |error: io::Error| begin.clone() + &error.to_string()
    };
    fs::create_dir_all(directory).map_err(during("make the directory", directory))?;
    remove_abandoned(directory);
    let mut builder = tempfile::Builder::new();
    // Temporary files are private by default; the result has the permissions of the user's umask.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder.prefix(UNFINISHED);
    let create = || {
        let file = builder.tempfile_in(directory)?;
        #[cfg(unix)]
        file.as_file().lock()?;
        io::Result::Ok(file)
    };
    let failed = during("write in the directory", directory);
    let mut file = create().map_err(&failed)?;
    // Before this process locked the file, another one may have removed it as abandoned.
    while !file.path().exists() {
        file = create().map_err(&failed)?;
    }
    let finish = || {
        write(file.as_file_mut())?;
        // Otherwise the file may be empty after a power failure.
        file.as_file().sync_all()?;
        let size = file.as_file().metadata()?.len();
        file.persist(destination)?;
        Ok(size)
    };
    finish().map_err(during("write", destination))
}
