//! A model with its functions, which are in a shared library or in this program.
#![allow(unsafe_code, reason = "C functions of a library are found by their names")]

use crate::call_monitor::CallMonitor;
use crate::table::Table;
use anyhow::{Context, Result, ensure};
use fmi_abi::c_types::{c_char, c_void};
use fmi_abi::calls::{Functions, Library};
use fmi_abi::{BaseType, Standard, Value, fmi2, fmi3};
use std::ffi::{CStr, CString};
use std::path::Path;
use std::ptr::null;
use std::sync::{Arc, OnceLock};
use std::time::Duration;

/// The function of a library that describes its model; `fmu-export` declares it.
const DESCRIPTION: &str = "fmu_export_describe";
/// The function of a library that reports panics with their source locations.
const PANICS: &str = "fmu_export_report_panics";
type ReportPanics = unsafe extern "C" fn(receive: Receive, context: *mut c_void);
type Describe = unsafe extern "C" fn(resources: *const c_char, receive: Receive, context: *mut c_void);
type Receive = unsafe extern "C" fn(context: *mut c_void, text: *const u8, length: usize);

/// A model that describes itself, and its functions for both FMI versions.
#[derive(Debug)]
pub struct LoadedModel {
    pub(crate) table: Table,
    /// The functions of FMI 2.0 and FMI 3.0.
    functions: [Arc<Library>; 2],
    /// The variables, grouped by type.
    pub(crate) groups: Vec<Group>,
    /// The start values by index of the variable, once the model has been checked.
    pub(crate) starts: OnceLock<Vec<Option<Value>>>,
    /// The directory with the files that the model reads.
    resources: Option<CString>,
    pub(crate) monitor: Arc<CallMonitor>,
}

/// The variables of a type.
#[derive(Debug)]
pub(crate) struct Group {
    pub base: BaseType,
    pub indices: Vec<u32>,
}

impl LoadedModel {
    /// Creates a model from functions in this program and the result of `fmu_export::describe`.
    ///
    /// # Safety
    /// The functions belong to the model that is described.
    ///
    /// # Errors
    /// When the description cannot be read.
    pub unsafe fn new(description: &str, fmi2: fmi2::Functions, fmi3: fmi3::Functions) -> Result<Self> {
        let functions = [Functions::Fmi2(Box::new(fmi2)), Functions::Fmi3(Box::new(fmi3))];
        // SAFETY: functions in this program stay loaded.
        let functions = functions.map(|functions| unsafe { Library::of(functions) });
        // SAFETY: the caller guarantees it.
        unsafe { Self::with(description, functions, None, Arc::default()) }
    }

    /// Loads the model of a shared library for this machine. The model may read the files in the directory `resources`,
    /// if it exists.
    ///
    /// # Safety
    /// The file is the library of an FMU that was made with `fmu-export`, or not a library. It is sound to load the library and to
    /// call its functions.
    ///
    /// # Errors
    /// When the library cannot be loaded, or does not describe itself.
    pub unsafe fn load(path: &Path, resources: Option<&Path>) -> Result<Self> {
        // SAFETY: the caller guarantees it.
        unsafe { Self::load_within(path, resources, None) }
    }

    /// Does the same as [`load`](Self::load), and ends this process if a call of the model takes longer than the limit.
    ///
    /// # Safety
    /// The requirements of [`load`](Self::load).
    ///
    /// # Errors
    /// The errors of [`load`](Self::load), and if the model panics while it describes itself.
    pub(crate) unsafe fn load_within(
        path: &Path,
        resources: Option<&Path>,
        limit: Option<Duration>,
    ) -> Result<Self> {
        let monitor = Arc::<CallMonitor>::default();
        if let Some(limit) = limit {
            monitor.watch(path.display().to_string(), limit);
        }
        let path_of = || path.display().to_string();
        // SAFETY: the caller guarantees it, here and below.
        let load = |standard| unsafe { Library::load(path, standard) }.with_context(path_of);
        let libraries = [load(Standard::Fmi2)?, load(Standard::Fmi3)?];
        let [library, _] = &libraries;
        let resources = resources.and_then(|path| path.canonicalize().ok());
        let resources = resources
            .map(|path| CString::new(path.to_string_lossy().into_owned()))
            .transpose()
            .with_context(path_of)?;
        let mut description = Vec::new();
        // SAFETY: the FMI functions have the types of the standard, and `describe` has the type that fmu-export declares;
        // `keep` receives a pointer to a vector, which exists during the call; `directory` is a string or NULL.
        unsafe {
            let mut names = fmi2::Functions::NAMES.iter().chain(fmi3::Functions::NAMES);
            ensure!(
                names.all(|name| library.find(name).is_ok()),
                "{} has no functions of FMI; its crate needs `export_fmu!(...)` in src/lib.rs (`offer!` makes none)",
                path.display()
            );
            let describe = library.function::<Describe>(DESCRIPTION).with_context(|| {
                format!(
                    "{} does not describe itself: its fmu-export is older than fmu-package {}; use the same version of both",
                    path.display(),
                    env!("CARGO_PKG_VERSION")
                )
            })?;
            if let Ok(report_panics) = library.function::<ReportPanics>(PANICS) {
                // The library may report a panic at any time, so this value is never freed.
                let context = Arc::into_raw(Arc::clone(&monitor)).cast_mut().cast();
                report_panics(CallMonitor::receive, context);
            }
            let directory = resources.as_ref().map_or(null(), |path| path.as_ptr());
            let call = "its description (new, start values, indicators)";
            monitor.begin(call);
            describe(directory, keep, (&raw mut description).cast());
            monitor.end();
            monitor.check()?;
        }
        let description = std::str::from_utf8(&description)?;
        // SAFETY: the functions belong to the library, and so does the description.
        unsafe { Self::with(description, libraries, resources, monitor) }.with_context(path_of)
    }

    /// # Safety
    /// The functions belong to the model that is described.
    unsafe fn with(
        description: &str,
        libraries: [Library; 2],
        resources: Option<CString>,
        monitor: Arc<CallMonitor>,
    ) -> Result<Self> {
        let table = Table::read(description)?;
        let group = |base| Group { base, indices: table.find(|variable| variable.base == base) };
        let groups = BaseType::ALL.into_iter().map(group).filter(|group| !group.indices.is_empty()).collect();
        Ok(Self {
            table,
            functions: libraries.map(Arc::new),
            groups,
            starts: OnceLock::new(),
            resources,
            monitor,
        })
    }

    /// Returns the directory of resources, if there is one.
    pub(crate) fn resources(&self) -> Option<&CStr> {
        self.resources.as_deref()
    }

    /// Returns the functions of an FMI version.
    pub(crate) fn functions(&self, standard: Standard) -> &Arc<Library> {
        &self.functions[standard as usize]
    }

    /// The `modelIdentifier`.
    pub fn identifier(&self) -> &str {
        &self.table.info.identifier
    }

    /// The guid in the stamp of the library.
    pub(crate) fn guid(&self) -> &str {
        &self.table.info.guid
    }
}

/// # Safety
/// The context is the vector in [`LoadedModel::load`], and the text has this length.
unsafe extern "C" fn keep(context: *mut c_void, text: *const u8, length: usize) {
    // SAFETY: the caller guarantees it.
    let (description, text) =
        unsafe { (&mut *context.cast::<Vec<u8>>(), std::slice::from_raw_parts(text, length)) };
    description.extend_from_slice(text);
}
