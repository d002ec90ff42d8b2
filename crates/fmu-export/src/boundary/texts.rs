//! Texts.

use super::string;
use crate::export::Exported;
use crate::instance::{Instance, Outcome, Reference};
use crate::value::Value;
use fmi_abi::BaseType;
use fmi_abi::c_types::c_char;
use std::ffi::{CStr, CString};
use std::mem::MaybeUninit;

/// The texts are the instance's until the next call on it.
pub(crate) fn get_texts<M: Exported, R: Reference>(
    instance: &mut Instance<M>,
    vr: &[R],
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
pub(crate) unsafe fn set_texts<M: Exported, R: Reference>(
    instance: &mut Instance<M>,
    vr: &[R],
    values: &[*const c_char],
) -> Outcome {
    let mut texts = Vec::with_capacity(vr.len());
    for (place, value) in values.iter().enumerate() {
        // SAFETY: by contract NULL or a string.
        let fault = match unsafe { string(*value) }.map(CStr::to_str) {
            Some(Ok(text)) => {
                texts.push(Value::String(text.to_owned()));
                continue;
            }
            Some(Err(_)) => "not UTF-8",
            None => "NULL",
        };
        let why = |name: &str| format!("the text for {name} is {fault}");
        return instance.refuse_value(vr, &[BaseType::String], place, why);
    }
    instance.set(vr, &[BaseType::String], texts.iter().cloned())
}
