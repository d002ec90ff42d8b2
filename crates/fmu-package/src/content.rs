//! The files of an FMU that are neither its description nor its library.

use crate::folder::{files, names};
use anyhow::{Result, bail};
use std::path::{Path, PathBuf};

/// Where a folder's entries go in the FMU (section 2.3).
const PLACES: [(&str, &str); 6] = [
    ("documentation", "documentation"),
    ("extra", "extra"),
    ("licenses", "documentation/licenses"),
    ("model.png", "model.png"),
    ("resources", "resources"),
    ("terminalsAndIcons", "terminalsAndIcons"),
];

/// A file that goes into an FMU as it is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ContentFile {
    /// Its name in the FMU, with forward slashes.
    pub name: String,
    /// The file.
    pub path: PathBuf,
}

/// The files of `folder` that go into an FMU as they are, sorted by name: `model.png` and the folders
/// that section 2.3 lists, and the folder `licenses` as `documentation/licenses`.
///
/// Hidden files are left out, and so are the top-level entries named in `except`.
///
/// # Errors
/// When a top-level entry is none of these, a file cannot be found, or a name is not UTF-8.
pub fn content_files(folder: &Path, except: &[&str]) -> Result<Vec<ContentFile>> {
    let mut content = Vec::new();
    for top in names(folder)?.into_iter().filter(|top| !except.contains(&top.as_str())) {
        let path = folder.join(&top);
        let Some((_, place)) = PLACES.iter().find(|(name, _)| *name == top) else {
            let known = PLACES.map(|(name, _)| name).join(", ");
            bail!("{} has no place in an FMU; move it away, or into one of {known}", path.display());
        };
        let files = files(&path)?.into_iter();
        content.extend(files.map(|(rest, path)| ContentFile { name: format!("{place}{rest}"), path }));
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
    fn files_find_their_place_and_strangers_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
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
        let files = content_files(folder.path(), &["own.json"]).unwrap();
        let names: Vec<_> = files.iter().map(|file| file.name.as_str()).collect();
        assert_eq!(names, ["documentation/img/a.png", "documentation/licenses/license.txt", "model.png"]);

        let error = content_files(folder.path(), &[]).unwrap_err().to_string();
        assert!(error.contains("own.json") && error.contains("documentation"), "{error}");
    }
}
