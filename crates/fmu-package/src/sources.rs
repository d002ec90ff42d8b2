//! The files that an FMU is made from: hashed for its guid, packed.

use crate::content::{ContentFile, content_files};
use crate::fingerprint::Fingerprint;
use crate::folder::files;
use crate::packages::{LocalPackage, Neighbourhood};
use anyhow::{Context, Result};
use std::fs;
use std::path::{Path, PathBuf};

/// The files that an FMU follows from.
///
/// Besides the files that are named here, these always count: the `Cargo.lock` in force, the `Cargo.toml` of the
/// workspace, and the packages that are used by path, directly or through each other, each with its
/// `Cargo.toml`, its build script and the folder of its library's sources.
///
/// What does not count: the compiler, the target and the profile; flags and other variables of the environment;
/// what `[patch]` puts in the place of a package; files that code includes from elsewhere. What of this makes
/// a difference must be named here, or be in [`Variant::start`](crate::Variant::start).
#[derive(Clone, Debug)]
pub struct Sources {
    /// The folder of the model's `Cargo.toml`, to which the other paths are relative.
    pub folder: PathBuf,
    /// Files, and folders of which all files count but hidden ones.
    pub code: Vec<&'static str>,
    /// The folder of what goes into the FMU as it is, see [`content_files`].
    pub content: Option<&'static str>,
    /// What is in that folder for other reasons.
    pub not_content: Vec<&'static str>,
    /// Files elsewhere that go into the FMU's `documentation/licenses`.
    pub licenses: Vec<&'static str>,
}

impl Sources {
    /// Of a package in the usual layout: `Cargo.toml`, `src`, and `build.rs`, `build_fmu.rs` and the folder
    /// `modelDescription` where there are such.
    pub fn of_package(folder: impl Into<PathBuf>) -> Self {
        let folder = folder.into();
        let code = ["Cargo.toml", "build.rs", "build_fmu.rs", "src"];
        Self {
            content: folder.join("modelDescription").is_dir().then_some("modelDescription"),
            code: code.into_iter().filter(|name| folder.join(name).exists()).collect(),
            folder,
            not_content: vec!["modelDescription.xml"],
            licenses: Vec::new(),
        }
    }

    /// The files that go into the FMU as they are.
    ///
    /// # Errors
    /// When a file has no place in an FMU or cannot be found.
    pub fn content_files(&self) -> Result<Vec<ContentFile>> {
        let mut files = match self.content {
            Some(content) => content_files(&self.folder.join(content), &self.not_content)?,
            None => Vec::new(),
        };
        for license in &self.licenses {
            let name = license.rsplit('/').next().unwrap_or(license);
            let name = format!("documentation/licenses/{name}");
            files.push(ContentFile { name, path: self.folder.join(license) });
        }
        Ok(files)
    }

    /// A hash of all of it.
    ///
    /// # Errors
    /// When a file cannot be read, or cargo does not say what the package is made of.
    pub fn fingerprint(&self) -> Result<String> {
        let mut fingerprint = Fingerprint::new();
        let mut add = |name: &str, path: &Path| {
            let bytes = fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
            fingerprint.add(name, &bytes);
            anyhow::Ok(())
        };
        for (name, place) in self.compiled()? {
            for (inside, path) in files(&place)? {
                add(&format!("{name}{inside}"), &path)?;
            }
        }
        for file in self.content_files()? {
            add(&file.name, &file.path)?;
        }
        Ok(fingerprint.guid())
    }

    /// What the library is compiled from: files, and folders of which all files count but hidden ones. Each with
    /// a name that says nothing of where it is.
    fn compiled(&self) -> Result<Vec<(String, PathBuf)>> {
        let mut places: Vec<(String, PathBuf)> = Vec::new();
        places.extend(self.lock().map(|lock| ("Cargo.lock".to_owned(), lock)));
        places.extend(self.code.iter().map(|&name| (name.to_owned(), self.folder.join(name))));
        let Neighbourhood { workspace, used } = Neighbourhood::of(&self.folder)?;
        if workspace != self.folder {
            places.push(("workspace/Cargo.toml".to_owned(), workspace.join("Cargo.toml")));
        }
        for LocalPackage { name, folder, code, .. } in used {
            places.push((format!("{name}/Cargo.toml"), folder.join("Cargo.toml")));
            let code = code.into_iter().enumerate();
            places.extend(code.map(|(place, path)| (format!("{name}/{place}"), path)));
        }
        Ok(places)
    }

    /// The `Cargo.lock` of the package or of the workspace around it.
    fn lock(&self) -> Option<PathBuf> {
        self.folder.ancestors().map(|folder| folder.join("Cargo.lock")).find(|lock| lock.is_file())
    }
}
