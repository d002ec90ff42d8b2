//! Files for a model in WebAssembly, which has no file system. The page around the module stores them. An FMU with C
//! sources has no such files.

#![cfg(target_family = "wasm")]

use std::cell::RefCell;
use std::io;
use std::path::{Path, PathBuf};

thread_local! {
    static FILES: RefCell<Vec<(PathBuf, Vec<u8>)>> = const { RefCell::new(Vec::new()) };
}

/// Stores a file for [`read`].
pub(crate) fn store(path: PathBuf, content: Vec<u8>) {
    FILES.with_borrow_mut(|files| files.push((path, content)));
}

/// Returns the content of a file. Fails with `Unsupported` if no file was stored at all, and with `NotFound` if only
/// this file was not stored.
pub(crate) fn read(path: &Path) -> io::Result<Vec<u8>> {
    FILES.with_borrow(|files| match files.iter().find(|(name, _)| name == path) {
        Some((_, content)) => Ok(content.clone()),
        None if files.is_empty() => Err(io::ErrorKind::Unsupported.into()),
        None => Err(io::ErrorKind::NotFound.into()),
    })
}
