//! Saved states behind pointers.

use super::{array, output, place};
use crate::export::Exported;
use crate::instance::{Instance, Outcome, SavedState, refuse};
use fmi_abi::c_types::c_void;

/// The importer owns the state until it frees it.
///
/// # Safety
/// As in the contract of the standards' modules.
pub(crate) unsafe fn get_state<M: Exported>(instance: &mut Instance<M>, state: *mut *mut c_void) -> Outcome {
    // SAFETY: by contract NULL or a pointer to a handle, which is initialized: NULL or a state.
    let handle = unsafe { place(state, "FMUstate")?.assume_init_mut() };
    // SAFETY: by contract the handle is NULL or a state of this model that nobody else uses now.
    match unsafe { handle.cast::<SavedState<M>>().as_mut() } {
        Some(saved) => instance.save_into(saved),
        None => {
            check_memory(instance)?;
            *handle = Box::into_raw(Box::new(instance.save())).cast();
        }
    }
    Ok(())
}

/// # Safety
/// As in the contract of the standards' modules.
pub(crate) unsafe fn set_state<M: Exported>(instance: &mut Instance<M>, state: *mut c_void) -> Outcome {
    // SAFETY: the module's contract.
    instance.restore(unsafe { saved(state) }?)
}

/// Takes the state back and clears the handle; NULL is ignored.
///
/// # Safety
/// As in the contract of the standards' modules.
pub(crate) unsafe fn free_state<M: Exported>(state: *mut *mut c_void) -> Outcome {
    if state.is_null() {
        return Ok(());
    }
    // SAFETY: by contract a pointer to a handle, which is initialized: NULL or a state.
    let handle = unsafe { place(state, "FMUstate")?.assume_init_mut() };
    let state = std::mem::replace(handle, std::ptr::null_mut());
    if !state.is_null() {
        // SAFETY: by contract a state that this library gave away as a box and that is not freed.
        drop(unsafe { Box::from_raw(state.cast::<SavedState<M>>()) });
    }
    Ok(())
}

/// # Safety
/// As in the contract of the standards' modules.
pub(crate) unsafe fn serialized_size<M: Exported>(
    instance: &mut Instance<M>,
    state: *mut c_void,
    size: *mut usize,
) -> Outcome {
    // SAFETY: by contract NULL or a state of this model; NULL or a pointer to a size.
    let (saved, size) = unsafe { (saved(state)?, place(size, "size")?) };
    size.write(instance.serialized_size(saved));
    Ok(())
}

/// # Safety
/// As in the contract of the standards' modules.
pub(crate) unsafe fn serialize<M: Exported>(
    instance: &mut Instance<M>,
    state: *mut c_void,
    bytes: *mut u8,
    size: usize,
) -> Outcome {
    // SAFETY: by contract NULL or a state of this model; an array of this length.
    let (saved, bytes) = unsafe { (saved(state)?, output(bytes, size, "serializedState")?) };
    let needed = instance.serialized_size(saved);
    if size != needed {
        return refuse(format!(
            "the state needs {needed} bytes, the buffer has {size}; ask for its size first"
        ));
    }
    let mut written = vec![0; needed];
    instance.serialize(saved, &mut written);
    bytes.iter_mut().zip(written).for_each(|(byte, written)| {
        byte.write(written);
    });
    Ok(())
}

/// The importer owns the state until it frees it; a state that the handle held before is overwritten.
///
/// # Safety
/// As in the contract of the standards' modules.
pub(crate) unsafe fn deserialize<M: Exported>(
    instance: &mut Instance<M>,
    bytes: *const u8,
    size: usize,
    state: *mut *mut c_void,
) -> Outcome {
    // SAFETY: by contract an array of this length; NULL or a pointer to a handle, which is NULL or a state.
    let (bytes, handle) =
        unsafe { (array(bytes, size, "serializedState")?, place(state, "FMUstate")?.assume_init_mut()) };
    check_memory(instance)?;
    let restored = instance.deserialize(bytes)?;
    // SAFETY: by contract the handle is NULL or a state of this model that nobody else uses now.
    match unsafe { handle.cast::<SavedState<M>>().as_mut() } {
        Some(saved) => *saved = restored,
        None => *handle = Box::into_raw(Box::new(restored)).cast(),
    }
    Ok(())
}

/// Refuses another state where an instance's memory is limited and has no place for it.
fn check_memory<M: Exported>(instance: &mut Instance<M>) -> Outcome {
    #[cfg(target_family = "wasm")]
    if !super::webassembly::has_memory(2 * instance.size_of_state()) {
        return refuse(
            "the instance has no memory for another state; free one, or compile the FMU with a larger \
             FMU_MEMORY_PAGES",
        );
    }
    _ = instance;
    Ok(())
}

/// The saved state behind a handle.
///
/// # Safety
/// NULL or a state of this model that is not freed and not written for `'a`.
unsafe fn saved<'a, M: Exported>(state: *mut c_void) -> Outcome<&'a SavedState<M>> {
    // SAFETY: the caller's promise.
    match unsafe { state.cast::<SavedState<M>>().as_ref() } {
        Some(saved) => Ok(saved),
        None => refuse("the state is NULL; save one first"),
    }
}
