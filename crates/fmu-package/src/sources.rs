//! The files that an FMU is made from. They are hashed for its guid.

use crate::content::{ContentFile, content_files};
use crate::directory::files;
use crate::fingerprint::Fingerprint;
use crate::packages::{LocalPackage, Neighbourhood};
use anyhow::{Context, Result};
use std::fs;
use std::path::{Path, PathBuf};

/// The description of the default FMU, which is kept with the sources.
pub(crate) const DESCRIPTION: &str = "modelDescription/modelDescription.xml";

/// The files that an FMU is made from.
///
/// The guid depends on the files that are named here, and always on the `Cargo.lock` in use and on the `Cargo.toml` of the workspace.
/// From each package that is used by path, directly or indirectly, it depends on the `Cargo.toml`, the build script and the directory
/// of the library's sources.
///
/// The guid does not depend on the compiler, the target and the profile, on environment variables such as compiler flags, on packages
/// that `[patch]` replaces, or on files that code includes from other directories. So if another file changes the library, name it
/// here; if a value does, add it to [`Variant::start`](crate::Variant::start).
#[derive(Clone, Debug)]
pub struct Sources {
    /// The directory of the model's `Cargo.toml`, to which the other paths are relative.
    pub directory: PathBuf,
    /// Files and directories that the guid depends on. Hidden files in the directories are ignored.
    pub code: Vec<&'static str>,
    /// The directory of the files that the FMU contains unchanged, see [`content_files`].
    pub content: Option<&'static str>,
    /// Entries of that directory that are not put into the FMU.
    pub not_content: Vec<&'static str>,
    /// Files that the FMU contains in `documentation/licenses`.
    pub licenses: Vec<&'static str>,
}

impl Sources {
    /// The sources of a package in the usual layout: `Cargo.toml`, `src`, and `build.rs`, `build_fmu.rs` and the directory
    /// `modelDescription` if they exist.
    pub fn of_package(directory: impl Into<PathBuf>) -> Self {
        let directory = directory.into();
        let code = ["Cargo.toml", "build.rs", "build_fmu.rs", "src"];
        Self {
            content: directory.join("modelDescription").is_dir().then_some("modelDescription"),
            code: code.into_iter().filter(|name| directory.join(name).exists()).collect(),
            directory,
            not_content: vec!["modelDescription.xml"],
            licenses: Vec::new(),
        }
    }

    /// Returns the files that the FMU contains unchanged.
    ///
    /// # Errors
    /// When a file cannot be in an FMU or cannot be found.
    pub fn content_files(&self) -> Result<Vec<ContentFile>> {
        let mut files = match self.content {
            Some(content) => content_files(&self.directory.join(content), &self.not_content)?,
            None => Vec::new(),
        };
        for license in &self.licenses {
            let name = license.rsplit('/').next().unwrap_or(license);
            let name = format!("documentation/licenses/{name}");
            files.push(ContentFile { name, path: self.directory.join(license) });
        }
        Ok(files)
    }

    /// Returns a hash of all files that the guid depends on.
    ///
    /// # Errors
    /// When a file cannot be read, or cargo does not return the packages that are used.
    pub fn fingerprint(&self) -> Result<String> {
        let mut fingerprint = Fingerprint::new();
        let mut add = |name: &str, path: &Path| {
            let bytes = fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
            fingerprint.add(name, &bytes);
            anyhow::Ok(())
        };
        for (name, path) in self.compiled()? {
            for (inside, path) in files(&path)? {
                add(&format!("{name}{inside}"), &path)?;
            }
        }
        for file in self.content_files()? {
            add(&file.name, &file.path)?;
        }
        Ok(fingerprint.guid())
    }

    /// Returns the files and directories that the library is compiled from, each with a name that does not depend on its location.
    fn compiled(&self) -> Result<Vec<(String, PathBuf)>> {
        let mut paths: Vec<(String, PathBuf)> = Vec::new();
        paths.extend(self.lock().map(|lock| ("Cargo.lock".to_owned(), lock)));
        paths.extend(self.code.iter().map(|&name| (name.to_owned(), self.directory.join(name))));
        let Neighbourhood { workspace, used } = Neighbourhood::of(&self.directory)?;
        if workspace != self.directory {
            paths.push(("workspace/Cargo.toml".to_owned(), workspace.join("Cargo.toml")));
        }
        for LocalPackage { name, directory, code, .. } in used {
            paths.push((format!("{name}/Cargo.toml"), directory.join("Cargo.toml")));
            let code = code.into_iter().enumerate();
            paths.extend(code.map(|(number, path)| (format!("{name}/{number}"), path)));
        }
        Ok(paths)
    }

    /// Returns the `Cargo.lock` of the package or of its workspace.
    fn lock(&self) -> Option<PathBuf> {
        self.directory.ancestors().map(|directory| directory.join("Cargo.lock")).find(|lock| lock.is_file())
    }
}
