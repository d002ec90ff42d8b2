//! A Co-Simulation instance, whichever the edition of the standard.

use crate::description::Description;
use crate::fmu::{Fmu, Library};
use crate::{Arguments, Functions, Importer, Message, fmi3};
use fmu_export::fmi2::types::*;
use fmu_export::fmi3::types::*;
use fmu_export::{BaseType, Interface};
use std::ffi::{CStr, CString};

/// What an instance answered instead of OK: the function, and what it logged. In a box, as it is seldom made and each call
/// may answer with it.
pub(super) type Refusal = Box<Refused>;

#[derive(Debug)]
pub(super) struct Refused {
    function: &'static str,
    status: Status,
    log: Vec<Message>,
    /// When the FMU has ended the simulation, if that is what it wants.
    pub ended: Option<f64>,
}

impl Refused {
    /// After it no function may be called, not even to free the instance (section 2.1.3 of FMI 2.0).
    pub fn is_fatal(&self) -> bool {
        self.status == Status::Fatal
    }

    /// Whether it comes without a reason.
    pub fn is_silent(&self) -> bool {
        self.log.is_empty() && self.ended.is_none()
    }
}

impl std::fmt::Display for Refused {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let message = reason(&self.log);
        if let Some(time) = self.ended {
            write!(f, "ended by the FMU at t = {time} s")?;
            return message.map_or(Ok(()), |message| write!(f, ": {}", message.text.trim()));
        }
        match message {
            // Some FMUs name the function, some do not.
            Some(message) if message.text.contains(self.function) => f.write_str(message.text.trim()),
            Some(message) => write!(f, "{}: {}", self.function, message.text.trim()),
            None => write!(f, "{} was answered with {:?}, without a message", self.function, self.status),
        }
    }
}

/// What of a log tells why something was refused.
pub(super) fn reason(log: &[Message]) -> Option<&Message> {
    let grave = log.iter().rev().find(|message| message.status as i32 >= Status::Discard as i32);
    grave.or(log.last())
}

/// The calls of a run. Each that returns a `Status` accepts OK and Warning.
pub(super) trait Slave: Sized {
    /// An instance, or what was logged instead.
    fn instantiate(fmu: &Fmu, logging_on: bool) -> Result<Self, Vec<Message>>;
    fn forget_log(&self);
    fn set_up(&self, start_time: f64, stop_time: f64) -> Result<(), Refusal>;
    fn initialize(&self, start_time: f64, stop_time: f64) -> Result<(), Refusal>;
    fn initialized(&self) -> Result<(), Refusal>;
    fn set_reals(&self, vr: &[u32], values: &[f64]) -> Result<(), Refusal>;
    fn get_reals(&self, vr: &[u32], values: &mut [f64]) -> Result<(), Refusal>;
    fn set_number(&self, base: BaseType, vr: u32, value: f64) -> Result<(), Refusal>;
    fn get_number(&self, base: BaseType, vr: u32) -> Result<f64, Refusal>;
    fn set_text(&self, vr: u32, value: &CStr) -> Result<(), Refusal>;
    fn set_input_derivatives(&self, vr: &[u32], orders: &[i32], values: &[f64]) -> Result<(), Refusal>;
    /// Refused also where the FMU ends the simulation.
    fn step(&self, time: f64, size: f64) -> Result<(), Refusal>;
    fn terminate(&self) -> Result<(), Refusal>;
    fn reset(&self) -> Result<(), Refusal>;
}

/// One call; what it logged goes with its refusal.
macro_rules! call {
    ($importer:expr, $function:ident ( $($argument:expr),* )) => {{
        let status = $importer.$function($($argument),*);
        if status == Status::Ok { Ok(()) } else { not_ok(stringify!($function), status, $importer.take_log()) }
    }};
}

/// A warning is forgotten: it must not be taken for the reason of something later.
#[cold]
fn not_ok(function: &'static str, status: Status, log: Vec<Message>) -> Result<(), Refusal> {
    if status == Status::Warning { Ok(()) } else { Err(refusal(function, status, log)) }
}

#[cold]
fn refusal(function: &'static str, status: Status, log: Vec<Message>) -> Refusal {
    Box::new(Refused { function, status, log, ended: None })
}

fn token(description: &Description) -> Option<CString> {
    CString::new(description.token.as_str()).ok()
}

impl Slave for Importer {
    fn instantiate(fmu: &Fmu, logging_on: bool) -> Result<Self, Vec<Message>> {
        let Library::Fmi2(library) = &fmu.library else { unreachable!("the library is of FMI 2.0") };
        let arguments = Arguments {
            guid: token(fmu.description()),
            resource_location: Some(&fmu.resources),
            logging_on,
            ..Arguments::new(Interface::CoSimulation, "")
        };
        let functions: Functions = library.functions;
        Importer::instantiate(functions, &arguments)
    }

