//! What is logged.

use super::{array, string};
use crate::instance::{Instance, Outcome, refuse};
use crate::log::Logger;
use fmi_abi::Category;
use fmi_abi::c_types::c_char;
use std::ffi::CStr;

/// # Safety
/// `categories` is NULL or an array of this length, of strings or NULL.
pub(crate) unsafe fn set_debug_logging<M>(
    instance: &mut Instance<M>,
    on: bool,
    count: usize,
    categories: *const *const c_char,
) -> Outcome {
    // SAFETY: by contract an array of this length.
    let names = unsafe { array(categories, count, "categories") }?;
    let mut found = 0;
    for name in names {
        // SAFETY: by contract NULL or a string.
        let name = unsafe { string(*name) }.map_or(&b""[..], CStr::to_bytes);
        let Some(bit) = Logger::find(name) else {
            let known = Category::ALL.map(|category| category.name().to_string_lossy()).join(", ");
            return refuse(format!(
                "there is no log category '{}'; the categories are {known}",
                String::from_utf8_lossy(name)
            ));
        };
        found |= bit;
    }
    match count {
        0 => instance.logger.set_all(on),
        _ => instance.logger.set(found, on),
    }
    Ok(())
}
