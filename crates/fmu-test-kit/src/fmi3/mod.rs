//! The same for FMI 3.0: an instance as an importer holds it, the C functions as methods.

mod testing;

pub use fmi_abi::fmi3::Functions;
pub(crate) use testing::references;
pub use testing::{Stepped, Updated};

use crate::importer::{Log, Zero, remember_message};
use crate::{Borrowed, Message};
use fmi_abi::fmi3::types::*;
use fmu_export::{Exported, Interface};
use std::ffi::{CStr, CString, c_int};
use std::ptr::{null, null_mut};

unsafe extern "C" fn remember(
    environment: fmi3InstanceEnvironment,
    status: c_int,
    category: fmi3String,
    message: fmi3String,
) {
    // SAFETY: section 2.3.1: strings, and NULL or the log. No instance name comes with them.
    unsafe { remember_message(environment, null(), status, category, message) }
}

/// The arguments of the functions that make instances. `logger: false` passes NULL for the callback.
#[derive(Clone, Debug)]
#[allow(missing_docs, reason = "as in the standard, section 2.3.1")]
pub struct Arguments<'a> {
    pub instance_name: Option<&'a CStr>,
    pub interface: Interface,
    pub instantiation_token: Option<CString>,
    pub resource_path: Option<&'a CStr>,
    pub logger: bool,
    pub environment: bool,
    pub visible: fmi3Boolean,
    pub logging_on: fmi3Boolean,
    pub event_mode_used: fmi3Boolean,
    pub early_return_allowed: fmi3Boolean,
    pub required_intermediate_variables: &'a [fmi3ValueReference],
}

impl Arguments<'static> {
    /// What a careful importer passes, which can do little.
    pub fn new(interface: Interface, instantiation_token: &str) -> Self {
        Self {
            instance_name: Some(c"instance"),
            interface,
            instantiation_token: CString::new(instantiation_token).ok(),
            resource_path: Some(c"/tmp/fmu/resources/"),
            logger: true,
            environment: true,
            visible: fmi3False,
            logging_on: fmi3False,
            event_mode_used: fmi3False,
            early_return_allowed: fmi3False,
            required_intermediate_variables: &[],
        }
    }

    /// The same for a model in this program.
    pub fn of<M: Exported>(interface: Interface) -> Self {
        Self::new(interface, M::INFO.guid)
    }
}

/// An instance with its log; freed when dropped.
#[derive(Debug)]
pub struct Importer {
    functions: Functions,
    instance: fmi3Instance,
    log: Box<Log>,
}

// SAFETY: an instance may be used from any one thread at a time (masters have thread pools).
unsafe impl Send for Importer {}

impl Drop for Importer {
    fn drop(&mut self) {
        // SAFETY: NULL, or made by the library and freed only here.
        unsafe { (self.functions.fmi3FreeInstance)(self.instance) }
    }
}

impl Importer {
    /// `fmi3InstantiateModelExchange` or `fmi3InstantiateCoSimulation`.
    ///
    /// # Errors
    /// What was logged, if there is no instance.
    pub fn instantiate(functions: Functions, arguments: &Arguments) -> Result<Self, Vec<Message>> {
        let log = Box::<Log>::default();
        let pointer = |text: Option<&CStr>| text.map_or(null(), CStr::as_ptr);
        let name = pointer(arguments.instance_name);
        let token = pointer(arguments.instantiation_token.as_deref());
        let resources = pointer(arguments.resource_path);
        let environment = match arguments.environment {
            true => (&raw const *log).cast_mut().cast(),
            false => null_mut(),
        };
        let callback = arguments.logger.then_some(remember as fmi3LogMessageCallback);
        let required = arguments.required_intermediate_variables;
        // SAFETY: NULL or living values, all of them.
        let instance = unsafe {
            match arguments.interface {
                Interface::ModelExchange => (functions.fmi3InstantiateModelExchange)(
                    name,
                    token,
                    resources,
                    arguments.visible,
                    arguments.logging_on,
                    environment,
                    callback,
                ),
                Interface::CoSimulation => (functions.fmi3InstantiateCoSimulation)(
                    name,
                    token,
                    resources,
                    arguments.visible,
                    arguments.logging_on,
                    arguments.event_mode_used,
                    arguments.early_return_allowed,
                    required.as_ptr(),
                    required.len(),
                    environment,
                    callback,
                    None,
                ),
            }
        };
        if instance.is_null() { Err(log.take()) } else { Ok(Self { functions, instance, log }) }
    }

    /// A fresh instance of a model in this program.
    ///
    /// # Panics
    /// When there is none.
    pub fn of<M: Exported>(interface: Interface) -> Self {
        Self::with::<M>(&Arguments::of::<M>(interface))
    }

    /// A fresh instance of a model in this program that is made like this.
    ///
    /// # Panics
    /// When there is none.
    pub fn with<M: Exported>(arguments: &Arguments) -> Self {
        Self::instantiate(fmu_export::fmi3::functions::<M>(), arguments)
            .unwrap_or_else(|log| panic!("there is no instance: {log:?}"))
    }

    /// An instance that somebody else has, to call and not to free: as a log callback knows it.
    ///
    /// # Safety
    /// The instance is NULL or from these functions, and alive for as long as this is used.
    pub unsafe fn borrowed(functions: Functions, instance: fmi3Instance) -> Borrowed<Self> {
        let importer = Self { functions, instance, log: Box::default() };
        Borrowed { importer, forget: |importer| importer.instance = null_mut() }
    }

    /// What an importer has that ignored a NULL.
    pub fn null(functions: Functions) -> Self {
        Self { functions, instance: null_mut(), log: Box::default() }
    }

    /// The functions of the library.
    pub fn functions(&self) -> &Functions {
        &self.functions
    }

    /// The instance, for calls that this type does not have.
    pub fn instance(&self) -> fmi3Instance {
        self.instance
    }

    /// The messages since the last call of this.
    pub fn take_log(&self) -> Vec<Message> {
        self.log.take()
    }
}

macro_rules! methods {
    (
        $standard:ident $handle:ident
        without an instance { $($free:ident($($free_argument:ident: $free_type:ty),*) -> $result:ty;)+ }
        with an instance {
            $($function:ident $cs:literal $me:literal $tolerated:literal ($($argument:ident: $type:ty),*);)+
        }
    ) => {
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

            /// Calls the one of this name, with zeros and NULL for arguments.
            ///
            /// # Panics
            /// When there is none.
            pub fn call_with_zeros(&self, name: &str) -> Status {
                match name {
                    $(stringify!($function) => self.$function($(<$type as Zero>::ZERO),*),)+
                    _ => panic!("there is no function {name}"),
                }
            }

            /// Calls each of them, with zeros and NULL for arguments.
            pub fn call_all(&self) -> Vec<(&'static str, Status)> {
                vec![$((stringify!($function), self.$function($(<$type as Zero>::ZERO),*))),+]
            }
        }

        /// The names of the functions that work on an instance.
        pub const FUNCTIONS: &[&str] = &[$(stringify!($function)),+];
    };
}

fmi_abi::fmi3_functions!(methods);
