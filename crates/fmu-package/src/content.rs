//! The files in an FMU, except its description and its libraries.

use crate::directory::{files, names};
use anyhow::{Result, bail};
use std::path::{Path, PathBuf};

/// The possible entries of a directory of content, each with its path in the FMU (section 2.3 of FMI 2.0).
const LOCATIONS: [(&str, &str); 6] = [
    ("documentation", "documentation"),
    ("extra", "extra"),
    ("licenses", "documentation/licenses"),
    ("model.png", "model.png"),
    ("resources", "resources"),
    ("terminalsAndIcons", "terminalsAndIcons"),
];

/// A file that an FMU contains unchanged.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ContentFile {
    /// Its path in the FMU, with forward slashes.
    pub name: String,
    /// Its path on this machine.
    pub path: PathBuf,
}

/// Returns the files in a directory that an FMU contains unchanged, sorted by name: `model.png`, the directories that section 2.3
/// of FMI 2.0 lists, and the directory `licenses` as `documentation/licenses`.
///
/// Hidden files are left out, and so are the top-level entries named in `except`.
///
/// # Errors
/// When a top-level entry has another name, two files have the same path in the FMU, a file cannot be read, or a name is not UTF-8.
pub fn content_files(directory: &Path, except: &[&str]) -> Result<Vec<ContentFile>> {
    let mut content = Vec::new();
    for top in names(directory)?.into_iter().filter(|top| !except.contains(&top.as_str())) {
        let path = directory.join(&top);
        let Some((_, location)) = LOCATIONS.iter().find(|(name, _)| *name == top) else {
            let known = LOCATIONS.map(|(name, _)| name).join(", ");
            bail!(
                "{} cannot be in an FMU; rename it, or move it to another directory; allowed here are {known}",
                path.display()
            );
        };
        let files = files(&path)?.into_iter();
        content.extend(files.map(|(rest, path)| ContentFile { name: format!("{location}{rest}"), path }));
    }
    content.sort_by(|a, b| a.name.cmp(&b.name));
    if let Some(pair) = content.windows(2).find(|pair| pair[0].name == pair[1].name) {
        bail!(
            "{} and {} would have the same name in the FMU",
            pair[0].path.display(),
            pair[1].path.display()
        );
    }
    Ok(content)
}

#[cfg(test)]
mod tests {
    use super::content_files;
    use std::fs;

    #[test]
    fn known_files_get_their_path_and_others_are_rejected() {
        let directory = tempfile::tempdir().unwrap();
        let path = |name: &str| directory.path().join(name);
        fs::create_dir_all(path("documentation/img")).unwrap();
        fs::create_dir(path("licenses")).unwrap();
        for name in [
            "documentation/img/a.png",
            "documentation/.hidden",
            "licenses/license.txt",
            "model.png",
            "own.json",
        ] {
            fs::write(path(name), name).unwrap();
        }
        let files = content_files(directory.path(), &["own.json"]).unwrap();
        let names: Vec<_> = files.iter().map(|file| file.name.as_str()).collect();
        assert_eq!(names, ["documentation/img/a.png", "documentation/licenses/license.txt", "model.png"]);

        let error = content_files(directory.path(), &[]).unwrap_err().to_string();
        assert!(error.contains("own.json") && error.contains("documentation"), "{error}");
    }
}
