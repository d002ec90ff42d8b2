//! Texts.

use super::string;
use crate::export::Exported;
use crate::instance::{Instance, Outcome, refuse};
use crate::types::BaseType;
use crate::value::Value;
use libc::c_char;
use std::ffi::{CStr, CString};
use std::mem::MaybeUninit;

/// The texts are the instance's until the next call on it.
pub(crate) fn get_texts<M: Exported>(
    instance: &mut Instance<M>,
    vr: &[u32],
    values: &mut [MaybeUninit<*const c_char>],
) -> Outcome {
    let mut texts = Vec::with_capacity(vr.len());
    instance.get(vr, &[BaseType::String], |_, value| {
        if let Value::String(text) = value {
            // A zero byte would end the text for C.
            texts.push(CString::new(text.replace('\0', " ")).unwrap_or_default());
        }
    })?;
    values.iter_mut().zip(&texts).for_each(|(value, text)| {
        value.write(text.as_ptr());
    });
    instance.texts = texts;
    Ok(())
}

/// # Safety
/// Each value is NULL or a string.
pub(crate) unsafe fn set_texts<M: Exported>(
    instance: &mut Instance<M>,
    vr: &[u32],
    values: &[*const c_char],
) -> Outcome {
    let mut texts = Vec::with_capacity(vr.len());
    for (vr, value) in vr.iter().zip(values) {
        // SAFETY: by contract NULL or a string.
        match unsafe { string(*value) }.map(CStr::to_str) {
            Some(Ok(text)) => texts.push(Value::String(text.to_owned())),
            Some(Err(_)) => {
                return refuse(format!(
                    "the text for {} is not UTF-8",
                    instance.name(*vr, BaseType::String)?
                ));
            }
            None => return refuse(format!("the text for {} is NULL", instance.name(*vr, BaseType::String)?)),
        }
    }
    instance.set(vr, &[BaseType::String], texts.iter().cloned())
}
