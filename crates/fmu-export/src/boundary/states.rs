//! Saved states behind pointers. A handle is only compared; the instance looks up the state.
//!
//! # Safety
//! The importer guarantees the contract of [`fmi2`](crate::fmi2#safety) or [`fmi3`](crate::fmi3#safety).

use super::{in_slice, out_slice, out_value};
use crate::export::Exported;
use crate::instance::{Instance, Outcome, reject};
use fmi_abi::c_types::c_void;
use std::ptr::without_provenance_mut;

/// The instance owns the state until the importer frees the state or the instance.
pub unsafe fn get_state<M: Exported>(instance: &mut Instance<M>, state: *mut *mut c_void) -> Outcome {
    // SAFETY: by contract, NULL or a pointer to a handle, which is initialized.
    let handle = unsafe { out_value(state, "FMUstate")?.assume_init_mut() };
    check_memory(instance, *handle, 0)?;
    *handle = without_provenance_mut(instance.save(handle.addr())?);
    Ok(())
}

pub unsafe fn set_state<M: Exported>(instance: &mut Instance<M>, state: *mut c_void) -> Outcome {
    instance.restore(state.addr())
}

/// Frees the state and clears the handle; ignores NULL.
pub unsafe fn free_state<M: Exported>(instance: &mut Instance<M>, state: *mut *mut c_void) -> Outcome {
    if state.is_null() {
        return Ok(());
    }
    // SAFETY: by contract, a pointer to a handle, which is initialized.
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
    // SAFETY: by contract, NULL or a pointer to a size.
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
    // SAFETY: by contract, an array of this length.
    let bytes = unsafe { out_slice(bytes.cast::<u8>(), size, "serializedState")? };
    let needed = instance.serialized_size(state.addr())?;
    if size != needed {
        return reject(format!(
            "the state needs {needed} bytes, the buffer has {size}; ask for its size first"
        ));
    }
    let mut written = vec![0; needed];
    instance.serialize(state.addr(), &mut written)?;
    bytes.iter_mut().zip(written).for_each(|(byte, written)| {
        byte.write(written);
    });
    Ok(())
}

/// The instance owns the state until the importer frees the state or the instance. An existing state of the
/// handle is overwritten.
pub unsafe fn deserialize<M: Exported, Byte>(
    instance: &mut Instance<M>,
    bytes: *const Byte,
    size: usize,
    state: *mut *mut c_void,
) -> Outcome {
    // SAFETY: by contract, an array of this length, and NULL or a pointer to a handle, which is initialized.
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

/// Rejects a further state if the memory of the instance is limited and too small for it. `serialized` is the length of the bytes
/// that the state is read from.
fn check_memory<M: Exported>(instance: &mut Instance<M>, handle: *mut c_void, serialized: usize) -> Outcome {
    #[cfg(target_family = "wasm")]
    if handle.is_null() {
        let [state, content] = instance.size_of_state();
        // Collections may allocate twice as much as they contain.
        if !super::webassembly::has_memory([state, 2 * content.max(serialized)]) {
            return reject(
                "the instance has no memory for another state; free one, or compile the FMU with a larger \
                 FMU_MEMORY_PAGES",
            );
        }
    }
    _ = (instance, handle, serialized);
    Ok(())
}
