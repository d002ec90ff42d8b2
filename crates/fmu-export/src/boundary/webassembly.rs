//! Functions for the code around a WebAssembly module. This code is the C code of an FMU with C sources, or the scripts
//! of a page. In WebAssembly, a panic does not unwind, and the library cannot access the importer's memory and
//! callbacks, so the code around the module must handle panics, arguments and log messages. Each instance has a
//! separate module with its own memory.

#![cfg(target_family = "wasm")]

use super::call::{Component, finish, panic_message};
use super::importer_log::log;
use super::string;
use crate::export::Exported;
use crate::log::Message;
use fmi_abi::Status;
use fmi_abi::c_types::{c_char, c_void};
use std::any::Any;
use std::cell::{Cell, RefCell};
use std::panic::PanicHookInfo;

thread_local! {
    static ARGUMENT_BUFFER: RefCell<Vec<u64>> = const { RefCell::new(Vec::new()) };
    static PANIC: Cell<Option<String>> = const { Cell::new(None) };
}

/// Stores a file, which the model can then read; see [`read_resource`](crate::read_resource).
///
/// # Safety
/// `path` is NULL or a NUL-terminated string, and `content` points to `size` bytes.
pub unsafe fn add_file(path: *const c_char, content: *const c_void, size: usize) {
    // SAFETY: the caller guarantees the string and the bytes.
    let (path, content) = unsafe { (string(path), std::slice::from_raw_parts(content.cast::<u8>(), size)) };
    let path = path.unwrap_or_default().to_string_lossy().into_owned().into();
    crate::files::store(path, content.to_owned());
}

/// From now on, stores the message of a panic for [`broken`].
pub(super) fn keep_panics() {
    let keep = |panic: &PanicHookInfo| {
        PANIC.set(Some(panic_message(panic.payload()).to_owned()));
    };
    std::panic::set_hook(Box::new(keep));
}

/// Returns whether blocks of these sizes and another block for messages can be allocated at the same time. They are
/// allocated separately, because free memory may be fragmented: a new state must fit in the gaps that a freed state has
/// left.
pub(super) fn has_memory<const N: usize>(sizes: [usize; N]) -> bool {
    const MESSAGES: usize = 4096;
    let allocate = |size| {
        let mut block = Vec::<u8>::new();
        // Without black_box, the compiler might remove the unused allocation.
        block.try_reserve_exact(size).is_ok().then(|| std::hint::black_box(block))
    };
    let blocks = (sizes.map(allocate), allocate(MESSAGES));
    blocks.0.iter().all(Option::is_some) && blocks.1.is_some()
}

/// Allocates `size` bytes for the arguments of a call, and frees the bytes of the previous call. Returns NULL if
/// there is not enough memory.
pub fn argument_buffer(size: usize) -> *mut c_void {
    ARGUMENT_BUFFER.with_borrow_mut(|buffer| {
        *buffer = Vec::new();
        if !has_memory([size]) {
            return std::ptr::null_mut();
        }
        buffer.reserve_exact(size.div_ceil(size_of::<u64>()));
        buffer.as_mut_ptr().cast()
    })
}

/// Ends a call that trapped, because of a panic or for another `reason`, and returns its status. If `c` is NULL, the
/// call was `fmi2Instantiate`.
///
/// # Safety
/// `c` is NULL or a live component of this model; the other arguments are strings.
pub unsafe fn broken<M: Exported>(c: *mut c_void, function: *const c_char, reason: *const c_char) -> Status {
    // SAFETY: the caller guarantees strings.
    let [function, reason] =
        [function, reason].map(|pointer| unsafe { string(pointer) }.unwrap_or_default().to_string_lossy());
    let panic = PANIC.take().unwrap_or_else(|| reason.into_owned());
    // SAFETY: the caller guarantees that `c` is NULL or a live component.
    match unsafe { c.cast::<Component<M>>().as_ref() } {
        Some(component) => {
            component.gate.set_delivering(false);
            finish(component, &function, Err(Box::new(panic) as Box<dyn Any + Send>))
        }
        None => {
            let message = format!("{function}: internal failure ({panic})");
            log(&Message { status: Status::Error, message });
            Status::Error
        }
    }
}
