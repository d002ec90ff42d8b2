//! Unpacks archives.

use super::open;
use crate::{shown, xml::reserve};
use std::collections::HashSet;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Component, Path, PathBuf};
use zip::ZipArchive;

/// Upper bound for the memory that an entry of an archive's directory takes, in bytes.
const ENTRY: usize = 1000;
/// Maximum number of nested directories. Each level makes the access to the files in it slower.
const MAX_DEPTH: usize = 100;

/// Limits for the content of an archive.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Maximum number of bytes of all files together, unpacked.
    pub bytes: u64,
    /// Maximum number of files and directories, including directories that have no entry of their own.
    pub entries: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self { bytes: 1000 << 20, entries: 50_000 }
    }
}

/// An entry of an archive.
#[derive(Debug)]
pub struct Entry<'a> {
    /// Path as written.
    pub name: &'a str,
    /// Whether the path stays in the directory.
    pub is_inside: bool,
    /// Name of the compression method, if the FMI standard does not permit it.
    pub compression: Option<String>,
}

/// Unpacks the ZIP file `path` into the directory `to`; messages call the file `what`, for example "an FMU". `wanted`
/// returns whether an entry is extracted. If several entries have the same name, `wanted` is called for each of them, but only
/// the last one is extracted. Entries outside of the directory are never extracted, and neither are links, because a link could
/// lead outside. The number of all entries and created directories and the extracted bytes are subtracted from `limits`.
/// Permissions are ignored, because some tools write entries that the owner could not read, but programs stay
/// executable.
///
/// # Errors
/// Fails if the file is not a ZIP file or exceeds the limits, if an entry cannot be extracted, or if `wanted` fails.
pub fn unpack(
    path: &Path,
    what: &str,
    to: &Path,
    limits: &mut Limits,
    wanted: &mut dyn FnMut(&Entry) -> Result<bool, String>,
) -> Result<(), String> {
    let mut file = open(path)?;
    let mut start = [0; 64];
    let length = file.read(&mut start).map_err(|error| format!("cannot be read ({error})"))?;
    let declared = declared_count(&mut file).unwrap_or_default();
    check_count(declared, *limits)?;
    let mut archive = ZipArchive::new(file).map_err(|error| {
        let error = error.to_string();
        let why = instead(&start[..length])
            .unwrap_or_else(|| format!("it cannot be read as one: {}", shown(&error)));
        format!("is not {what}, which is a zip file: {why}")
    })?;
    check_count(archive.len() as u64, *limits)?;
    limits.entries -= archive.len();
    let most = limits.bytes;
    let too_large = || format!("has more than {} MB when it is unpacked, the limit for archives", most >> 20);
    // The declared size may be wrong, so the loop also counts the bytes that it extracts.
    if archive.decompressed_size().is_some_and(|size| size > u128::from(most)) {
        return Err(too_large());
    }
    let fail = |why: String| format!("cannot be unpacked ({why})");
    if declared > archive.len() as u64 {
        for name in repeated_names(path, archive.central_directory_start()) {
            wanted(&Entry { name: &name, is_inside: true, compression: None }).map_err(fail)?;
        }
    }
    for index in 0..archive.len() {
        let written = extract(&mut archive, index, to, limits, wanted).map_err(fail)?;
        limits.bytes = limits.bytes.checked_sub(written).ok_or_else(too_large)?;
    }
    Ok(())
}

/// Returns the names that several entries of the archive's directory have, once for each repetition. [`ZipArchive`] keeps only
/// the last of these entries.
fn repeated_names(path: &Path, start: u64) -> Vec<String> {
    /// Length of the part of an entry before its name.
    const FIXED: usize = 46;
    let (mut seen, mut repeated) = (HashSet::new(), Vec::new());
    let mut read = || -> std::io::Result<()> {
        let mut file = std::io::BufReader::new(File::open(path)?);
        file.seek(SeekFrom::Start(start))?;
        let mut fixed = [0; FIXED];
        loop {
            file.read_exact(&mut fixed)?;
            if !fixed.starts_with(b"PK\x01\x02") {
                return Ok(());
            }
            let length = |at: usize| u16::from_le_bytes([fixed[at], fixed[at + 1]]);
            let mut name = vec![0; length(28).into()];
            file.read_exact(&mut name)?;
            file.seek_relative(i64::from(length(30)) + i64::from(length(32)))?;
            let name = String::from_utf8_lossy(&name).into_owned();
            if !seen.insert(name.clone()) {
                repeated.push(name);
            }
        }
    };
    // A directory that cannot be read to its end has no further entries.
    _ = read();
    repeated
}

fn check_count(count: u64, limits: Limits) -> Result<(), String> {
    if count > limits.entries as u64 {
        return Err(format!("has {count} entries; the limit for archives is {}", limits.entries));
    }
    let bytes = usize::try_from(count).unwrap_or(usize::MAX).saturating_mul(ENTRY);
    reserve(bytes).map_err(|why| format!("cannot be unpacked: {why}"))
}

