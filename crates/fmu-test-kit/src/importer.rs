//! An instance as an importer holds it: the C functions as methods.

use crate::library::functions_of;
use fmi_abi::fmi2::Functions;
use fmi_abi::fmi2::types::*;
use fmu_export::{Exported, Interface};
use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::ops::Deref;
use std::ptr::{null, null_mut};
use std::sync::Mutex;

/// What the logger was told.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Message {
    /// The name of the instance.
    pub instance_name: String,
    /// The status that goes with it.
    pub status: Status,
    /// One of the log categories.
    pub category: String,
    /// The text.
    pub text: String,
}

/// The importer's log; its address is the component environment.
#[derive(Debug, Default)]
pub(crate) struct Log(Mutex<Vec<Message>>);

impl Log {
    pub(crate) fn take(&self) -> Vec<Message> {
        std::mem::take(&mut self.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner))
    }
}

/// The logger without its `...`, which stable Rust cannot define. The FMU may pass variadic arguments, which are not
/// looked at; named ones travel the same way in variadic and plain calls on every platform of this project.
unsafe extern "C" fn remember(
    environment: fmi2ComponentEnvironment,
    instance_name: fmi2String,
    status: c_int,
    category: fmi2String,
    message: fmi2String,
) {
    // SAFETY: section 2.1.5: NULL or zero-terminated strings, and NULL or the log.
    unsafe { remember_message(environment, instance_name, status, category, message) }
}

/// # Safety
/// The environment is NULL or a `Log` that lives, the texts are NULL or strings.
pub(crate) unsafe fn remember_message(
    environment: *mut c_void,
    instance_name: *const c_char,
    status: c_int,
    category: *const c_char,
    message: *const c_char,
) {
    // SAFETY: the caller's promise.
    let text = |pointer: fmi2String| match unsafe { pointer.as_ref() } {
        // SAFETY: not NULL, and a string.
        Some(_) => unsafe { CStr::from_ptr(pointer) }.to_string_lossy().into_owned(),
        None => String::new(),
    };
    let status = Status::from_c(status);
    let [instance_name, category, text] = [instance_name, category, message].map(text);
    // SAFETY: NULL or the `Log` that was handed to fmi2Instantiate and lives as long as the instance.
    if let Some(log) = unsafe { environment.cast::<Log>().as_ref() } {
        let mut messages = log.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        messages.push(Message { instance_name, status, category, text });
    }
}

/// The arguments of `fmi2Instantiate`. `callbacks: false` passes NULL instead of the structure, `logger: false` a
/// structure without logger, `environment: false` one without environment (messages are then read and forgotten).
#[derive(Clone, Debug)]
#[allow(missing_docs, reason = "as in the standard, section 2.1.5")]
pub struct Arguments<'a> {
    pub instance_name: Option<&'a CStr>,
    pub fmu_type: fmi2Type,
    pub guid: Option<CString>,
    pub resource_location: Option<&'a CStr>,
    pub callbacks: bool,
    pub logger: bool,
    pub environment: bool,
    pub visible: bool,
    pub logging_on: bool,
}

