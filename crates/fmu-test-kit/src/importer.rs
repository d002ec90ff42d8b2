//! An instance as an importer holds it: the C functions of a standard as methods, from the standard's list.

use fmi_abi::c_types::{c_char, c_int, c_void};
use fmu_export::{Category, Exported, Interface, Status};
use std::ffi::{CStr, CString};
use std::ops::Deref;
use std::sync::Mutex;

/// What the logger was told.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Message {
    /// The name of the instance; FMI 3.0 does not pass it.
    pub instance_name: String,
    /// The status that goes with it.
    pub status: Status,
    /// One of the log categories.
    pub category: String,
    /// The text.
    pub text: String,
}

impl Message {
    /// Every importer shows it as it is: nothing in it that `printf` or section 2.1.5 give a meaning to.
    ///
    /// # Panics
    /// When it is not so.
    #[track_caller]
    pub fn assert_clean(&self) {
        assert!(!self.text.contains(['%', '#', '\n']) && !self.text.is_empty(), "{self:?}");
        let known = Category::ALL.map(|category| category.name().to_str().expect("ASCII"));
        assert!(known.contains(&self.category.as_str()), "{self:?}");
    }
}

/// The importer's log; its address is the component environment.
#[derive(Debug, Default)]
pub(crate) struct Log(Mutex<Vec<Message>>);

impl Log {
    pub(crate) fn take(&self) -> Vec<Message> {
        std::mem::take(&mut self.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner))
    }
}

/// # Safety
/// The environment is NULL or a `Log` that lives, the texts are NULL or strings.
pub(crate) unsafe fn remember(
    environment: *mut c_void,
    instance_name: *const c_char,
    status: c_int,
    category: *const c_char,
    message: *const c_char,
) {
    // SAFETY: the caller's promise.
    let text = |pointer: *const c_char| match unsafe { pointer.as_ref() } {
        // SAFETY: not NULL, and a string.
        Some(_) => unsafe { CStr::from_ptr(pointer) }.to_string_lossy().into_owned(),
        None => String::new(),
    };
    let status = Status::from_c(status);
    let [instance_name, category, text] = [instance_name, category, message].map(text);
    // SAFETY: NULL or the `Log` that was handed over with the logger and lives as long as the instance.
    if let Some(log) = unsafe { environment.cast::<Log>().as_ref() } {
        let mut messages = log.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        messages.push(Message { instance_name, status, category, text });
    }
}

/// The arguments of the functions that make instances. `callbacks: false` passes NULL instead of FMI 2.0's structure,
/// `logger: false` no logger, `environment: false` no environment (messages are then read and forgotten).
#[derive(Clone, Debug)]
#[allow(missing_docs, reason = "as in the standards: section 2.1.5 of FMI 2.0, 2.3.1 of FMI 3.0")]
pub struct Arguments<'a> {
    pub instance_name: Option<&'a CStr>,
    /// In FMI 3.0, whose interface types have a function each, all but 0 is Co-Simulation.
    pub fmu_type: i32,
    /// Or instantiation token.
    pub guid: Option<CString>,
    pub resource_location: Option<&'a CStr>,
    pub callbacks: bool,
    pub logger: bool,
    pub environment: bool,
    pub visible: bool,
    pub logging_on: u8,
    /// From here on for FMI 3.0.
    pub event_mode_used: u8,
    pub early_return_allowed: u8,
    pub required_intermediate_variables: &'a [u32],
}