/// Returns the number of entries that the end of an archive declares, so that this number can be checked before the
/// archive's directory is read. Returns `None` if the file has no such end, or cannot be read.
fn declared_count(file: &mut File) -> Option<u64> {
    /// Total length of the record at the end, its longest comment, and the records before it in large archives.
    const LONGEST: u64 = 22 + 65_535 + 76;
    let length = file.seek(SeekFrom::End(0)).ok()?;
    file.seek(SeekFrom::Start(length.saturating_sub(LONGEST))).ok()?;
    let mut tail = Vec::new();
    file.by_ref().take(LONGEST).read_to_end(&mut tail).ok()?;
    file.rewind().ok()?;
    let last = |signature: &[u8; 4]| tail.windows(4).rposition(|window| window == signature);
    let short = last(b"PK\x05\x06")
        .and_then(|at| tail.get(at + 10..at + 12)?.try_into().ok().map(u16::from_le_bytes));
    let long = last(b"PK\x06\x06")
        .and_then(|at| tail.get(at + 32..at + 40)?.try_into().ok().map(u64::from_le_bytes));
    short.map(u64::from).max(long)
}

/// Extracts an entry and returns its size in bytes: 0 if no file is written, more than the limit if the file is larger.
/// Subtracts the directories that it creates from the limit of entries.
fn extract(
    archive: &mut ZipArchive<File>,
    index: usize,
    directory: &Path,
    limits: &mut Limits,
    wanted: &mut dyn FnMut(&Entry) -> Result<bool, String>,
) -> Result<u64, String> {
    let mut entry = archive.by_index(index).map_err(|error| shown(&error.to_string()).into_owned())?;
    let name = entry.name().map_err(|error| shown(&error.to_string()).into_owned())?.into_owned();
    // Some Windows tools write backslashes.
    let relative = name.replace('\\', "/");
    let path = Path::new(&relative);
    let is_normal = |part: Component| matches!(part, Component::Normal(_) | Component::CurDir);
    let is_inside =
        entry.enclosed_name().is_some() && !relative.contains('\0') && path.components().all(is_normal);
    let compression = entry.compression();
    let is_permitted =
        matches!(compression, zip::CompressionMethod::Stored | zip::CompressionMethod::Deflated);
    let compression = (!is_permitted).then(|| compression.to_string());
    if !wanted(&Entry { name: &name, is_inside, compression })? || !is_inside || entry.is_symlink() {
        return Ok(0);
    }
    // Omits `.` from the path, because some tools write an entry `./`, and creating that directory would fail.
    let parts: Vec<_> = path.components().filter(|part| matches!(part, Component::Normal(_))).collect();
    let to = directory.join(parts.iter().collect::<PathBuf>());
    let message = |error: std::io::Error| format!("{}: {error}", shown(&name));
    let is_directory = relative.ends_with('/');
    if !is_directory && entry.size() > limits.bytes {
        return Ok(limits.bytes + 1);
    }
    let directories =
        if is_directory { &*parts } else { parts.split_last().map_or(&[][..], |(_, above)| above) };
    if directories.len() > MAX_DEPTH {
        return Err(format!("{} is in more than {MAX_DEPTH} nested directories", shown(&name)));
    }
    let created = create(directory, directories).map_err(message)?;
    let too_many = "it has too many directories for the limit for archives";
    limits.entries = limits.entries.checked_sub(created).ok_or(too_many)?;
    if is_directory {
        return Ok(0);
    }
    let mut file = File::create(&to).map_err(message)?;
    // The size that the entry declares may be wrong, so the copy is limited as well.
    let size = std::io::copy(&mut (&mut entry).take(limits.bytes + 1), &mut file).map_err(message)?;
    #[cfg(unix)]
    if entry.unix_mode().is_some_and(|mode| mode & 0o111 != 0) {
        use std::os::unix::fs::PermissionsExt;
        file.set_permissions(std::fs::Permissions::from_mode(0o755)).map_err(message)?;
    }
    Ok(size)
}

/// Creates nested directories in `directory`, unless they exist, and returns their number. Creates `directory`, too.
fn create(directory: &Path, nested: &[Component]) -> std::io::Result<usize> {
    let mut path = directory.join(nested.iter().collect::<PathBuf>());
    if path.is_dir() {
        return Ok(0);
    }
    std::fs::create_dir_all(directory)?;
    path = directory.to_owned();
    let mut created = 0;
    for part in nested {
        path.push(part);
        match std::fs::create_dir(&path) {
            Ok(()) => created += 1,
            Err(_) if path.is_dir() => {}
            Err(error) => return Err(error),
        }
    }
    Ok(created)
}

/// Returns what a file seems to be instead of a zip file, judged by its first bytes; `None` if this is unknown.
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

#[cfg(test)]
mod tests {
    use super::{Limits, instead, unpack};
    use std::io::Write;