impl Arguments<'static> {
    /// What a careful importer passes.
    pub fn new(interface: Interface, guid: &str) -> Self {
        Self {
            instance_name: Some(c"instance"),
            fmu_type: interface as fmi2Type,
            guid: CString::new(guid).ok(),
            resource_location: Some(c"file:///tmp/fmu/resources"),
            callbacks: true,
            logger: true,
            environment: true,
            visible: false,
            logging_on: false,
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
    component: fmi2Component,
    log: Box<Log>,
}

// SAFETY: an instance may be used from any one thread at a time (masters have thread pools).
unsafe impl Send for Importer {}

impl Drop for Importer {
    fn drop(&mut self) {
        // SAFETY: NULL, or from fmi2Instantiate and freed only here.
        unsafe { (self.functions.fmi2FreeInstance)(self.component) }
    }
}

impl Importer {
    /// `fmi2Instantiate`. The callbacks structure and the instance name are overwritten afterwards: the FMU must have
    /// copied them.
    ///
    /// # Errors
    /// What was logged, if there is no instance.
    pub fn instantiate(functions: Functions, arguments: &Arguments) -> Result<Self, Vec<Message>> {
        let log = Box::<Log>::default();
        let pointer = |text: Option<&CStr>| text.map_or(null(), CStr::as_ptr);
        let mut name = arguments.instance_name.map(|name| name.to_bytes_with_nul().to_vec());
        let remember: unsafe extern "C" fn(_, _, _, _, _) = remember;
        let mut callbacks = fmi2CallbackFunctions {
            // SAFETY: see `remember`.
            logger: arguments
                .logger
                .then(|| unsafe { std::mem::transmute::<_, fmi2CallbackLogger>(remember) }),
            allocate_memory: None,
            free_memory: None,
            step_finished: None,
            component_environment: match arguments.environment {
                true => (&raw const *log).cast_mut().cast(),
                false => null_mut(),
            },
        };
        // SAFETY: NULL or living values, all of them.
        let component = unsafe {
            (functions.fmi2Instantiate)(
                name.as_ref().map_or(null(), |name| name.as_ptr().cast()),
                arguments.fmu_type,
                pointer(arguments.guid.as_deref()),
                pointer(arguments.resource_location),
                if arguments.callbacks { &raw const callbacks } else { null() },
                arguments.visible.into(),
                arguments.logging_on.into(),
            )
        };
        callbacks.logger = None;
        callbacks.component_environment = null_mut();
        if let Some(name) = &mut name {
            name.fill(b'X');
        }
        std::hint::black_box((&callbacks, &name));
        if component.is_null() { Err(log.take()) } else { Ok(Self { functions, component, log }) }
    }

    /// A fresh instance of a model in this program (see [`functions_of`]).
    ///
    /// # Panics
    /// When there is none.
    pub fn of<M: Exported>(interface: Interface) -> Self {
        Self::instantiate(functions_of::<M>(), &Arguments::of::<M>(interface))
            .unwrap_or_else(|log| panic!("there is no instance: {log:?}"))
    }

    /// An instance that somebody else has, to call and not to free: as a log callback knows it.
    ///
    /// # Safety
    /// The component is NULL or from these functions, and alive for as long as this is used.
    pub unsafe fn borrowed(functions: Functions, component: fmi2Component) -> Borrowed<Self> {
        let importer = Self { functions, component, log: Box::default() };
        Borrowed { importer, forget: |importer| importer.component = null_mut() }
    }

    /// What an importer has that ignored a NULL from `fmi2Instantiate`.
    pub fn null(functions: Functions) -> Self {
        Self { functions, component: null_mut(), log: Box::default() }
    }

    /// The functions of the library.
    pub fn functions(&self) -> &Functions {
        &self.functions
    }

    /// The component, for calls that this type does not have.
    pub fn component(&self) -> fmi2Component {
        self.component
    }

    /// The messages since the last call of this.
    pub fn take_log(&self) -> Vec<Message> {
        self.log.take()
    }

    /// What needs no instance: version and platform (section 2.1.4).
    pub fn version_and_platform(&self) -> [&CStr; 2] {
        let Functions { fmi2GetVersion, fmi2GetTypesPlatform, .. } = self.functions;
        // SAFETY: both give strings that the library keeps.
        [fmi2GetVersion, fmi2GetTypesPlatform].map(|text| unsafe { CStr::from_ptr(text()) })
    }
}

/// An instance of either standard that somebody else frees, see [`Importer::borrowed`].
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

/// 0, or NULL.
pub(crate) trait Zero {
    const ZERO: Self;
}

macro_rules! zero {
    ($($type:ty: $zero:expr),+) => { $(impl Zero for $type { const ZERO: Self = $zero; })+ };
}

zero!(u8: 0, i32: 0, u32: 0, usize: 0, f64: 0.0);

impl<T> Zero for *const T {
    const ZERO: Self = null();
}

impl<T> Zero for *mut T {
    const ZERO: Self = null_mut();
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
        #[allow(non_snake_case, missing_docs)]
        impl Importer {
            $(
                #[allow(clippy::not_unsafe_ptr_arg_deref, reason = "see the SAFETY comment")]
                #[inline]
                pub fn $function(&self $(, $argument: $type)*) -> Status {
                    // SAFETY: the component is NULL or alive. Pointers are passed on as they are: who uses this type
                    // passes NULL or pointers to as many values as it says, as in C.
                    Status::from_c(unsafe { (self.functions.$function)(self.component $(, $argument)*) })
                }
            )+

            /// Calls each of them, with zeros and NULL for arguments.
            pub fn call_all(&self) -> Vec<(&'static str, Status)> {
                vec![$((stringify!($function), self.$function($(<$type as Zero>::ZERO),*))),+]
            }
        }

        /// The names of the functions that work on an instance.
        pub const FUNCTIONS: &[&str] = &[$(stringify!($function)),+];
    };
}

fmi_abi::fmi2_functions!(methods);
