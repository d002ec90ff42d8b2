//! Loggers that are passed to the FMU, and the messages that it has logged.

use super::locked;
use crate::call_sequence::Message;
use fmi_abi::c_types::{c_char, c_int, c_void};
use std::ffi::CStr;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Messages, each with the environment pointer that the FMU passed to the logger.
static MESSAGES: Mutex<Vec<(usize, Message)>> = Mutex::new(Vec::new());

/// Environment pointer of the first instance, and the distance to the pointer of the next one.
const FIRST_ENVIRONMENT: usize = 0x10_0000;
pub const ENVIRONMENT_STEP: usize = 16;

/// Environment pointer of the next instance.
pub static ENVIRONMENTS: AtomicUsize = AtomicUsize::new(FIRST_ENVIRONMENT);

/// Records a message, unless there are 1000 already.
///
/// # Safety
/// Each pointer is NULL or points to a string that ends with NUL.
unsafe fn record(environment: *mut c_void, status: c_int, category: *const c_char, text: *const c_char) {
    // SAFETY: the caller's requirement.
    let [category, text] = [category, text].map(|pointer| unsafe { text_at(pointer) });
    let mut messages = locked(&MESSAGES);
    if messages.len() < 1000 {
        messages.push((environment as usize, Message { status, category, text }));
    }
}

/// Logger of FMI 2.0. Stable Rust cannot define variadic functions, so this one has fixed arguments: six integers or pointers,
/// then four floating-point numbers, which have separate registers. On Linux, and on macOS with Intel processors, variadic
/// arguments are passed in the same way. On other systems, the format is recorded without the values.
#[allow(clippy::too_many_arguments, reason = "the values of the message")]
pub unsafe extern "C" fn log_of_fmi2(
    environment: *mut c_void,
    instance_name: *const c_char,
    status: c_int,
    category: *const c_char,
    text: *const c_char,
    a: usize,
    b: usize,
    c: usize,
    d: usize,
    e: usize,
    f: usize,
    x: f64,
    y: f64,
    z: f64,
    w: f64,
) {
    // SAFETY: section 2.1.5 of FMI 2.0: the strings end with NUL, and `text` is a format of printf for the values. The name is
    // read because importers print it.
    unsafe {
        std::hint::black_box(text_at(instance_name));
        #[cfg(all(unix, not(all(target_vendor = "apple", target_arch = "aarch64"))))]
        if !text.is_null() {
            let print = |to: *mut c_char, size| libc::snprintf(to, size, text, a, b, c, d, e, f, x, y, z, w);
            let mut message = vec![0; usize::try_from(print(std::ptr::null_mut(), 0)).unwrap_or(0) + 1];
            print(message.as_mut_ptr(), message.len());
            return record(environment, status, category, message.as_ptr());
        }
        #[cfg(not(all(unix, not(all(target_vendor = "apple", target_arch = "aarch64")))))]
        std::hint::black_box((a, b, c, d, e, f, x, y, z, w));
        record(environment, status, category, text);
    }
}

/// Logger of FMI 3.0.
pub unsafe extern "C" fn log_of_fmi3(
    environment: *mut c_void,
    status: c_int,
    category: *const c_char,
    text: *const c_char,
) {
    // SAFETY: section 2.3.1 of FMI 3.0: the strings end with NUL.
    unsafe { record(environment, status, category, text) }
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
    (!pointer.is_null()).then(|| unsafe { CStr::from_ptr(pointer) }.to_bytes().to_vec())
}

#[cfg(all(test, unix, not(all(target_vendor = "apple", target_arch = "aarch64"))))]
mod tests {
    use super::{FIRST_ENVIRONMENT, log_of_fmi2, messages};
    use fmi_abi::fmi2::types::fmi2CallbackLogger;

    #[test]
    fn messages_of_fmi2_have_their_values() {
        let format = c"Wrong GUID %s, line %d of %s: t = %g, %5.1e, 100 %%";
        // SAFETY: the values have the types of the format.
        unsafe {
            let log = std::mem::transmute::<*const (), fmi2CallbackLogger>(log_of_fmi2 as *const ());
            let (token, path) = (c"{8c4e}".as_ptr(), c"model.fmu".as_ptr());
            log(
                FIRST_ENVIRONMENT as _,
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
