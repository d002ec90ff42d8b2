//! An instance as an importer uses it. Its methods are generated from the list of functions of an FMI version.

use fmi_abi::c_types::{c_char, c_int, c_void};
use fmu_export::{Category, Exported, Interface, Status};
use std::ffi::{CStr, CString};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// A log message that the importer received.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Message {
    /// The name of the instance; empty in FMI 3.0, which does not pass it.
    pub instance_name: String,
    /// Status of the message.
    pub status: Status,
    /// Log category.
    pub category: String,
    /// The message.
    pub message: String,
}

impl Message {
    /// Asserts that the message is not empty and has a known category. It must not contain `%` or `#`, because
    /// `printf` or importers interpret them, or a newline, because importers append one (section 2.1.5 of FMI 2.0).
    ///
    /// # Panics
    /// Panics if one of these assertions fails.
    #[track_caller]
    pub fn assert_clean(&self) {
        assert!(!self.message.contains(['%', '#', '\n']) && !self.message.is_empty(), "{self:?}");
        let known = Category::ALL.map(|category| category.name().to_str().expect("ASCII"));
        assert!(known.contains(&self.category.as_str()), "{self:?}");
    }
}

/// Code that runs in the log callback.
pub type Hook = Box<dyn FnMut() + Send>;

/// The importer's log; its address is the component environment.
#[derive(Default)]
pub(crate) struct Log {
    messages: Mutex<Vec<Message>>,
    /// Runs for every message, except for messages that it causes itself.
    pub(crate) hook: Mutex<Option<Hook>>,
}

pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Log {
    pub(crate) fn take(&self) -> Vec<Message> {
        std::mem::take(&mut lock(&self.messages))
    }
}

impl std::fmt::Debug for Log {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        self.messages.fmt(f)
    }
}

/// Stores a message.
///
/// # Safety
/// The environment is NULL or a live `Log`; the strings are NULL or valid.
pub(crate) unsafe fn remember(
    environment: *mut c_void,
    instance_name: *const c_char,
    status: c_int,
    category: *const c_char,
    message: *const c_char,
) {
    // SAFETY: the caller guarantees NULL or a string.
    let string = |pointer: *const c_char| match unsafe { pointer.as_ref() } {
        // SAFETY: the pointer is not NULL, so it is a string.
        Some(_) => unsafe { CStr::from_ptr(pointer) }.to_string_lossy().into_owned(),
        None => String::new(),
    };
    let status = Status::from_c(status);
    let [instance_name, category, message] = [instance_name, category, message].map(string);
    // SAFETY: NULL, or the `Log` that was passed with the logger and lives as long as the instance.
    if let Some(log) = unsafe { environment.cast::<Log>().as_ref() } {
        lock(&log.messages).push(Message { instance_name, status, category, message });
        let hook = lock(&log.hook).take();
        if let Some(mut hook) = hook {
            hook();
            *lock(&log.hook) = Some(hook);
        }
    }
}

/// Arguments of the instantiation functions. If `callbacks` is false, NULL replaces the structure of callbacks of
/// FMI 2.0; if `logger` or `environment` is false, NULL replaces the log callback or its environment. Messages without
/// an environment are ignored.
#[derive(Clone, Debug)]
#[allow(missing_docs, reason = "as in the standards: section 2.1.5 of FMI 2.0, 2.3.1 of FMI 3.0")]
pub struct Arguments<'a> {
    pub instance_name: Option<&'a CStr>,
    /// Interface type. It selects the function of FMI 3.0: 0 selects Model Exchange, 2 Scheduled Execution, and any
    /// other value Co-Simulation.
    pub fmu_type: i32,
    /// The guid, or the instantiation token.
    pub guid: Option<CString>,
    pub resource_location: Option<&'a CStr>,
    pub callbacks: bool,
    pub logger: bool,
    pub environment: bool,
    pub visible: bool,
    pub logging_on: u8,
    /// Only for FMI 3.0, like the following fields.
    pub event_mode_used: u8,
    pub early_return_allowed: u8,
    pub required_intermediate_variables: &'a [u32],
}