    fn forget_log(&self) {
        self.take_log();
    }

    fn set_up(&self, start_time: f64, stop_time: f64) -> Result<(), Refusal> {
        call!(self, fmi2SetupExperiment(fmi2False, 0.0, start_time, fmi2True, stop_time))
    }

    fn initialize(&self, _: f64, _: f64) -> Result<(), Refusal> {
        call!(self, fmi2EnterInitializationMode())
    }

    fn initialized(&self) -> Result<(), Refusal> {
        call!(self, fmi2ExitInitializationMode())
    }

    #[inline]
    fn set_reals(&self, vr: &[u32], values: &[f64]) -> Result<(), Refusal> {
        debug_assert_eq!(vr.len(), values.len());
        call!(self, fmi2SetReal(vr.as_ptr(), vr.len(), values.as_ptr()))
    }

    #[inline]
    fn get_reals(&self, vr: &[u32], values: &mut [f64]) -> Result<(), Refusal> {
        debug_assert_eq!(vr.len(), values.len());
        call!(self, fmi2GetReal(vr.as_ptr(), vr.len(), values.as_mut_ptr()))
    }

    fn set_number(&self, base: BaseType, vr: u32, value: f64) -> Result<(), Refusal> {
        match base {
            BaseType::Real => call!(self, fmi2SetReal(&vr, 1, &value)),
            BaseType::Boolean => call!(self, fmi2SetBoolean(&vr, 1, &fmi2Boolean::from(value != 0.0))),
            _ => call!(self, fmi2SetInteger(&vr, 1, &(value as i32))),
        }
    }

    fn get_number(&self, base: BaseType, vr: u32) -> Result<f64, Refusal> {
        let (mut real, mut integer) = (0.0, 0);
        match base {
            BaseType::Real => call!(self, fmi2GetReal(&vr, 1, &mut real)).map(|()| real),
            BaseType::Boolean => call!(self, fmi2GetBoolean(&vr, 1, &mut integer)).map(|()| integer.into()),
            _ => call!(self, fmi2GetInteger(&vr, 1, &mut integer)).map(|()| integer.into()),
        }
    }

    fn set_text(&self, vr: u32, value: &CStr) -> Result<(), Refusal> {
        call!(self, fmi2SetString(&vr, 1, &value.as_ptr()))
    }

    #[inline]
    fn set_input_derivatives(&self, vr: &[u32], orders: &[i32], values: &[f64]) -> Result<(), Refusal> {
        call!(self, fmi2SetRealInputDerivatives(vr.as_ptr(), vr.len(), orders.as_ptr(), values.as_ptr()))
    }

    #[inline]
    fn step(&self, time: f64, size: f64) -> Result<(), Refusal> {
        call!(self, fmi2DoStep(time, size, fmi2True)).map_err(|refusal| ended(self, refusal, time))
    }

    fn terminate(&self) -> Result<(), Refusal> {
        call!(self, fmi2Terminate())
    }

    fn reset(&self) -> Result<(), Refusal> {
        call!(self, fmi2Reset())
    }
}

/// The numbers of FMI 3.0 with their functions.
macro_rules! numbers {
    ($with:ident: $($before:tt)*) => { $with! { $($before)*;
        Real fmi3SetFloat64 fmi3GetFloat64 f64
        Float32 fmi3SetFloat32 fmi3GetFloat32 f32
        Integer fmi3SetInt32 fmi3GetInt32 i32
        Int8 fmi3SetInt8 fmi3GetInt8 i8
        UInt8 fmi3SetUInt8 fmi3GetUInt8 u8
        Int16 fmi3SetInt16 fmi3GetInt16 i16
        UInt16 fmi3SetUInt16 fmi3GetUInt16 u16
        UInt32 fmi3SetUInt32 fmi3GetUInt32 u32
        Int64 fmi3SetInt64 fmi3GetInt64 i64
        UInt64 fmi3SetUInt64 fmi3GetUInt64 u64
        Enumeration fmi3SetInt64 fmi3GetInt64 i64
    } };
}

macro_rules! set {
    ($self:ident $base:ident $vr:ident $value:ident; $($name:ident $set:ident $get:ident $type:ident)+) => {
        match $base {
            $(BaseType::$name => call!($self, $set(&$vr, 1, &($value as $type), 1)),)+
            _ => call!($self, fmi3SetBoolean(&$vr, 1, &fmi3Boolean::from($value != 0.0), 1)),
        }
    };
}

