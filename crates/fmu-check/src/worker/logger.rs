//! The messages that the FMU has logged.

use super::locked;
use crate::call_sequence::Message;
use fmi_abi::c_types::c_char;
use fmi_abi::calls::{LogMessage, LogReceiver, LogValues, string};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Messages, each with the environment pointer that the FMU passed to the logger.
static MESSAGES: Mutex<Vec<(usize, Message)>> = Mutex::new(Vec::new());

/// Environment pointer of the first instance, and the distance to the pointer of the next one.
const FIRST_ENVIRONMENT: usize = 0x10_0000;
pub const ENVIRONMENT_STEP: usize = 16;

/// Environment pointer of the next instance.
pub static ENVIRONMENTS: AtomicUsize = AtomicUsize::new(FIRST_ENVIRONMENT);

/// Records the messages of all instances, at most 1000.
pub struct Recorder;

impl LogReceiver for Recorder {
    unsafe fn receive(message: LogMessage) {
        let LogMessage { environment, instance_name, status, category, text, values, .. } = message;
        // SAFETY: the caller guarantees strings that end with NUL. The name is read because importers print it, and the values
        // because the text is a format of printf for them (section 2.1.5 of FMI 2.0).
        let (category, text) = unsafe {
            std::hint::black_box(text_at(instance_name));
            let expanded = values.filter(|_| !text.is_null()).map(|values| print(text, &values));
            (text_at(category), expanded.or_else(|| text_at(text)))
        };
        let mut messages = locked(&MESSAGES);
        if messages.len() < 1000 {
            messages.push((environment as usize, Message { status, category, text }));
        }
    }
}

/// Formats a message with `snprintf`, as importers do. A format that does not fit the values may crash this process.
///
/// # Safety
/// The format ends with NUL, and the values have the types of its conversions.
unsafe fn print(format: *const c_char, values: &LogValues) -> Vec<u8> {
    let ([a, b, c, d, e, f, g, h], [r, s, t, u, v, w, x, y]) = (values.words, values.numbers);
    // SAFETY: the caller guarantees that the values fit the format; more values than conversions are allowed.
    let print = |to, size| unsafe {
        libc::snprintf(to, size, format, a, b, c, d, e, f, g, h, r, s, t, u, v, w, x, y)
    };
    let mut message = vec![0_u8; usize::try_from(print(std::ptr::null_mut(), 0)).unwrap_or(0) + 1];
    print(message.as_mut_ptr().cast(), message.len());
    message.truncate(message.iter().position(|byte| *byte == 0).unwrap_or_default());
    message
}

/// Removes and returns the messages with this environment pointer, and separately the messages with a pointer that no instance
/// has received, which is a fault of the FMU.
pub fn messages(environment: usize) -> (Vec<Message>, Vec<Message>) {
    let mut messages = locked(&MESSAGES);
    let (mut own, mut strays) = (Vec::new(), Vec::new());
    let given = FIRST_ENVIRONMENT..ENVIRONMENTS.load(Ordering::Relaxed);
    messages.retain(|(source, message)| {
        if *source == environment {
            own.push(message.clone());
        } else if given.contains(source) && source % ENVIRONMENT_STEP == 0 {
            return true;
        } else {
            strays.push(message.clone());
        }
        false
    });
    (own, strays)
}

/// Returns the bytes of a string; `None` for NULL.
///
/// # Safety
/// The pointer is NULL or points to a string that ends with NUL.
pub unsafe fn text_at(pointer: *const c_char) -> Option<Vec<u8>> {
    // SAFETY: the caller's requirement.
    unsafe { string(pointer) }.map(|text| text.to_bytes().to_vec())
}

#[cfg(all(test, any(all(unix, target_arch = "x86_64"), all(target_os = "linux", target_arch = "aarch64"))))]
mod tests {
    use super::{FIRST_ENVIRONMENT, Recorder, messages};
    use fmi_abi::calls::callbacks;

    #[test]
    fn messages_of_fmi2_have_their_values() {
        let format = c"Wrong GUID %s, line %d of %s: t = %g, %5.1e, 100 %%";
        // SAFETY: the values have the types of the format.
        unsafe {
            let callbacks = callbacks::<Recorder>(FIRST_ENVIRONMENT as _);
            let (token, path) = (c"{8c4e}".as_ptr(), c"model.fmu".as_ptr());
            callbacks.logger.unwrap()(
                callbacks.component_environment,
                c"name".as_ptr(),
                0,
                c"".as_ptr(),
                format.as_ptr(),
                token,
                7,
                path,
                0.5,
                1e-9,
            );
        }
        let text = messages(FIRST_ENVIRONMENT).0.remove(0).text.unwrap_or_default();
        assert_eq!(
            String::from_utf8_lossy(&text),
            "Wrong GUID {8c4e}, line 7 of model.fmu: t = 0.5, 1.0e-09, 100 %"
        );
    }
}
