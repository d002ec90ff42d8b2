//! An instance of a model, used as an importer does.
//!
//! Instances are of FMI 3.0, which has all types. Only derivatives of inputs, which FMI 3.0 lacks, need an instance of FMI 2.0.
#![allow(unsafe_code, reason = "C functions are called")]

use crate::model::{Group, LoadedModel};
use crate::table::Variable;
use fmi_abi::c_types::{c_char, c_int, c_void};
use fmi_abi::fmi2::types::fmi2CallbackFunctions;
use fmi_abi::fmi3::types::fmi3LogMessageCallback;
use fmi_abi::{BaseType, Interface, Standard, Status, Value};
use std::cell::RefCell;
use std::ffi::{CStr, CString};
use std::ptr::{null, null_mut};

/// The result of a call, with the message of the model if it rejects the call.
pub(crate) type Outcome<T = ()> = Result<T, String>;

/// An instance, which owns its saved states.
pub(crate) struct Instance<'a> {
    model: &'a LoadedModel,
    pub interface: Interface,
    standard: Standard,
    event_mode: bool,
    handle: *mut c_void,
    /// The last message that the model logged.
    message: Box<RefCell<String>>,
    pub time: f64,
}

/// A saved state of an instance, and its time.
#[derive(Clone, Copy)]
pub(crate) struct Saved {
    state: *mut c_void,
    pub time: f64,
}

/// Maximum number of iterations of an event. A model that needs more is in an endless loop.
const MOST_ROUNDS: usize = 10_000;

/// Calls a function of the library: of the FMI version of the instance, with the same arguments or with others, or of one version.
macro_rules! call {
    ($self:ident, $fmi2:ident, $fmi3:ident ($($argument:expr),*)) => {
        call!($self, $fmi2($($argument),*), $fmi3($($argument),*))
    };
    ($self:ident, $fmi2:ident($($two:expr),*), $fmi3:ident($($three:expr),*)) => {
        match $self.standard {
            Standard::Fmi2 => call!($self, fmi2.$fmi2($($two),*)),
            Standard::Fmi3 => call!($self, fmi3.$fmi3($($three),*)),
        }
    };
    ($self:ident, $version:ident.$function:ident($($argument:expr),*)) => {{
        // SAFETY: a living instance of this library, and arguments as the standard requires: pointers to values of the calling
        // function, arrays with their lengths.
        let code = unsafe { ($self.model.$version.$function)($self.handle, $($argument),*) };
        $self.outcome(code)
    }};
    ($self:ident, $fmi3:ident($($three:expr),*)) => {
        call!($self, fmi3.$fmi3($($three),*))
    };
}

impl<'a> Instance<'a> {
    /// Makes an instance. In Co-Simulation of FMI 3.0, it may have an event mode.
    pub fn new(
        model: &'a LoadedModel,
        interface: Interface,
        standard: Standard,
        event_mode: bool,
    ) -> Outcome<Self> {
        let token = CString::new(model.guid()).map_err(|_| "its guid has a NUL".to_owned())?;
        let (name, token) = (c"instance".as_ptr(), token.as_ptr());
        let message = Box::new(RefCell::new(String::new()));
        let environment = (&raw const *message).cast_mut().cast();
        let log: Option<fmi3LogMessageCallback> = Some(remember);
        let callbacks = fmi2CallbackFunctions {
            logger: None,
            allocate_memory: None,
            free_memory: None,
            step_finished: None,
            component_environment: null_mut(),
        };
        let (kind, resources, events) = (interface as c_int, model.resources(), event_mode.into());
        // SAFETY: strings and a callback that live as long as the instance, or NULL.
        let handle = unsafe {
            match (standard, interface) {
                (Standard::Fmi2, _) => {
                    let callbacks = &raw const callbacks;
                    (model.fmi2.fmi2Instantiate)(name, kind, token, resources, callbacks, 0, 0)
                }
                (Standard::Fmi3, Interface::ModelExchange) => {
                    let instantiate = model.fmi3.fmi3InstantiateModelExchange;
                    instantiate(name, token, resources, 0, 0, environment, log)
                }
                (Standard::Fmi3, Interface::CoSimulation) => {
                    let instantiate = model.fmi3.fmi3InstantiateCoSimulation;
                    instantiate(name, token, resources, 0, 0, events, 1, null(), 0, environment, log, None)
                }
            }
        };
        if handle.is_null() {
            return Err(message.take());
        }
        Ok(Self { model, interface, standard, event_mode, handle, message, time: 0.0 })
    }

