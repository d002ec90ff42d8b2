//! Makes the page, and compiles the model for the part of it that runs the FMU in a browser.

use super::Plan;
use super::check::Checked;
use super::describe::Described;
use crate::c_sources::{LINKING, WEBASSEMBLY, c_sources};
use crate::cargo::{LibraryBuild, PROFILE};
use crate::content::ContentFile;
use crate::cross::has_std;
use crate::library::{stamp, with_stamp};
use crate::pack::{Files, with_guid_of};
use crate::packages::directory_of;
use crate::page_html::{self, PAGE, Runnable};
use crate::sources::DESCRIPTION;
use crate::table::Info;
use anyhow::{Context, Result};
use std::fs;
use std::path::Path;

/// Returns a page for the FMU with this model description.
type Write = fn(&str) -> Result<String>;

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
    pub html: Option<Write>,
    /// Writes other pages, such as `manual.html`, in the same way. They do not run the FMU.
    pub others: Vec<(&'static str, Write)>,
    /// Scripts that run after the scripts that every page has. One of them registers an add-on under the model's identifier.
    pub scripts: Vec<&'static str>,
    /// Packages in the same workspace whose FMUs the page contains, so that these scripts can run them together with the model, for
    /// example the plant in the page of a controller. The page uses the model descriptions that are kept with their sources.
    pub companions: Vec<&'static str>,
}

/// A model with its page.
pub(crate) struct Paged<'a> {
    pub described: Described,
    /// The page without the part that runs the FMU.
    written: Option<String>,
    others: Files,
    compiled: Option<CompiledPage<'a>>,
}

/// Makes the page: the part that the author has written, and the model for the part that runs it.
///
/// # Errors
/// When the page cannot be read or made, or a companion cannot be compiled.
pub(crate) fn page<'a>(plan: &Plan<'a>, Checked(described): Checked) -> Result<Paged<'a>> {
    let page = &plan.builder.page;
    // The page runs the FMU for FMI 2.0.
    let description = described.fmi2.as_ref().unwrap_or(&described.descriptions[0].1);
    let written = page.written(description, &plan.content)?;
    let others = page.written_others(description)?;
    let compiled = match &described.fmi2 {
        Some(description) if plan.with_page => page.compile(&plan.build(), description.clone())?,
        _ => None,
    };
    Ok(Paged { written, others, compiled, described })
}

impl Paged<'_> {
    /// Returns the files of the FMU that contain its guid, besides the description and the libraries: the page, and C sources.
    ///
    /// # Errors
    /// When the page or the C sources cannot be made.
    pub fn with_guid(&self, plan: &Plan, guid: &str) -> Result<Files> {
        let compiled = &self.described.compiled;
        let (model, starts) = (&compiled.model, &compiled.starts[..]);
        let mut files = match (&plan.wasm2c, &compiled.module) {
            (Some(wasm2c), Some(module)) => {
                c_sources(wasm2c, &with_stamp(module, guid, Some(starts))?, model.identifier())?
            }
            _ => Files::new(),
        };
        files.iter_mut().for_each(|(name, _)| name.insert_str(0, "sources/"));
        let html = match &self.compiled {
            Some(page) => {
                Some(page.html(self.written.as_deref(), guid, starts, &model.table.info, &plan.content)?)
            }
            None => self.written.clone().map(String::into_bytes),
        };
        files.extend(html.map(|html| (PAGE.to_owned(), html)));
        files.extend(self.others.iter().cloned());
        Ok(files)
    }
}

/// The model and its companions, compiled for a page.
struct CompiledPage<'a> {
    page: &'a Page,
    model: Runnable,
    companions: Vec<Runnable>,
}

impl Page {
    /// Returns the page without the part that runs the FMU: `html`, or the page among the content.
    fn written(&self, description: &str, content: &[ContentFile]) -> Result<Option<String>> {
        match (self.html, content.iter().find(|file| file.name == PAGE)) {
            (Some(html), _) => html(description).map(Some),
            (None, Some(ContentFile { path, .. })) => {
                fs::read_to_string(path).map(Some).with_context(|| format!("cannot read {}", path.display()))
            }
            (None, None) => Ok(None),
        }
    }

    /// Returns the other pages: their names in the FMU, and their contents.
    fn written_others(&self, description: &str) -> Result<Files> {
        let write = |(name, html): &(&str, Write)| {
            Ok((format!("documentation/{name}"), html(description)?.into_bytes()))
        };
        self.others.iter().map(write).collect()
    }

    /// Compiles the model and its companions for WebAssembly. If the model cannot be compiled for WebAssembly, prints a note and returns
    /// `None`.
    fn compile(&self, build: &LibraryBuild, description: String) -> Result<Option<CompiledPage<'_>>> {
        if !has_std(WEBASSEMBLY) {
            eprintln!("note: no page runs the FMU in a browser; that needs: rustup target add {WEBASSEMBLY}");
            return Ok(None);
        }
        // A module for the page should be small; the module for C sources is fast.
        let small = format!("profile.{PROFILE}.opt-level=\"s\"");
        let settings = [&[small], &build.settings[..]].concat();
        let build =
            LibraryBuild { target: Some(WEBASSEMBLY), arguments: &LINKING, settings, ..build.clone() };
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
    fn html(
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
        page_html::page(
            written,
            content,
            (&info.name, &info.about.description),
            &runnables,
            &self.page.scripts,
        )
    }
}

fn runnable(description: String, path: &Path) -> Result<Runnable> {
    let module = fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    stamp(&module).with_context(|| path.display().to_string())?;
    Ok(Runnable { description, module })
}
