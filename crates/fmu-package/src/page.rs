//! Compiles the model for the page that runs it in a browser.

use crate::c_sources::{LINKING, WEBASSEMBLY};
use crate::cargo::LibraryBuild;
use crate::content::ContentFile;
use crate::cross::has_std;
use crate::library::{stamp, with_stamp};
use crate::pack::with_guid_of;
use crate::packages::directory_of;
use crate::page_html::{PAGE, Runnable, page};
use crate::sources::DESCRIPTION;
use crate::table::Info;
use anyhow::{Context, Result};
use std::fs;
use std::path::Path;

/// The page of an FMU, and additions to its part that runs the FMU in a browser. Without additions, that part has plots and
/// sliders, but not a view of the model.
///
/// ```
/// # use fmu_package::{Builder, Page};
/// let builder = Builder {
///     page: Page { scripts: vec!["addOns.my_model = (own) => ({ ...plain(own) });"], ..Page::default() },
///     ..Builder::new("my_model", "directory/of/my_model")
/// };
/// ```
///
/// The README in the directory `page` of this crate describes the scripts.
#[derive(Clone, Debug, Default)]
pub struct Page {
    /// Writes `documentation/index.html` from the model description for FMI 2.0, if the page has tables of the variables or is put
    /// together from several files. By default, the page is the file of this name among the content, if there is one.
    pub html: Option<fn(&str) -> Result<String>>,
    /// Scripts that run after the scripts that every page has. One of them registers an add-on under the model's identifier.
    pub scripts: Vec<&'static str>,
    /// Packages in the same workspace whose FMUs the page contains, so that these scripts can run them together with the model, for
    /// example the plant in the page of a controller. The page uses the model descriptions that are kept with their sources.
    pub companions: Vec<&'static str>,
}

/// The model and its companions, compiled for a page.
pub(crate) struct CompiledPage<'a> {
    page: &'a Page,
    model: Runnable,
    companions: Vec<Runnable>,
}

impl Page {
    /// Returns the page without the part that runs the FMU: `html`, or the page among the content.
    pub(crate) fn written(&self, description: &str, content: &[ContentFile]) -> Result<Option<String>> {
        match (self.html, content.iter().find(|file| file.name == PAGE)) {
            (Some(html), _) => html(description).map(Some),
            (None, Some(ContentFile { path, .. })) => {
                fs::read_to_string(path).map(Some).with_context(|| format!("cannot read {}", path.display()))
            }
            (None, None) => Ok(None),
        }
    }

    /// Compiles the model and its companions for WebAssembly. If the model cannot be compiled for WebAssembly, prints a note and returns
    /// `None`.
    pub(crate) fn compile(
        &self,
        build: &LibraryBuild,
        description: String,
    ) -> Result<Option<CompiledPage<'_>>> {
        if !has_std(WEBASSEMBLY) {
            eprintln!("note: no page runs the FMU in a browser; that needs: rustup target add {WEBASSEMBLY}");
            return Ok(None);
        }
        let build = LibraryBuild { target: Some(WEBASSEMBLY), arguments: &LINKING, ..build.clone() };
        let path = match build.run() {
            Ok(path) => path,
            Err(error) => {
                eprintln!("note: no page runs the FMU in a browser (--no-page does not try that): {error:#}");
                return Ok(None);
            }
        };
        let model = runnable(description, &path)?;
        let companions = self.companions.iter().map(|package| {
            let directory = directory_of(package)?;
            let kept = directory.join(DESCRIPTION);
            let kept =
                fs::read_to_string(&kept).with_context(|| format!("cannot read {}", kept.display()))?;
            runnable(kept, &LibraryBuild { directory, package, ..build.clone() }.run()?)
        });
        let companions = companions.collect::<Result<_>>()?;
        Ok(Some(CompiledPage { page: self, model, companions }))
    }
}

impl CompiledPage<'_> {
    /// Returns the page for an FMU with this guid and these start values. Companions keep the guid of their descriptions.
    /// `written` is the page without the part that runs the FMU.
    pub fn html(
        &self,
        written: Option<&str>,
        guid: &str,
        starts: &[(u32, f64)],
        info: &Info,
        content: &[ContentFile],
    ) -> Result<Vec<u8>> {
        let Runnable { description, module } = &self.model;
        let model = Runnable {
            description: with_guid_of(description, guid),
            module: with_stamp(module, guid, Some(starts))?,
        };
        let runnables: Vec<_> = std::iter::once(model).chain(self.companions.iter().cloned()).collect();
        page(written, content, (&info.name, &info.description), &runnables, &self.page.scripts)
    }
}

fn runnable(description: String, path: &Path) -> Result<Runnable> {
    let module = fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    stamp(&module).with_context(|| path.display().to_string())?;
    Ok(Runnable { description, module })
}
