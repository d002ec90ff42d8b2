//! The files that an FMU contains unchanged, and where they are in the sources.

use crate::content::{ContentFile, content_files};
use anyhow::Result;
use std::path::PathBuf;

/// The description of the default FMU, which is kept with the sources.
pub(crate) const DESCRIPTION: &str = "modelDescription/modelDescription.xml";

/// The sources of an FMU: the package of its model, and the files that the FMU contains unchanged.
#[derive(Clone, Debug)]
pub struct Sources {
    /// The directory of the model's `Cargo.toml`, to which the other paths are relative.
    pub directory: PathBuf,
    /// The directory of the files that the FMU contains unchanged, see [`content_files`].
    pub content: Option<&'static str>,
    /// Entries of that directory that are not put into the FMU.
    pub not_content: Vec<&'static str>,
    /// Files that the FMU contains in `documentation/licenses`.
    pub licenses: Vec<&'static str>,
}

impl Sources {
    /// The sources of a package in the usual layout, with the directory `modelDescription` if it exists.
    pub fn of_package(directory: impl Into<PathBuf>) -> Self {
        let directory = directory.into();
        Self {
            content: directory.join("modelDescription").is_dir().then_some("modelDescription"),
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
}