macro_rules! get {
    ($self:ident $base:ident $vr:ident; $($name:ident $set:ident $get:ident $type:ident)+) => {
        match $base {
            $(BaseType::$name => {
                let mut value = $type::default();
                call!($self, $get(&$vr, 1, &mut value, 1)).map(|()| value as f64)
            })+
            _ => {
                let mut value = fmi3False;
                call!($self, fmi3GetBoolean(&$vr, 1, &mut value, 1)).map(|()| f64::from(value != fmi3False))
            }
        }
    };
}

impl Slave for fmi3::Importer {
    fn instantiate(fmu: &Fmu, logging_on: bool) -> Result<Self, Vec<Message>> {
        let Library::Fmi3(library) = &fmu.library else { unreachable!("the library is of FMI 3.0") };
        let arguments = fmi3::Arguments {
            instantiation_token: token(fmu.description()),
            resource_path: Some(&fmu.resources),
            logging_on: logging_on.into(),
            ..fmi3::Arguments::new(Interface::CoSimulation, "")
        };
        fmi3::Importer::instantiate(library.functions, &arguments)
    }

    fn forget_log(&self) {
        self.take_log();
    }

    fn set_up(&self, _: f64, _: f64) -> Result<(), Refusal> {
        Ok(())
    }

    fn initialize(&self, start_time: f64, stop_time: f64) -> Result<(), Refusal> {
        call!(self, fmi3EnterInitializationMode(fmi3False, 0.0, start_time, fmi3True, stop_time))
    }

    fn initialized(&self) -> Result<(), Refusal> {
        call!(self, fmi3ExitInitializationMode())
    }

    #[inline]
    fn set_reals(&self, vr: &[u32], values: &[f64]) -> Result<(), Refusal> {
        call!(self, fmi3SetFloat64(vr.as_ptr(), vr.len(), values.as_ptr(), values.len()))
    }

    #[inline]
    fn get_reals(&self, vr: &[u32], values: &mut [f64]) -> Result<(), Refusal> {
        call!(self, fmi3GetFloat64(vr.as_ptr(), vr.len(), values.as_mut_ptr(), values.len()))
    }

    fn set_number(&self, base: BaseType, vr: u32, value: f64) -> Result<(), Refusal> {
        numbers!(set: self base vr value)
    }

    fn get_number(&self, base: BaseType, vr: u32) -> Result<f64, Refusal> {
        numbers!(get: self base vr)
    }

    fn set_text(&self, vr: u32, value: &CStr) -> Result<(), Refusal> {
        call!(self, fmi3SetString(&vr, 1, &value.as_ptr(), 1))
    }

    fn set_input_derivatives(&self, _: &[u32], _: &[i32], _: &[f64]) -> Result<(), Refusal> {
        unreachable!("FMI 3.0 has no input derivatives, which the description tells")
    }

    #[inline]
    fn step(&self, time: f64, size: f64) -> Result<(), Refusal> {
        let (mut event, mut terminate, mut early, mut reached) = (0, 0, 0, time);
        call!(self, fmi3DoStep(time, size, fmi3True, &mut event, &mut terminate, &mut early, &mut reached))?;
        match (terminate != fmi3False, early != fmi3False) {
            (false, false) => Ok(()),
            (wanted, _) => Err(stopped(self, wanted, reached)),
        }
    }

    fn terminate(&self) -> Result<(), Refusal> {
        call!(self, fmi3Terminate())
    }

    fn reset(&self) -> Result<(), Refusal> {
        call!(self, fmi3Reset())
    }
}

/// A step that was discarded may be the end that the FMU wants (section 4.2.3 of FMI 2.0).
#[cold]
fn ended(importer: &Importer, mut refusal: Refusal, time: f64) -> Refusal {
    let (mut wanted, mut reached) = (fmi2False, time);
    let kinds = [StatusKind::Terminated, StatusKind::LastSuccessfulTime].map(|kind| kind as fmi2StatusKind);
    if refusal.status != Status::Discard
        || importer.fmi2GetBooleanStatus(kinds[0], &mut wanted) != Status::Ok
        || wanted == fmi2False
    {
        return refusal;
    }
    let told = importer.fmi2GetRealStatus(kinds[1], &mut reached) == Status::Ok && reached.is_finite();
    refusal.ended = Some(if told { reached } else { time });
    refusal
}

/// The end that the FMU wants, or an early return, which it has not been allowed (section 4.2.1 of FMI 3.0).
#[cold]
fn stopped(importer: &fmi3::Importer, wanted: bool, reached: f64) -> Refusal {
    let mut refusal = refusal("fmi3DoStep", Status::Discard, importer.take_log());
    if wanted {
        refusal.ended = Some(reached);
    } else {
        let text = format!("the step ended early, at {reached} s");
        let [instance_name, category] = Default::default();
        refusal.log.push(Message { instance_name, status: Status::Discard, category, text });
    }
    refusal
}
