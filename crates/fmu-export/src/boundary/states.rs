//! Functions for saved states. A handle has the type of a pointer, but is never dereferenced, because the instance
//! looks up the state.
//!
//! # Safety
//! The importer guarantees the contract of [`fmi2`](crate::fmi2#safety) or [`fmi3`](crate::fmi3#safety).

use super::{in_slice, out_slice, out_value, reserve};
use crate::export::Exported;
use crate::instance::{Instance, Outcome, reject};
use fmi_abi::c_types::c_void;
use std::ptr::without_provenance_mut;

/// Saves the current state. If the handle is not NULL, overwrites the state of the handle. The instance owns the saved
/// state until the importer frees the state or the instance.
pub unsafe fn get_state<M: Exported>(instance: &mut Instance<M>, state: *mut *mut c_void) -> Outcome {
    // SAFETY: by contract, `state` is NULL or points to an initialized handle.
    let handle = unsafe { out_value(state, "FMUstate")?.assume_init_mut() };
    check_memory(instance, *handle, 0)?;
    *handle = without_provenance_mut(instance.save(handle.addr())?);
    Ok(())
}

pub unsafe fn set_state<M: Exported>(instance: &mut Instance<M>, state: *mut c_void) -> Outcome {
    instance.restore(state.addr())
}

/// Frees the state and sets the handle to NULL. Ignores a NULL pointer and a NULL handle.
pub unsafe fn free_state<M: Exported>(instance: &mut Instance<M>, state: *mut *mut c_void) -> Outcome {
    if state.is_null() {
        return Ok(());
    }
    // SAFETY: by contract, `state` points to an initialized handle.
    let handle = unsafe { out_value(state, "FMUstate")?.assume_init_mut() };
    if !handle.is_null() {
        let state = instance.remove(handle.addr())?;
        *handle = std::ptr::null_mut();
        drop(state);
    }
    Ok(())
}

pub unsafe fn serialized_size<M: Exported>(
    instance: &mut Instance<M>,
    state: *mut c_void,
    size: *mut usize,
) -> Outcome {
    // SAFETY: by contract, `size` is NULL or points to a size.
    let size = unsafe { out_value(size, "size")? };
    size.write(instance.serialized_size(state.addr())?);
    Ok(())
}

pub unsafe fn serialize<M: Exported, Byte>(
    instance: &mut Instance<M>,
    state: *mut c_void,
    bytes: *mut Byte,
    size: usize,
) -> Outcome {
    // SAFETY: by contract, `bytes` is NULL or points to an array of this length.
    let bytes = unsafe { out_slice(bytes.cast::<u8>(), size, "serializedState")? };
    let needed = instance.serialized_size(state.addr())?;
    if size != needed {
        return reject(format!(
            "the state needs {needed} bytes, the buffer has {size}; ask for its size first"
        ));
    }
    let mut written = Vec::new();
    reserve(&mut written, needed)?;
    written.resize(needed, 0);
    instance.serialize(state.addr(), &mut written)?;
    bytes.iter_mut().zip(written).for_each(|(byte, written)| {
        byte.write(written);
    });
    Ok(())
}

/// De-serializes a state. If the handle is not NULL, overwrites the state of the handle. The instance owns the state
/// until the importer frees the state or the instance.
pub unsafe fn deserialize<M: Exported, Byte>(
    instance: &mut Instance<M>,
    bytes: *const Byte,
    size: usize,
    state: *mut *mut c_void,
) -> Outcome {
    // SAFETY: by contract, `bytes` is NULL or points to an array of this length, and `state` is NULL or points to an
    // initialized handle.
    let (bytes, handle) = unsafe {
        (
            in_slice(bytes.cast::<u8>(), size, "serializedState")?,
            out_value(state, "FMUstate")?.assume_init_mut(),
        )
    };
    check_memory(instance, std::ptr::null_mut(), size)?;
    *handle = without_provenance_mut(instance.deserialize(bytes, handle.addr())?);
    Ok(())
}

/// Rejects a further state in WebAssembly, where memory is limited, if there is too little memory for it. `serialized`
/// is the length of the bytes from which the state is read, or 0. Accepts every state on other targets, and if `handle`
/// is not NULL, because the state then overwrites another.
fn check_memory<M: Exported>(instance: &mut Instance<M>, handle: *mut c_void, serialized: usize) -> Outcome {
    #[cfg(target_family = "wasm")]
    if handle.is_null() {
        let [state, content] = instance.size_of_state();
        // Collections may allocate twice as much as they contain.
        if !super::webassembly::has_memory([state, 2 * content.max(serialized)]) {
            return reject(
                "the instance has no memory for another state; free some, or compile the FMU with a larger \
                 FMU_MEMORY_PAGES",
            );
        }
    }
    _ = (instance, handle, serialized);
    Ok(())
}
