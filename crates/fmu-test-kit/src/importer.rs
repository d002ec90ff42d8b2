//! An instance as an importer uses it. Its methods are generated from the list of functions of an FMI version.

use fmi_abi::c_types::c_void;
use fmi_abi::calls::{Instantiation, LogMessage, LogReceiver, callbacks, log_callback, string};
use fmu_export::{Category, Exported, Interface, Standard, Status};
use std::ffi::{CStr, CString};
use std::hint::black_box;
use std::ptr::{null, null_mut};
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

/// The environment of each message must be NULL or a live `Log`.
impl LogReceiver for Log {
    unsafe fn receive(message: LogMessage) {
        // SAFETY: the caller guarantees NULL or a string.
        let owned = |pointer| unsafe { string(pointer) }.unwrap_or_default().to_string_lossy().into_owned();
        let LogMessage { environment, instance_name, category, text, .. } = message;
        let status = Status::from_c(message.status);
        let [instance_name, category, message] = [instance_name, category, text].map(owned);
        // SAFETY: NULL, or the `Log` that was passed with the logger and lives as long as the instance.
        if let Some(log) = unsafe { environment.cast::<Self>().as_ref() } {
            lock(&log.messages).push(Message { instance_name, status, category, message });
            let hook = lock(&log.hook).take();
            if let Some(mut hook) = hook {
                hook();
                *lock(&log.hook) = Some(hook);
            }
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

impl Arguments<'_> {
    /// Calls an instantiation function with these arguments. Afterwards overwrites the callbacks structure and the instance name,
    /// because the FMU must have copied them.
    pub(crate) fn instantiate(
        &self,
        standard: Standard,
        log: &Log,
        instantiate: impl FnOnce(&Instantiation) -> *mut c_void,
    ) -> *mut c_void {
        let pointer = |string: Option<&CStr>| string.map_or(null(), CStr::as_ptr);
        let mut name = self.instance_name.map(|name| name.to_bytes_with_nul().to_vec());
        let environment = if self.environment { (&raw const *log).cast_mut().cast() } else { null_mut() };
        let mut callbacks = callbacks::<Log>(environment);
        callbacks.logger = callbacks.logger.filter(|_| self.logger);
        // NULL is allowed, because FMUs of fmu-export have `canNotUseMemoryManagementFunctions`.
        (callbacks.allocate_memory, callbacks.free_memory) = (None, None);
        // FMI 3.0 needs a path, not a URI.
        let resources = self.resource_location.map(|location| match standard {
            Standard::Fmi2 => location,
            Standard::Fmi3 => {
                let bytes = location.to_bytes_with_nul();
                CStr::from_bytes_with_nul(bytes.strip_prefix(b"file://").unwrap_or(bytes))
                    .expect("the terminating NUL is kept")
            }
        });
        let instance = instantiate(&Instantiation {
            interface: self.fmu_type,
            name: name.as_ref().map_or(null(), |name| name.as_ptr().cast()),
            token: pointer(self.guid.as_deref()),
            resources: pointer(resources),
            visible: self.visible.into(),
            logging_on: self.logging_on,
            callbacks: if self.callbacks { &raw const callbacks } else { null() },
            environment,
            log: self.logger.then_some(log_callback::<Log>()),
            event_mode_used: self.event_mode_used,
            early_return_allowed: self.early_return_allowed,
            required_intermediate_variables: self.required_intermediate_variables.as_ptr(),
            required_count: self.required_intermediate_variables.len(),
        });
        callbacks.logger = None;
        callbacks.component_environment = null_mut();
        if let Some(name) = &mut name {
            name.fill(b'X');
        }
        black_box((&callbacks, &name));
        instance
    }
}

/// Converts a Boolean that an FMI function wrote. Panics if its integer value is neither 0 nor 1.
#[track_caller]
pub(crate) fn to_bool(flag: i32) -> bool {
    assert!([0, 1].contains(&flag), "{flag} is not a Boolean");
    flag == 1
}

/// Defines the importer of an FMI version.
macro_rules! importer {
    (
        $free_instance:ident;
        $standard:ident $handle:ident
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
                let instance = arguments.instantiate(Standard::$standard, &log, |arguments| {
                    // SAFETY: each pointer is NULL or points to a live value.
                    unsafe { functions.instantiate(arguments) }
                });
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
        }

        /// Names of the functions that take an instance.
        pub const FUNCTIONS: &[&str] = &[$(stringify!($function)),+];
    };
}
pub(crate) use importer;