    fn outcome(&self, code: c_int) -> Outcome {
        match Status::from_c(code) {
            Status::Ok | Status::Warning => Ok(()),
            _ => Err(self.message.take()),
        }
    }

    pub fn initialize(&mut self, start: f64, stop: Option<f64>, tolerance: Option<f64>) -> Outcome {
        let given = [stop, tolerance].map(|value| (value.is_some(), value.unwrap_or_default()));
        let [(with_stop, stop), (with_tolerance, tolerance)] = given;
        self.time = start;
        if self.standard == Standard::Fmi3 {
            return call!(
                self,
                fmi3EnterInitializationMode(with_tolerance.into(), tolerance, start, with_stop.into(), stop)
            );
        }
        call!(
            self,
            fmi2.fmi2SetupExperiment(with_tolerance.into(), tolerance, start, with_stop.into(), stop)
        )?;
        call!(self, fmi2.fmi2EnterInitializationMode())
    }

    pub fn initialized(&mut self) -> Outcome {
        call!(self, fmi2ExitInitializationMode, fmi3ExitInitializationMode())
    }

    /// Leaves Event Mode after the initialization, without an event, which would change discrete variables.
    pub fn run(&mut self) -> Outcome {
        match self.interface {
            Interface::ModelExchange => call!(self, fmi3EnterContinuousTimeMode()),
            Interface::CoSimulation if self.event_mode => call!(self, fmi3EnterStepMode()),
            Interface::CoSimulation => Ok(()),
        }
    }

    /// Iterates the event in Model Exchange, and enters Continuous-Time Mode.
    pub fn handle_event(&mut self) -> Outcome {
        let mut again = 1;
        for _ in 0..MOST_ROUNDS {
            let (mut terminate, mut ignored, mut next) = (0, [0; 3], 0.0);
            let [nominals, states, is_next] = &mut ignored;
            call!(
                self,
                fmi3UpdateDiscreteStates(
                    &raw mut again,
                    &raw mut terminate,
                    nominals,
                    states,
                    is_next,
                    &raw mut next
                )
            )?;
            if terminate != 0 {
                return Err("the model ends the simulation".to_owned());
            }
            if again == 0 {
                return call!(self, fmi3EnterContinuousTimeMode());
            }
        }
        Err(format!("the event does not come to an end in {MOST_ROUNDS} rounds"))
    }

    pub fn enter_event_mode(&mut self) -> Outcome {
        call!(self, fmi3EnterEventMode())
    }

    pub fn set_time(&mut self, time: f64) -> Outcome {
        call!(self, fmi3SetTime(time))?;
        self.time = time;
        Ok(())
    }

    /// Makes a step of Co-Simulation. Returns false if the model ends the simulation.
    pub fn step(&mut self, size: f64) -> Outcome<bool> {
        let (point, mut end) = (self.time, self.time + size);
        let (mut event, mut terminate, mut early) = (0, 0, 0);
        call!(
            self,
            fmi2DoStep(point, size, 0),
            fmi3DoStep(point, size, 0, &raw mut event, &raw mut terminate, &raw mut early, &raw mut end)
        )?;
        self.time = end;
        Ok(terminate == 0)
    }

    pub fn step_completed(&mut self) -> Outcome {
        let (mut event, mut terminate) = (0, 0);
        call!(self, fmi3CompletedIntegratorStep(0, &raw mut event, &raw mut terminate))
    }

    /// Sets first time derivatives of inputs, in FMI 2.0 only.
    pub fn set_input_derivatives(&mut self, indices: &[u32], values: &[f64]) -> Outcome {
        if self.standard != Standard::Fmi2 || indices.is_empty() {
            return Ok(());
        }
        let orders = vec![1; indices.len()];
        let (orders, values) = (orders.as_ptr(), values.as_ptr());
        call!(self, fmi2.fmi2SetRealInputDerivatives(indices.as_ptr(), indices.len(), orders, values))
    }

