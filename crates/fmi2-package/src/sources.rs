//! What an FMU is made from, as files: hashed for its guid, watched by the build script, packed.

use crate::content::{ContentFile, content_files};
use crate::fingerprint::Fingerprint;
use anyhow::{Context, Result};
use std::fs;
use std::path::{Path, PathBuf};
use walkdir::WalkDir;

/// The files that an FMU follows from. Besides these, the `Cargo.lock` in force always counts.
#[derive(Clone, Debug)]
pub struct Sources {
    /// The folder of the model's `Cargo.toml`, to which the other paths are relative.
    pub folder: PathBuf,
    /// Files, and folders of which all Rust files count. Crates that are used by path belong here.
    pub code: Vec<&'static str>,
    /// The folder of what goes into the FMU as it is, see [`content_files`].
    pub content: Option<&'static str>,
    /// What is in that folder for other reasons.
    pub not_content: Vec<&'static str>,
    /// Files elsewhere that go into the FMU's `documentation/licenses`.
    pub licenses: Vec<&'static str>,
}

impl Sources {
    /// Of a package in the usual layout: `Cargo.toml`, `build.rs`, `build_fmu.rs`, `src`, and the folder
    /// `modelDescription` if there is one.
    pub fn of_package(folder: impl Into<PathBuf>) -> Self {
        let folder = folder.into();
        Self {
            content: folder.join("modelDescription").is_dir().then_some("modelDescription"),
            folder,
            code: vec!["Cargo.toml", "build.rs", "build_fmu.rs", "src"],
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
    /// When a file cannot be read.
    pub fn fingerprint(&self) -> Result<String> {
        let mut fingerprint = Fingerprint::new();
        let mut add = |name: &str, path: &Path| {
            let bytes = fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
            fingerprint.add(name, &bytes);
            anyhow::Ok(())
        };
        if let Some(lock) = self.lock() {
            add("Cargo.lock", &lock)?;
        }
        for source in &self.code {
            let path = self.folder.join(source);
            if !path.is_dir() {
                add(source, &path)?;
                continue;
            }
            for entry in WalkDir::new(&path).sort_by_file_name() {
                let entry = entry.with_context(|| format!("cannot read {}", path.display()))?;
                if entry.file_type().is_file() && entry.path().extension().is_some_and(|e| e == "rs") {
                    // The same name on every system.
                    let inside = entry.path().strip_prefix(&path)?.iter();
                    let inside: Vec<_> = inside.map(|part| part.to_string_lossy()).collect();
                    add(&format!("{source}/{}", inside.join("/")), entry.path())?;
                }
            }
        }
        for file in self.content_files()? {
            add(&file.name, &file.path)?;
        }
        Ok(fingerprint.guid())
    }

    /// What a build script must watch to run again whenever the hash changes.
    ///
    /// # Errors
    /// When the folder of the content cannot be read.
    pub fn watched(&self) -> Result<Vec<PathBuf>> {
        let listed = self.code.iter().chain(&self.licenses).map(|name| self.folder.join(name));
        let mut paths: Vec<PathBuf> = self.lock().into_iter().chain(listed).collect();
        if let Some(content) = self.content {
            let folder = self.folder.join(content);
            for entry in fs::read_dir(&folder).with_context(|| format!("cannot read {}", folder.display()))? {
                let entry = entry?;
                if !self.not_content.iter().any(|name| entry.file_name() == *name) {
                    paths.push(entry.path());
                }
            }
        }
        paths.sort();
        Ok(paths)
    }

    /// The `Cargo.lock` of the package or of the workspace around it.
    fn lock(&self) -> Option<PathBuf> {
        self.folder.ancestors().map(|folder| folder.join("Cargo.lock")).find(|lock| lock.is_file())
    }
}
