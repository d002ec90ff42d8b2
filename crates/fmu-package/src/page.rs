//! Compiles the model for the page that runs it in a browser.

use crate::c_sources::{LINKING, WEBASSEMBLY};
use crate::cargo::{LibraryBuild, PROFILE};
use crate::content::ContentFile;
use crate::cross::has_std;
use crate::library::check_guid;
use crate::page_html::{Runnable, with_page};
use crate::sources::{DESCRIPTION, Sources};
use crate::table::Info;
use crate::variant::{NO_GUID, Variant};
use anyhow::{Context, Result};
use std::fs;
use std::path::PathBuf;
use tempfile::TempDir;

/// Additions to the page that runs an FMU in a browser. Without them, the page has plots and sliders, but not a view of the model.
///
/// ```
/// # use fmu_package::{Builder, Page};
/// let builder = Builder {
///     page: Page { scripts: vec!["addOns.my_model = (own) => ({ ...plain(own) });"], ..Page::default() },
///     ..Builder::new(env!("CARGO_PKG_NAME"), env!("CARGO_MANIFEST_DIR"))
/// };
/// ```
///
/// The README in the directory `page` of this crate describes the scripts.
#[derive(Clone, Debug, Default)]
pub struct Page {
    /// Scripts that run after the scripts that every page has. One of them registers an add-on under the model's identifier.
    pub scripts: Vec<&'static str>,
    /// Other FMUs that the page contains, so that these scripts can run them together with the model.
    pub companions: Vec<Companion>,
}

/// An FMU in the page of another FMU, for example the plant in the page of a controller.
#[derive(Clone, Debug)]
pub struct Companion {
    /// The package of its model, which is in the same workspace.
    pub package: &'static str,
    /// The files that it is made from. The page uses the model description that is kept with them.
    pub sources: Sources,
}

impl Page {
    /// Compiles the model and its companions for WebAssembly. Returns the content with the page, and the temporary directory of the
    /// page. If the model cannot be compiled for WebAssembly, prints a note and returns `None`.
    pub(crate) fn with_model(
        &self,
        build: &LibraryBuild,
        guid: &str,
        info: &Info,
        description: String,
        content: &[ContentFile],
    ) -> Result<Option<(TempDir, Vec<ContentFile>)>> {
        if !has_std(WEBASSEMBLY) {
            eprintln!("note: no page runs the FMU in a browser; that needs: rustup target add {WEBASSEMBLY}");
            return Ok(None);
        }
        let mut build = LibraryBuild { target: Some(WEBASSEMBLY), arguments: &LINKING, ..build.clone() };
        build.settings.push(format!("profile.{PROFILE}.opt-level=\"z\""));
        let path = match build.run() {
            Ok(path) => path,
            Err(error) => {
                eprintln!("note: no page runs the FMU in a browser (--no-page does not try that): {error:#}");
                return Ok(None);
            }
        };
        let mut runnables = vec![runnable(description, path, guid)?];
        for companion in &self.companions {
            runnables.push(companion.runnable(&build)?);
        }
        with_page(content, (&info.name, &info.description), &runnables, &self.scripts).map(Some)
    }
}

impl Companion {
    /// Compiles the library of the companion with the settings of the model's library.
    fn runnable(&self, build: &LibraryBuild) -> Result<Runnable> {
        let Self { package, sources } = self;
        let guid = Variant { sources: sources.fingerprint()?, start: Vec::new(), tunable: false }.guid();
        let kept = sources.directory.join(DESCRIPTION);
        let kept = fs::read_to_string(&kept).with_context(|| format!("cannot read {}", kept.display()))?;
        let build = LibraryBuild {
            directory: sources.directory.clone(),
            package,
            environment: vec![("FMU_GUID", Some(guid.clone().into()))],
            ..build.clone()
        };
        runnable(kept.replace(NO_GUID, &guid), build.run()?, &guid)
    }
}

/// Reads a module, and checks that it was compiled with this guid.
fn runnable(description: String, path: PathBuf, guid: &str) -> Result<Runnable> {
    let module = fs::read(&path).with_context(|| format!("cannot read {}", path.display()))?;
    check_guid(&module, guid, &path)?;
    Ok(Runnable { description, module })
}
