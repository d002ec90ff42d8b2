//! The shared library of an FMU. The files of the FMU are not removed while the library is loaded.

use crate::files::Files;
use fmi_abi::Standard;
use std::ffi::CString;
use std::path::Path;
use std::sync::Arc;

/// A loaded library and the files of its FMU.
#[derive(Debug)]
pub(crate) struct Library {
    pub client: Arc<fmi_abi::client::Library>,
    /// Location of the resources, as it is passed to the FMU; `None` for NULL.
    pub resources: Option<CString>,
    // Last field, so that the files are removed after the library is unloaded.
    _files: Arc<Files>,
}

impl Library {
    /// Loads a library.
    ///
    /// # Safety
    /// The requirement of [`fmi_abi::client::load`].
    pub unsafe fn load(
        path: &Path,
        standard: Standard,
        resources: Option<CString>,
        files: Arc<Files>,
    ) -> Result<Self, impl std::error::Error> {
        // SAFETY: the caller guarantees that loading is sound.
        let client = unsafe { fmi_abi::client::load(path, standard) };
        client.map(|client| Self { client: Arc::new(client), resources, _files: files })
    }
}