    /// Sets the variables that are selected and have a value, arrays as a whole. Variables of a type are set together. Values must
    /// fit together after each call, so a type that the model rejects is set again after the others.
    pub fn set(&mut self, values: &[Option<Value>], is_selected: impl Fn(&Variable) -> bool) -> Outcome {
        let variables = &self.model.table.variables;
        let mut chosen: Vec<bool> = variables
            .iter()
            .zip(values)
            .map(|(variable, value)| value.is_some() && is_selected(variable))
            .collect();
        for (first, variable) in variables
            .iter()
            .enumerate()
            .filter(|(_, variable)| variable.element == 0 && variable.length() > 1)
        {
            let array = &mut chosen[first..first + variable.length()];
            let any = array.contains(&true);
            array.fill(any);
        }
        let is_set = |index: &u32| chosen[*index as usize];
        let mut open: Vec<_> =
            self.model.groups.iter().filter(|group| group.indices.iter().any(&is_set)).collect();
        loop {
            let before = open.len();
            let mut rejected = None;
            open.retain(|group| {
                let indices: Vec<u32> = group.indices.iter().copied().filter(&is_set).collect();
                let values: Vec<&Value> = indices.iter().flat_map(|index| &values[*index as usize]).collect();
                let outcome = self.set_values(group.base, &self.references(&indices), &values);
                let is_rejected = outcome.is_err();
                rejected = outcome.err().or(rejected.take());
                is_rejected
            });
            match rejected {
                None => return Ok(()),
                Some(message) if open.len() == before => return Err(message),
                Some(_) => {}
            }
        }
    }

    /// Returns the value references of variables; in FMI 3.0, an array has the reference of its first element.
    fn references(&self, indices: &[u32]) -> Vec<u32> {
        let has_reference = |index: &&u32| {
            self.standard == Standard::Fmi2
                || self.model.table.variable(**index).is_none_or(|variable| variable.element == 0)
        };
        indices.iter().filter(has_reference).map(|index| self.standard.reference(*index)).collect()
    }

    fn set_values(&self, base: BaseType, vr: &[u32], values: &[&Value]) -> Outcome {
        let (vr, count) = ((vr.as_ptr(), vr.len()), values.len());
        macro_rules! array {
            ($kind:ident as $type:ty) => {
                values
                    .iter()
                    .map(|value| match value {
                        Value::$kind(value) => *value as $type,
                        _ => <$type>::default(),
                    })
                    .collect::<Vec<$type>>()
                    .as_ptr()
            };
        }
        macro_rules! set {
            ($kind:ident as $type:ty, $fmi3:ident) => {
                call!(self, $fmi3(vr.0, vr.1, array!($kind as $type), count))
            };
            ($kind:ident as $two:ty, $fmi2:ident, $three:ty, $fmi3:ident) => {
                call!(
                    self,
                    $fmi2(vr.0, vr.1, array!($kind as $two)),
                    $fmi3(vr.0, vr.1, array!($kind as $three), count)
                )
            };
        }
        match base {
            BaseType::Real => set!(Real as f64, fmi2SetReal, f64, fmi3SetFloat64),
            BaseType::Integer => set!(Integer as i32, fmi2SetInteger, i32, fmi3SetInt32),
            BaseType::Enumeration => set!(Integer as i32, fmi2SetInteger, i64, fmi3SetInt64),
            BaseType::Boolean => set!(Boolean as i32, fmi2SetBoolean, u8, fmi3SetBoolean),
            BaseType::String => self.set_strings(vr, values),
            _ if self.standard == Standard::Fmi2 => Ok(()),
            BaseType::Float32 => set!(Real as f32, fmi3SetFloat32),
            BaseType::Int8 => set!(Integer as i8, fmi3SetInt8),
            BaseType::UInt8 => set!(Integer as u8, fmi3SetUInt8),
            BaseType::Int16 => set!(Integer as i16, fmi3SetInt16),
            BaseType::UInt16 => set!(Integer as u16, fmi3SetUInt16),
            BaseType::UInt32 => set!(Integer as u32, fmi3SetUInt32),
            BaseType::Int64 => set!(Integer as i64, fmi3SetInt64),
            BaseType::UInt64 => set!(Integer as u64, fmi3SetUInt64),
            BaseType::Binary => self.set_bytes(vr, values),
        }
    }