impl Arguments<'static> {
    /// Returns the arguments of an importer that neither handles events nor permits early return.
    pub fn new<M: Exported>(interface: Interface) -> Self {
        Self {
            instance_name: Some(c"instance"),
            fmu_type: interface as i32,
            guid: CString::new(fmu_export::guid::<M>()).ok(),
            resource_location: Some(c"file:///tmp/fmu/resources"),
            callbacks: true,
            logger: true,
            environment: true,
            visible: false,
            logging_on: 0,
            event_mode_used: 0,
            early_return_allowed: 0,
            required_intermediate_variables: &[],
        }
    }

    /// Returns the arguments of an importer that allows early return, and uses Event Mode if the model has it.
    pub fn with_events<M: Exported>(interface: Interface) -> Self {
        let event_mode_used = M::CO_SIMULATION.is_some_and(|offer| offer.has_event_mode()).into();
        Self { event_mode_used, early_return_allowed: 1, ..Self::new::<M>(interface) }
    }
}

/// Converts a Boolean that an FMI function wrote. Panics if its integer value is neither 0 nor 1.
#[track_caller]
pub(crate) fn to_bool(flag: i32) -> bool {
    assert!([0, 1].contains(&flag), "{flag} is not a Boolean");
    flag == 1
}

/// Defines the importer of an FMI version. The calling module provides `make`, which calls the instantiation
/// functions.
macro_rules! importer {
    (
        $free_instance:ident;
        $_standard:ident $handle:ident
        without an instance { $($free:ident($($free_argument:ident: $free_type:ty),*) -> $result:ty;)+ }
        with an instance {
            $($function:ident $cs:literal $me:literal $tolerated:literal ($($argument:ident: $type:ty),*);)+
        }
    ) => {
        /// An instance with its log; freed when dropped.
        #[derive(Debug)]
        pub struct Importer {
            functions: Functions,
            instance: $handle,
            // Shared, because the FMU has a pointer to it.
            log: std::sync::Arc<Log>,
        }

        // SAFETY: the FMI standards permit use of an instance from any thread, one thread at a time.
        unsafe impl Send for Importer {}

        impl Drop for Importer {
            fn drop(&mut self) {
                // SAFETY: the instance is NULL, or made by the library and freed only here.
                unsafe { (self.functions.$free_instance)(self.instance) }
            }
        }

        impl Importer {
            /// Calls the instantiation function.
            ///
            /// # Errors
            /// Returns the log messages if instantiation fails.
            pub fn instantiate(functions: Functions, arguments: &Arguments) -> Result<Self, Vec<Message>> {
                let log = std::sync::Arc::<Log>::default();
                let instance = make(&functions, arguments, &log);
                if instance.is_null() { Err(log.take()) } else { Ok(Self { functions, instance, log }) }
            }

            /// Returns an importer without an instance: its functions pass NULL.
            pub(crate) fn without_instance(functions: Functions) -> Self {
                Self { functions, instance: null_mut(), log: Default::default() }
            }

            /// Calls the function that frees the instance, as an importer might do in a log callback.
            ///
            /// # Safety
            /// Call this only from the log callback of this instance; the FMU then ignores the call.
            pub unsafe fn free(&self) {
                // SAFETY: the instance is NULL or alive, and stays alive.
                unsafe { (self.functions.$free_instance)(self.instance) }
            }

            pub(crate) fn log(&self) -> &Log {
                &self.log
            }

            /// Returns the functions of the library.
            pub fn functions(&self) -> &Functions {
                &self.functions
            }

            /// Returns the instance, for calls that this type does not have.
            pub fn instance(&self) -> $handle {
                self.instance
            }
        }

        /// Functions of the FMI version, with their names and the argument types of C.
        #[allow(non_snake_case, missing_docs, clippy::too_many_arguments)]
        impl Importer {
            $(
                #[allow(clippy::not_unsafe_ptr_arg_deref, reason = "see the SAFETY comment")]
                #[inline]
                pub fn $function(&self $(, $argument: $type)*) -> Status {
                    // SAFETY: the instance is NULL or alive. Pointers are passed on unchanged: callers of
                    // this type guarantee NULL or enough values, as in C.
                    Status::from_c(unsafe { (self.functions.$function)(self.instance $(, $argument)*) })
                }
            )+

            pub(crate) fn address_of(&self, name: &str) -> *const c_void {
                match name {
                    $(stringify!($function) => self.functions.$function as *const c_void,)+
                    _ => panic!("there is no function {name}"),
                }
            }
        }

        /// Names of the functions that take an instance.
        pub const FUNCTIONS: &[&str] = &[$(stringify!($function)),+];
    };
}
pub(crate) use importer;