    #[test]
    fn entries_may_begin_with_a_dot() {
        let directory = tempfile::tempdir().unwrap();
        let (path, to) = (directory.path().join("archive"), directory.path().join("new"));
        let mut archive = zip::ZipWriter::new(std::fs::File::create(&path).unwrap());
        archive.add_directory("./", zip::write::SimpleFileOptions::default()).unwrap();
        archive.start_file("./a/b", zip::write::SimpleFileOptions::default()).unwrap();
        archive.finish().unwrap();
        unpack(&path, "an archive", &to, &mut Limits::default(), &mut |_| Ok(true)).unwrap();
        assert!(to.join("a/b").is_file());
    }

    #[test]
    fn archives_have_limits() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("archive");
        let mut archive = zip::ZipWriter::new(std::fs::File::create(&path).unwrap());
        for name in ["a", "b", "c"] {
            archive.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
            archive.write_all(&[0; 1 << 20]).unwrap();
        }
        archive.finish().unwrap();
        let to = directory.path().join("to");
        let unpacked = |bytes: u64, entries: usize| {
            unpack(&path, "an FMU", &to, &mut Limits { bytes, entries }, &mut |_| Ok(true))
        };
        assert_eq!(
            unpacked((3 << 20) - 1, 3).unwrap_err(),
            "has more than 2 MB when it is unpacked, the limit for archives"
        );
        assert_eq!(unpacked(3 << 20, 2).unwrap_err(), "has 3 entries; the limit for archives is 2");
        assert!(!to.exists(), "a rejected archive must not be unpacked");
        assert_eq!(unpacked(3 << 20, 3), Ok(()));
        // Changes the archive so that it declares smaller sizes than its files have.
        let bytes = std::fs::read(&path).unwrap();
        let size = (1_u32 << 20).to_le_bytes();
        let mut changed = bytes.clone();
        for at in (0..bytes.len() - 4).filter(|at| bytes[*at..at + 4] == size) {
            changed[at..at + 4].copy_from_slice(&10_u32.to_le_bytes());
        }
        std::fs::write(&path, changed).unwrap();
        assert!(unpacked(1000, 3).is_err());
        assert!(std::fs::metadata(to.join("a")).unwrap().len() <= 1001);
    }

    /// Packs empty files with these names.
    fn packed(path: &std::path::Path, names: impl IntoIterator<Item = String>) {
        let mut archive = zip::ZipWriter::new(std::fs::File::create(path).unwrap());
        for name in names {
            archive.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
        }
        archive.finish().unwrap();
    }

    #[test]
    fn directories_count_as_entries() {
        let directory = tempfile::tempdir().unwrap();
        let (path, to) = (directory.path().join("archive"), directory.path().join("to"));
        // Few files, each in many directories.
        for (files, depth, entries) in [(1, 100, 101), (10, 50, 510), (100, 9, 1000)] {
            packed(&path, (0..files).map(|file| format!("{file}/").repeat(depth) + "x"));
            for limit in [entries - 1, entries] {
                let mut limits = Limits { entries: limit, ..Limits::default() };
                let unpacked = unpack(&path, "an FMU", &to, &mut limits, &mut |_| Ok(true));
                assert_eq!(
                    unpacked.is_ok(),
                    limit == entries,
                    "{files} files, {depth} directories: {unpacked:?}"
                );
                assert!(unpacked.is_ok() || unpacked.unwrap_err().contains("limit for archives"));
                std::fs::remove_dir_all(&to).unwrap();
            }
        }
        packed(&path, ["d/".repeat(101) + "x"]);
        let deep = unpack(&path, "an FMU", &to, &mut Limits::default(), &mut |_| Ok(true));
        assert!(deep.unwrap_err().contains("is in more than 100 nested directories"));
    }

    #[test]
    fn repeated_names_are_reported() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("archive");
        packed(&path, ["aaaa", "abbb", "abbc", "abbd"].map(str::to_owned));
        // The writer of archives rejects repeated names.
        let bytes = std::fs::read(&path).unwrap();
        let changed = String::from_utf8(bytes.iter().map(|byte| byte & 0x7f).collect()).unwrap();
        let mut bytes = bytes;
        for name in ["abbc", "abbd"] {
            changed.match_indices(name).for_each(|(at, _)| bytes[at..at + 4].copy_from_slice(b"abbb"));
        }
        for prefix in [&b""[..], b"a program before the archive"] {
            std::fs::write(&path, [prefix, &bytes].concat()).unwrap();
            let mut names = Vec::new();
            unpack(&path, "an FMU", &directory.path().join("to"), &mut Limits::default(), &mut |entry| {
                names.push(entry.name.to_owned());
                Ok(true)
            })
            .unwrap();
            names.sort_unstable();
            assert_eq!(names, ["aaaa", "abbb", "abbb", "abbb"]);
        }
    }

    #[test]
    fn files_that_are_not_archives_are_recognized() {
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