    fn set_strings(&self, vr: (*const u32, usize), values: &[&Value]) -> Outcome {
        // Strings with NUL are rejected before.
        let string = |value: &&Value| CString::new(value.to_string()).unwrap_or_default();
        let strings: Vec<CString> = values.iter().map(string).collect();
        let pointers: Vec<*const c_char> = strings.iter().map(|string| string.as_ptr()).collect();
        let values = pointers.as_ptr();
        call!(self, fmi2SetString(vr.0, vr.1, values), fmi3SetString(vr.0, vr.1, values, pointers.len()))
    }

    fn set_bytes(&self, vr: (*const u32, usize), values: &[&Value]) -> Outcome {
        let bytes = |value: &&Value| {
            if let Value::Binary(bytes) = value { (bytes.len(), bytes.as_ptr()) } else { (0, null()) }
        };
        let (sizes, bytes): (Vec<usize>, Vec<*const u8>) = values.iter().map(bytes).unzip();
        call!(self, fmi3SetBinary(vr.0, vr.1, sizes.as_ptr(), bytes.as_ptr(), bytes.len()))
    }

    /// Sets variables of type Real, arrays as a whole.
    pub fn set_reals(&mut self, indices: &[u32], values: &[f64]) -> Outcome {
        let values: Vec<Value> = values.iter().copied().map(Value::Real).collect();
        self.set_values(BaseType::Real, &self.references(indices), &values.iter().collect::<Vec<_>>())
    }

    /// Returns the values of variables of type Real, arrays as a whole; NaN for a value that the model does not return.
    pub fn reals(&mut self, indices: &[u32]) -> Vec<f64> {
        match self.get_values(BaseType::Real, &self.references(indices), indices.len()) {
            Ok(values) => values.iter().map(Value::real).collect(),
            Err(_) => {
                let all = self.values();
                indices.iter().map(|index| all[*index as usize].real()).collect()
            }
        }
    }

    /// Returns the values of all variables; NaN for a value that the model does not return.
    pub fn values(&mut self) -> Vec<Value> {
        let mut all = vec![Value::Real(f64::NAN); self.model.table.variables.len()];
        for Group { base, indices } in &self.model.groups {
            let mut read = |indices: &[u32]| {
                let values = self.get_values(*base, &self.references(indices), indices.len())?;
                indices.iter().zip(values).for_each(|(index, value)| all[*index as usize] = value);
                Outcome::Ok(())
            };
            if read(indices).is_err() {
                for index in indices.iter().filter(|index| !self.references(&[**index]).is_empty()) {
                    let _ = read(&self.array(*index));
                }
            }
        }
        all
    }

    /// The variables that are read and set together: the elements of an array in FMI 3.0.
    fn array(&self, index: u32) -> Vec<u32> {
        match self.standard {
            Standard::Fmi2 => vec![index],
            Standard::Fmi3 => self.model.table.array(index),
        }
    }

    fn get_values(&self, base: BaseType, vr: &[u32], count: usize) -> Outcome<Vec<Value>> {
        let vr = (vr.as_ptr(), vr.len());
        let to_boolean = |value: &mut Value| *value = Value::Boolean(*value != Value::Integer(0));
        macro_rules! get {
            ($kind:ident, $type:ty, |$values:ident| $call:expr) => {{
                let mut array = vec![<$type>::default(); count];
                let $values = array.as_mut_ptr();
                $call?;
                array.into_iter().map(|value| Value::$kind(value.into())).collect::<Vec<_>>()
            }};
            ($kind:ident, $type:ty, $fmi3:ident) => {
                get!($kind, $type, |values| call!(self, $fmi3(vr.0, vr.1, values, count)))
            };
            ($kind:ident, $two:ty, $fmi2:ident, $three:ty, $fmi3:ident) => {
                match self.standard {
                    Standard::Fmi2 => get!($kind, $two, |values| call!(self, fmi2.$fmi2(vr.0, vr.1, values))),
                    Standard::Fmi3 => get!($kind, $three, $fmi3),
                }
            };
        }
        Ok(match base {
            BaseType::Real => get!(Real, f64, fmi2GetReal, f64, fmi3GetFloat64),
            BaseType::Integer => get!(Integer, i32, fmi2GetInteger, i32, fmi3GetInt32),
            BaseType::Enumeration => get!(Integer, i32, fmi2GetInteger, i64, fmi3GetInt64),
            BaseType::Boolean => {
                let mut values = get!(Integer, i32, fmi2GetBoolean, u8, fmi3GetBoolean);
                values.iter_mut().for_each(to_boolean);
                values
            }
            BaseType::String => self.get_strings(vr, count)?,
            // Constant, as FMI 2.0 lacks these types.
            _ if self.standard == Standard::Fmi2 => vec![Value::Boolean(false); count],
            BaseType::Binary => self.get_bytes(vr, count)?,
            BaseType::Float32 => get!(Real, f32, fmi3GetFloat32),
            BaseType::Int8 => get!(Integer, i8, fmi3GetInt8),
            BaseType::UInt8 => get!(Integer, u8, fmi3GetUInt8),
            BaseType::Int16 => get!(Integer, i16, fmi3GetInt16),
            BaseType::UInt16 => get!(Integer, u16, fmi3GetUInt16),
            BaseType::UInt32 => get!(Integer, u32, fmi3GetUInt32),
            BaseType::Int64 => get!(Integer, i64, fmi3GetInt64),
            BaseType::UInt64 => get!(Integer, u64, fmi3GetUInt64),
        })
    }