impl Arguments<'static> {
    /// What a careful importer passes, which can do little.
    pub fn of<M: Exported>(interface: Interface) -> Self {
        Self {
            instance_name: Some(c"instance"),
            fmu_type: interface as i32,
            guid: CString::new(M::INFO.guid).ok(),
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

    /// The same with all that the importers of the model may use.
    pub fn with_events<M: Exported>(interface: Interface) -> Self {
        let event_mode_used = M::CO_SIMULATION.is_some_and(|offer| offer.has_event_mode()).into();
        Self { event_mode_used, early_return_allowed: 1, ..Self::of::<M>(interface) }
    }
}

/// An instance of either standard that somebody else frees, see `Importer::borrowed`.
pub struct Borrowed<F> {
    pub(crate) importer: F,
    /// Leaves NULL in its place, whose freeing does nothing.
    pub(crate) forget: fn(&mut F),
}

impl<F> Deref for Borrowed<F> {
    type Target = F;

    fn deref(&self) -> &F {
        &self.importer
    }
}

impl<F> Drop for Borrowed<F> {
    fn drop(&mut self) {
        (self.forget)(&mut self.importer);
    }
}

/// The importer of a standard. The module has `make`, for instances, and `functions_of` a model.
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
            // Shared: the FMU has a pointer to it.
            log: std::sync::Arc<Log>,
        }

        // SAFETY: an instance may be used from any one thread at a time (masters have thread pools).
        unsafe impl Send for Importer {}

        impl Drop for Importer {
            fn drop(&mut self) {
                // SAFETY: NULL, or made by the library and freed only here.
                unsafe { (self.functions.$free_instance)(self.instance) }
            }
        }

        impl Importer {
            /// A new instance.
            ///
            /// # Errors
            /// What was logged, if there is no instance.
            pub fn instantiate(functions: Functions, arguments: &Arguments) -> Result<Self, Vec<Message>> {
                let log = std::sync::Arc::<Log>::default();
                let instance = make(&functions, arguments, &log);
                if instance.is_null() { Err(log.take()) } else { Ok(Self { functions, instance, log }) }
            }

            /// A fresh instance of a model in this program, or of the library that stands for it.
            ///
            /// # Panics
            /// When there is none.
            pub fn of<M: Exported>(interface: Interface) -> Self {
                Self::with::<M>(&Arguments::of::<M>(interface))
            }

            /// One that is made like this.
            ///
            /// # Panics
            /// When there is none.
            pub fn with<M: Exported>(arguments: &Arguments) -> Self {
                Self::try_with::<M>(arguments).unwrap_or_else(|log| panic!("there is no instance: {log:?}"))
            }

            /// One that is made like this, or not.
            ///
            /// # Errors
            /// What was logged, if there is no instance.
            pub fn try_with<M: Exported>(arguments: &Arguments) -> Result<Self, Vec<Message>> {
                Self::instantiate(functions_of::<M>(), arguments)
            }

            /// What an importer has that ignored a NULL.
            pub fn null<M: Exported>() -> Self {
                Self { functions: functions_of::<M>(), instance: null_mut(), log: std::sync::Arc::default() }
            }

            /// An instance that somebody else has, to call and not to free: as a log callback knows it.
            ///
            /// # Safety
            /// The instance is NULL or from these functions, and alive for as long as this is used.
            pub unsafe fn borrowed(functions: Functions, instance: $handle) -> Borrowed<Self> {
                let importer = Self { functions, instance, log: std::sync::Arc::default() };
                Borrowed { importer, forget: |importer| importer.instance = null_mut() }
            }

            /// The functions of the library.
            pub fn functions(&self) -> &Functions {
                &self.functions
            }

            /// The instance, for calls that this type does not have.
            pub fn instance(&self) -> $handle {
                self.instance
            }
        }

        /// The functions of the standard, under their names, with the arguments of C.
        #[allow(non_snake_case, missing_docs, clippy::too_many_arguments)]
        impl Importer {
            $(
                #[allow(clippy::not_unsafe_ptr_arg_deref, reason = "see the SAFETY comment")]
                #[inline]
                pub fn $function(&self $(, $argument: $type)*) -> Status {
                    // SAFETY: the instance is NULL or alive. Pointers are passed on as they are: who uses this type
                    // passes NULL or pointers to as many values as it says, as in C.
                    Status::from_c(unsafe { (self.functions.$function)(self.instance $(, $argument)*) })
                }
            )+

            fn address_of(&self, name: &str) -> *const c_void {
                match name {
                    $(stringify!($function) => self.functions.$function as *const c_void,)+
                    _ => panic!("there is no function {name}"),
                }
            }
        }

        /// The names of the functions that work on an instance.
        pub const FUNCTIONS: &[&str] = &[$(stringify!($function)),+];
    };
}
pub(crate) use importer;
