//! Finds the files to which a system refers. The attribute `source` is a URI (section 4.1 of SSP 1.0). Files outside of the system
//! are rejected.

use fmi_abi::shown;
use std::path::{Component, Path, PathBuf};

/// The directory of a system.
pub(in crate::system) struct Base<'a> {
    pub directory: &'a Path,
    /// Whether the directory was unpacked from an archive.
    pub is_archive: bool,
}

impl Base<'_> {
    /// Returns the path of a file of the system.
    ///
    /// # Errors
    /// Fails if there is no such file in the directory of the system. The message contains the source.
    pub fn find(&self, source: &str) -> Result<PathBuf, String> {
        let outside = || match self.is_archive {
            true => format!("{} is outside of the archive", shown(source)),
            false => format!("{} is outside of {}", shown(source), self.directory.display()),
        };
        let missing = || format!("there is no readable {} in it", shown(source));
        let decoded = decoded(source).ok_or_else(|| format!("{} is not a URI", shown(source)))?;
        let absolute = match scheme(&decoded) {
            None => None,
            Some("file") if !self.is_archive => Some(of_file(&decoded)),
            Some("file") => return Err(outside()),
            Some(_) => return Err(format!("{} is not a file of the system", shown(source))),
        };
        let path = match absolute {
            Some(path) => path,
            None => {
                let path = self.directory.join(relative(&decoded).ok_or_else(outside)?);
                // If there is no such file, tries the name without decoding, because some tools do not encode names.
                let literal = relative(source).map(|name| self.directory.join(name));
                literal.filter(|literal| !path.exists() && literal.exists()).unwrap_or(path)
            }
        };
        // Compares canonical paths, because a symbolic link may lead outside.
        let real = path.canonicalize().map_err(|_| missing())?;
        let directory = self.directory.canonicalize().map_err(|_| missing())?;
        if real.starts_with(directory) { Ok(real) } else { Err(outside()) }
    }
}

/// Decodes percent-encoded bytes, such as `%20`. Returns `None` if the result is not UTF-8 or contains control characters.
fn decoded(source: &str) -> Option<String> {
    let mut bytes = Vec::with_capacity(source.len());
    let mut rest = source.as_bytes();
    while let [first, after @ ..] = rest {
        let digits = after.get(..2).and_then(|digits| std::str::from_utf8(digits).ok());
        let byte = digits.filter(|digits| digits.bytes().all(|digit| digit.is_ascii_hexdigit()));
        match byte.and_then(|digits| u8::from_str_radix(digits, 16).ok()) {
            Some(byte) if *first == b'%' => {
                bytes.push(byte);
                rest = &after[2..];
            }
            _ => {
                bytes.push(*first);
                rest = after;
            }
        }
    }
    String::from_utf8(bytes).ok().filter(|name| !name.contains(char::is_control))
}

/// Returns the scheme of a URI, such as `file`. A single letter is not a scheme but a drive of Windows.
fn scheme(uri: &str) -> Option<&str> {
    let (scheme, _) = uri.split_once(':')?;
    let is_scheme = scheme.len() > 1
        && scheme.starts_with(|first: char| first.is_ascii_alphabetic())
        && scheme.chars().all(|letter| letter.is_ascii_alphanumeric() || "+-.".contains(letter));
    is_scheme.then_some(if scheme.eq_ignore_ascii_case("file") { "file" } else { scheme })
}

/// Returns the path of `file:/path`, `file:///path` or `file://localhost/path`.
fn of_file(uri: &str) -> PathBuf {
    let path = &uri["file:".len()..];
    let path = path.strip_prefix("//localhost").or_else(|| path.strip_prefix("//")).unwrap_or(path);
    // file:///C:/path
    let drive = path.strip_prefix('/').filter(|path| path.get(1..2) == Some(":"));
    PathBuf::from(drive.filter(|_| cfg!(windows)).unwrap_or(path))
}

/// Removes `..` from a relative path. Returns `None` if the path is absolute or leads outside.
fn relative(name: &str) -> Option<PathBuf> {
    let name = name.replace('\\', "/");
    let mut path = PathBuf::new();
    for part in Path::new(&name).components() {
        match part {
            Component::Normal(part) => path.push(part),
            Component::CurDir => {}
            Component::ParentDir => path.pop().then_some(())?,
            Component::RootDir | Component::Prefix(_) => return None,
        }
    }
    Some(path)
}

#[cfg(test)]
mod tests {
    use super::Base;
    use std::path::Path;

    #[test]
    fn sources_are_files_of_the_system() {
        let outer = tempfile::tempdir().unwrap();
        let outer = outer.path().canonicalize().unwrap();
        let directory = outer.join("system");
        std::fs::create_dir_all(directory.join("resources")).unwrap();
        for name in ["a b.fmu", "100%25.fmu", "resources/c.ssv", "../secret"] {
            std::fs::write(directory.join(name), "").unwrap();
        }
        #[cfg(unix)]
        std::os::unix::fs::symlink(outer.join("secret"), directory.join("link")).unwrap();
        let find = |source: &str, is_archive| Base { directory: &directory, is_archive }.find(source);
        for source in
            ["a b.fmu", "a%20b.fmu", "./a%20b.fmu", "resources/../a b.fmu", "resources%2F..%5ca b.fmu"]
        {
            assert_eq!(find(source, true), Ok(directory.join("a b.fmu")), "{source}");
        }
        assert_eq!(find("100%2525.fmu", true), find("100%25.fmu", true));
        let uri = |path: &Path| format!("file://{}", path.display());
        assert_eq!(find(&uri(&directory.join("a%20b.fmu")), false), Ok(directory.join("a b.fmu")));
        let (secret, absolute) = (uri(&outer.join("secret")), outer.join("secret").display().to_string());
        let inside = uri(&directory.join("a b.fmu"));
        for (source, is_archive, why) in [
            ("../secret", true, "is outside of the archive"),
            ("%2e%2e/secret", true, "is outside of the archive"),
            ("..\\secret", true, "is outside of the archive"),
            (&absolute, true, "is outside of the archive"),
            (&absolute, false, directory.to_str().unwrap()),
            (&secret, false, directory.to_str().unwrap()),
            (&inside, true, "is outside of the archive"),
            ("link", true, "is outside of the archive"),
            ("/dev/zero", true, "is outside of the archive"),
            ("http://example.org/a.fmu", true, "is not a file of the system"),
            ("missing.fmu", true, "there is no readable missing.fmu in it"),
            ("\u{1b}[31m", true, "\\u{1b}[31m is not a URI"),
        ] {
            let error = find(source, is_archive).unwrap_err();
            assert!(error.contains(why) && !error.contains(char::is_control), "{source}: {error}");
        }
    }
}