    fn get_strings(&self, vr: (*const u32, usize), count: usize) -> Outcome<Vec<Value>> {
        let mut strings = vec![null::<c_char>(); count];
        let values = strings.as_mut_ptr();
        call!(self, fmi2GetString(vr.0, vr.1, values), fmi3GetString(vr.0, vr.1, values, count))?;
        // SAFETY: the strings exist until the next call.
        let owned = |string| unsafe { CStr::from_ptr(string) }.to_string_lossy().into_owned();
        Ok(strings.into_iter().map(|string| Value::String(owned(string))).collect())
    }

    fn get_bytes(&self, vr: (*const u32, usize), count: usize) -> Outcome<Vec<Value>> {
        let (mut sizes, mut values) = (vec![0; count], vec![null::<u8>(); count]);
        call!(self, fmi3GetBinary(vr.0, vr.1, sizes.as_mut_ptr(), values.as_mut_ptr(), count))?;
        let bytes = |(value, size): (*const u8, usize)| match size {
            0 => Vec::new(),
            // SAFETY: the model returned this size; the bytes exist until the next call.
            _ => unsafe { std::slice::from_raw_parts(value, size) }.to_vec(),
        };
        Ok(values.into_iter().zip(sizes).map(|pair| Value::Binary(bytes(pair))).collect())
    }

    /// Returns the partial derivatives of Reals, arrays as a whole, with respect to one Real: `None` if the model provides none, NaN
    /// if it returns no finite number.
    pub fn partials(&mut self, unknowns: &[u32], known: u32) -> Vec<Option<f64>> {
        if let Ok(all) = self.all_partials(unknowns, known) {
            return all.into_iter().map(Some).collect();
        }
        let mut found = Vec::with_capacity(unknowns.len());
        while let Some(index) = unknowns.get(found.len()) {
            let array = self.array(*index);
            match self.all_partials(&array, known) {
                Ok(all) => found.extend(all.into_iter().map(Some)),
                Err(message) => {
                    // FMI 2.0 gives no message.
                    let has_none = message.is_empty() || message.ends_with("is not provided");
                    found.extend(array.iter().map(|_| (!has_none).then_some(f64::NAN)));
                }
            }
        }
        found
    }

    /// Returns the partial derivatives of unknowns, which have all elements of their arrays.
    fn all_partials(&self, unknowns: &[u32], known: u32) -> Outcome<Vec<f64>> {
        let (length, element) = match self.model.table.variable(known) {
            Some(variable) if self.standard == Standard::Fmi3 => (variable.length(), variable.element),
            _ => (1, 0),
        };
        let mut seed = vec![0.0; length];
        seed[element] = 1.0;
        let known = [self.standard.reference(known - element as u32)];
        let references = self.references(unknowns);
        let mut found = vec![f64::NAN; unknowns.len()];
        let (vr, count, values) = (references.as_ptr(), references.len(), found.as_mut_ptr());
        call!(
            self,
            fmi2GetDirectionalDerivative(vr, count, known.as_ptr(), 1, seed.as_ptr(), values),
            fmi3GetDirectionalDerivative(
                vr,
                count,
                known.as_ptr(),
                1,
                seed.as_ptr(),
                seed.len(),
                values,
                unknowns.len()
            )
        )?;
        Ok(found)
    }

