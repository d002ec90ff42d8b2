//! Saved states behind pointers. A handle is only ever compared: what it points to is the business of the instance.
//!
//! # Safety
//! As in the contract of the [standards' modules](crate::fmi2).

use super::{array, output, place};
use crate::export::Exported;
use crate::instance::{Instance, Outcome, refuse};
use fmi_abi::c_types::c_void;
use std::ptr::without_provenance_mut;

/// The state is the instance's until the importer frees it, or the instance.
pub unsafe fn get_state<M: Exported>(instance: &mut Instance<M>, state: *mut *mut c_void) -> Outcome {
    // SAFETY: by contract NULL or a pointer to a handle, which is initialized.
    let handle = unsafe { place(state, "FMUstate")?.assume_init_mut() };
    check_memory(instance, *handle)?;
    *handle = without_provenance_mut(instance.save(handle.addr())?);
    Ok(())
}

pub unsafe fn set_state<M: Exported>(instance: &mut Instance<M>, state: *mut c_void) -> Outcome {
    instance.restore(state.addr())
}

/// Takes the state back and clears the handle; NULL is ignored.
pub unsafe fn free_state<M: Exported>(instance: &mut Instance<M>, state: *mut *mut c_void) -> Outcome {
    if state.is_null() {
        return Ok(());
    }
    // SAFETY: by contract a pointer to a handle, which is initialized.
    let handle = unsafe { place(state, "FMUstate")?.assume_init_mut() };
    if !handle.is_null() {
        let state = instance.give(handle.addr())?;
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
    // SAFETY: by contract NULL or a pointer to a size.
    let size = unsafe { place(size, "size")? };
    size.write(instance.serialized_size(state.addr())?);
    Ok(())
}

pub unsafe fn serialize<M: Exported, Byte>(
    instance: &mut Instance<M>,
    state: *mut c_void,
    bytes: *mut Byte,
    size: usize,
) -> Outcome {
    // SAFETY: by contract an array of this length.
    let bytes = unsafe { output(bytes.cast::<u8>(), size, "serializedState")? };
    let needed = instance.serialized_size(state.addr())?;
    if size != needed {
        return refuse(format!(
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

/// The state is the instance's until the importer frees it, or the instance; one that the handle held before is
/// overwritten.
pub unsafe fn deserialize<M: Exported, Byte>(
    instance: &mut Instance<M>,
    bytes: *const Byte,
    size: usize,
    state: *mut *mut c_void,
) -> Outcome {
    // SAFETY: by contract an array of this length; NULL or a pointer to a handle, which is initialized.
    let (bytes, handle) = unsafe {
        (array(bytes.cast::<u8>(), size, "serializedState")?, place(state, "FMUstate")?.assume_init_mut())
    };
    check_memory(instance, std::ptr::null_mut())?;
    *handle = without_provenance_mut(instance.deserialize(bytes, handle.addr())?);
    Ok(())
}

/// Refuses another state where an instance's memory is limited and has no place for it.
fn check_memory<M: Exported>(instance: &mut Instance<M>, handle: *mut c_void) -> Outcome {
    #[cfg(target_family = "wasm")]
    if handle.is_null() && !super::webassembly::has_memory(2 * instance.size_of_state()) {
        return refuse(
            "the instance has no memory for another state; free one, or compile the FMU with a larger \
             FMU_MEMORY_PAGES",
        );
    }
    _ = (instance, handle);
    Ok(())
}