    pub fn states(&mut self) -> Outcome<Vec<f64>> {
        let mut states = vec![0.0; self.model.table.states.len()];
        call!(self, fmi3GetContinuousStates(states.as_mut_ptr(), states.len()))?;
        Ok(states)
    }

    pub fn set_states(&mut self, states: &[f64]) -> Outcome {
        call!(self, fmi3SetContinuousStates(states.as_ptr(), states.len()))
    }

    pub fn derivatives(&mut self) -> Outcome<Vec<f64>> {
        let mut derivatives = vec![0.0; self.model.table.states.len()];
        call!(self, fmi3GetContinuousStateDerivatives(derivatives.as_mut_ptr(), derivatives.len()))?;
        Ok(derivatives)
    }

    /// Returns the event indicators, and the nominal values of the states.
    pub fn indicators_and_nominals(&mut self) -> Vec<f64> {
        let mut indicators = vec![0.0; self.model.table.indicators()];
        let mut nominals = vec![1.0; self.model.table.states.len()];
        if call!(self, fmi3GetEventIndicators(indicators.as_mut_ptr(), indicators.len())).is_err() {
            indicators.fill(f64::NAN);
        }
        if call!(self, fmi3GetNominalsOfContinuousStates(nominals.as_mut_ptr(), nominals.len())).is_err() {
            nominals.fill(f64::NAN);
        }
        indicators.into_iter().chain(nominals).collect()
    }

    pub fn save(&mut self) -> Outcome<Saved> {
        let mut state = null_mut();
        call!(self, fmi2GetFMUstate, fmi3GetFMUState(&raw mut state))?;
        Ok(Saved { state, time: self.time })
    }

    pub fn restore(&mut self, saved: Saved) -> Outcome {
        call!(self, fmi2SetFMUstate, fmi3SetFMUState(saved.state))?;
        self.time = saved.time;
        Ok(())
    }

    /// Returns a saved state as bytes.
    pub fn serialize(&mut self, saved: Saved) -> Outcome<Vec<u8>> {
        let mut size = 0;
        call!(self, fmi2SerializedFMUstateSize, fmi3SerializedFMUStateSize(saved.state, &raw mut size))?;
        let mut bytes = vec![0_u8; size];
        let start = bytes.as_mut_ptr();
        call!(
            self,
            fmi2SerializeFMUstate(saved.state, start.cast(), size),
            fmi3SerializeFMUState(saved.state, start, size)
        )?;
        Ok(bytes)
    }

    /// Restores a state from bytes.
    pub fn deserialize(&mut self, bytes: &[u8], time: f64) -> Outcome {
        let (mut state, start, size) = (null_mut(), bytes.as_ptr(), bytes.len());
        call!(
            self,
            fmi2DeSerializeFMUstate(start.cast(), size, &raw mut state),
            fmi3DeserializeFMUState(start, size, &raw mut state)
        )?;
        self.restore(Saved { state, time })
    }
}

impl Drop for Instance<'_> {
    fn drop(&mut self) {
        // SAFETY: the instance exists, and this is its last use.
        unsafe {
            match self.standard {
                Standard::Fmi2 => (self.model.fmi2.fmi2FreeInstance)(self.handle),
                Standard::Fmi3 => (self.model.fmi3.fmi3FreeInstance)(self.handle),
            }
        }
    }
}

/// Stores a message of an instance, without the name of the function that rejects a call.
///
/// # Safety
/// The environment is the message of an instance; the text is a string.
unsafe extern "C" fn remember(environment: *mut c_void, _: c_int, _: *const c_char, text: *const c_char) {
    // SAFETY: the caller guarantees it.
    let (message, text) = unsafe { (&*environment.cast::<RefCell<String>>(), CStr::from_ptr(text)) };
    let text = text.to_string_lossy();
    let (function, rest) = text.split_once(": ").unwrap_or_default();
    message.replace(if function.starts_with("fmi") { rest.to_owned() } else { text.into_owned() });
}
