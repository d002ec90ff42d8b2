//! An instance of a model, used as an importer does.
//!
//! It is one of FMI 3.0, which has all types; but for derivatives of inputs, which FMI 2.0 has for importers that step a
//! model, and FMI 3.0 has not.
#![allow(unsafe_code, reason = "C functions are called")]

use crate::model::{Group, LoadedModel};
use crate::table::Variable;
use fmi_abi::c_types::{c_char, c_int, c_void};
use fmi_abi::fmi2::types::fmi2CallbackFunctions;
use fmi_abi::{BaseType, Interface, Standard, Status, Value};
use std::cell::RefCell;
use std::ffi::{CStr, CString};
use std::ptr::{null, null_mut};

/// What the model rejects, with its message.
pub(crate) type Outcome<T = ()> = Result<T, String>;

/// An instance; it frees its saved states with itself.
pub(crate) struct Instance<'a> {
    of: &'a LoadedModel,
    pub interface: Interface,
    standard: Standard,
    event_mode: bool,
    handle: *mut c_void,
    /// The last message, which the model logs.
    message: Box<RefCell<String>>,
    pub time: f64,
}

/// A saved state of an instance.
#[derive(Clone, Copy)]
pub(crate) struct Saved(*mut c_void);

/// Rounds of an event; more are an endless loop.
const MOST_ROUNDS: usize = 10_000;

/// Calls the function of the instance's standard, with the same arguments or with others.
macro_rules! call {
    ($self:ident, $fmi2:ident, $fmi3:ident ($($argument:expr),*)) => {
        call!($self, $fmi2($($argument),*), $fmi3($($argument),*))
    };
    ($self:ident, $fmi2:ident($($two:expr),*), $fmi3:ident($($three:expr),*)) => {{
        // SAFETY: a living instance of this library, and arguments as the standard has them: pointers to values of this
        // function, arrays with their lengths.
        let code = unsafe {
            match $self.standard {
                Standard::Fmi2 => ($self.of.fmi2.$fmi2)($self.handle, $($two),*),
                Standard::Fmi3 => ($self.of.fmi3.$fmi3)($self.handle, $($three),*),
            }
        };
        $self.outcome(code)
    }};
    ($self:ident, $fmi3:ident($($three:expr),*)) => {{
        // SAFETY: as above.
        let code = unsafe { ($self.of.fmi3.$fmi3)($self.handle, $($three),*) };
        $self.outcome(code)
    }};
}

impl<'a> Instance<'a> {
    /// An instance; one of FMI 3.0 may have an event mode in Co-Simulation.
    pub fn new(
        of: &'a LoadedModel,
        interface: Interface,
        standard: Standard,
        event_mode: bool,
    ) -> Outcome<Self> {
        let token = CString::new(of.guid()).map_err(|_| "its guid has a NUL".to_owned())?;
        let (name, token) = (c"instance".as_ptr(), token.as_ptr());
        let message = Box::new(RefCell::new(String::new()));
        let environment = (&raw const *message).cast_mut().cast();
        let callbacks = fmi2CallbackFunctions {
            logger: None,
            allocate_memory: None,
            free_memory: None,
            step_finished: None,
            component_environment: null_mut(),
        };
        // SAFETY: strings and a callback that live as long as the instance, or NULL.
        let handle = unsafe {
            match (standard, interface) {
                (Standard::Fmi2, _) => (of.fmi2.fmi2Instantiate)(
                    name,
                    interface as c_int,
                    token,
                    of.resources(),
                    &raw const callbacks,
                    0,
                    0,
                ),
                (Standard::Fmi3, Interface::ModelExchange) => (of.fmi3.fmi3InstantiateModelExchange)(
                    name,
                    token,
                    of.resources(),
                    0,
                    0,
                    environment,
                    Some(remember),
                ),
                (Standard::Fmi3, Interface::CoSimulation) => (of.fmi3.fmi3InstantiateCoSimulation)(
                    name,
                    token,
                    of.resources(),
                    0,
                    0,
                    event_mode.into(),
                    1,
                    null(),
                    0,
                    environment,
                    Some(remember),
                    None,
                ),
            }
        };
        if handle.is_null() {
            return Err(message.take());
        }
        Ok(Self { of, interface, standard, event_mode, handle, message, time: 0.0 })
    }

    fn outcome(&self, code: c_int) -> Outcome {
        match Status::from_c(code) {
            Status::Ok | Status::Warning => Ok(()),
            _ => Err(self.message.take()),
        }
    }

    pub fn initialize(&mut self, start: f64, stop: Option<f64>, tolerance: Option<f64>) -> Outcome {
        let (with_stop, stop) = (stop.is_some(), stop.unwrap_or_default());
        let (with_tolerance, tolerance) = (tolerance.is_some(), tolerance.unwrap_or_default());
        self.time = start;
        if self.standard == Standard::Fmi3 {
            return call!(
                self,
                fmi3EnterInitializationMode(with_tolerance.into(), tolerance, start, with_stop.into(), stop)
            );
        }
        let Self { of: LoadedModel { fmi2, .. }, handle, .. } = *self;
        // SAFETY: as in `call!`.
        self.outcome(unsafe {
            (fmi2.fmi2SetupExperiment)(
                handle,
                with_tolerance.into(),
                tolerance,
                start,
                with_stop.into(),
                stop,
            )
        })?;
        // SAFETY: as in `call!`.
        self.outcome(unsafe { (fmi2.fmi2EnterInitializationMode)(handle) })
    }

    pub fn initialized(&mut self) -> Outcome {
        call!(self, fmi2ExitInitializationMode, fmi3ExitInitializationMode())
    }

    /// Leaves the event mode after the initialization without an event, on which discrete variables would depend.
    pub fn run(&mut self) -> Outcome {
        match self.interface {
            Interface::ModelExchange => call!(self, fmi3EnterContinuousTimeMode()),
            Interface::CoSimulation if self.event_mode => call!(self, fmi3EnterStepMode()),
            Interface::CoSimulation => Ok(()),
        }
    }

    /// The event iteration of Model Exchange, and Continuous-Time Mode.
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

    /// A step of Co-Simulation; whether the model goes on.
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

    /// First time derivatives of inputs; of FMI 2.0.
    pub fn set_input_derivatives(&mut self, places: &[u32], values: &[f64]) -> Outcome {
        if self.standard != Standard::Fmi2 || places.is_empty() {
            return Ok(());
        }
        let orders = vec![1; places.len()];
        // SAFETY: as in `call!`.
        self.outcome(unsafe {
            (self.of.fmi2.fmi2SetRealInputDerivatives)(
                self.handle,
                places.as_ptr(),
                places.len(),
                orders.as_ptr(),
                values.as_ptr(),
            )
        })
    }

    /// Sets the variables of which this holds, arrays as a whole, those of a type together; the types in another order if the
    /// model rejects one, since values must fit together after each call.
    pub fn set(&mut self, values: &[Option<Value>], which: impl Fn(&Variable) -> bool) -> Outcome {
        let variables = &self.of.table.variables;
        let mut chosen: Vec<bool> =
            variables.iter().zip(values).map(|(of, value)| value.is_some() && which(of)).collect();
        for (first, of) in variables.iter().enumerate().filter(|(_, of)| of.element == 0 && of.length() > 1) {
            let array = &mut chosen[first..first + of.length()];
            let any = array.contains(&true);
            array.fill(any);
        }
        let is_set = |place: &u32| chosen[*place as usize];
        let mut open: Vec<_> =
            self.of.groups.iter().filter(|group| group.places.iter().any(&is_set)).collect();
        loop {
            let before = open.len();
            let mut rejected = None;
            open.retain(|group| {
                let places: Vec<u32> = group.places.iter().copied().filter(&is_set).collect();
                let values: Vec<&Value> = places.iter().flat_map(|place| &values[*place as usize]).collect();
                let outcome = self.set_values(group.base, &self.references(&places), &values);
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

    /// The value references of variables, of arrays of FMI 3.0 the one of the first element.
    fn references(&self, places: &[u32]) -> Vec<u32> {
        let has_reference = |place: &&u32| {
            self.standard == Standard::Fmi2
                || self.of.table.variable(**place).is_none_or(|of| of.element == 0)
        };
        places.iter().filter(has_reference).map(|place| self.standard.reference(*place)).collect()
    }

    fn set_values(&self, base: BaseType, vr: &[u32], values: &[&Value]) -> Outcome {
        let (vr, count) = ((vr.as_ptr(), vr.len()), values.len());
        macro_rules! set {
            ($kind:ident as $of:ty, $fmi3:ident) => {{
                let values: Vec<$of> = values
                    .iter()
                    .map(
                        |value| {
                            if let Value::$kind(value) = value { *value as $of } else { <$of>::default() }
                        },
                    )
                    .collect();
                call!(self, $fmi3(vr.0, vr.1, values.as_ptr(), count))
            }};
            ($kind:ident as $two:ty, $fmi2:ident, $three:ty, $fmi3:ident) => {
                if self.standard == Standard::Fmi2 {
                    let values: Vec<$two> =
                        values
                            .iter()
                            .map(|value| {
                                if let Value::$kind(value) = value {
                                    *value as $two
                                } else {
                                    <$two>::default()
                                }
                            })
                            .collect();
                    // SAFETY: as in `call!`.
                    self.outcome(unsafe { (self.of.fmi2.$fmi2)(self.handle, vr.0, vr.1, values.as_ptr()) })
                } else {
                    set!($kind as $three, $fmi3)
                }
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
        // A NUL is rejected before.
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
    pub fn set_reals(&mut self, places: &[u32], values: &[f64]) -> Outcome {
        let values: Vec<Value> = values.iter().copied().map(Value::Real).collect();
        self.set_values(BaseType::Real, &self.references(places), &values.iter().collect::<Vec<_>>())
    }

    /// The values of variables of type Real, arrays as a whole; NaN for a value that the model does not return.
    pub fn reals(&mut self, places: &[u32]) -> Vec<f64> {
        match self.get_values(BaseType::Real, &self.references(places), places.len()) {
            Ok(values) => values.iter().map(Value::real).collect(),
            Err(_) => {
                let all = self.values();
                places.iter().map(|place| all[*place as usize].real()).collect()
            }
        }
    }

    /// The values of all variables; NaN for a value that the model does not return.
    pub fn values(&mut self) -> Vec<Value> {
        let mut all = vec![Value::Real(f64::NAN); self.of.table.variables.len()];
        for Group { base, places, first } in &self.of.groups {
            let of_standard = if self.standard == Standard::Fmi2 { places } else { first };
            if let Ok(values) = self.get_values(*base, &self.references(of_standard), places.len()) {
                places.iter().zip(values).for_each(|(place, value)| all[*place as usize] = value);
                continue;
            }
            for place in of_standard {
                let length = match self.standard {
                    Standard::Fmi2 => 1,
                    Standard::Fmi3 => self.of.table.variables[*place as usize].length(),
                };
                if let Ok(values) = self.get_values(*base, &self.references(&[*place]), length) {
                    (*place as usize..).zip(values).for_each(|(place, value)| all[place] = value);
                }
            }
        }
        all
    }

    fn get_values(&self, base: BaseType, vr: &[u32], count: usize) -> Outcome<Vec<Value>> {
        let vr = (vr.as_ptr(), vr.len());
        let truth = |value: &mut Value| *value = Value::Boolean(*value != Value::Integer(0));
        macro_rules! get {
            ($kind:ident, $of:ty, $fmi3:ident) => {{
                let mut values = vec![<$of>::default(); count];
                call!(self, $fmi3(vr.0, vr.1, values.as_mut_ptr(), count))?;
                values.into_iter().map(|value| Value::$kind(value.into())).collect::<Vec<_>>()
            }};
            ($kind:ident, $two:ty, $fmi2:ident, $three:ty, $fmi3:ident) => {
                if self.standard == Standard::Fmi2 {
                    let mut values = vec![<$two>::default(); count];
                    // SAFETY: as in `call!`.
                    self.outcome(unsafe {
                        (self.of.fmi2.$fmi2)(self.handle, vr.0, vr.1, values.as_mut_ptr())
                    })?;
                    values.into_iter().map(|value| Value::$kind(value.into())).collect()
                } else {
                    get!($kind, $three, $fmi3)
                }
            };
        }
        Ok(match base {
            BaseType::Real => get!(Real, f64, fmi2GetReal, f64, fmi3GetFloat64),
            BaseType::Integer => get!(Integer, i32, fmi2GetInteger, i32, fmi3GetInt32),
            BaseType::Enumeration => get!(Integer, i32, fmi2GetInteger, i64, fmi3GetInt64),
            BaseType::Boolean => {
                let mut values = get!(Integer, i32, fmi2GetBoolean, u8, fmi3GetBoolean);
                values.iter_mut().for_each(truth);
                values
            }
            BaseType::String => self.get_strings(vr, count)?,
            // The same everywhere.
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
        // SAFETY: strings, until the next call.
        let text = |string| unsafe { CStr::from_ptr(string) }.to_string_lossy().into_owned();
        Ok(strings.into_iter().map(|string| Value::String(text(string))).collect())
    }

    fn get_bytes(&self, vr: (*const u32, usize), count: usize) -> Outcome<Vec<Value>> {
        let (mut sizes, mut values) = (vec![0; count], vec![null::<u8>(); count]);
        call!(self, fmi3GetBinary(vr.0, vr.1, sizes.as_mut_ptr(), values.as_mut_ptr(), count))?;
        let bytes = |(value, size): (*const u8, usize)| match size {
            0 => Vec::new(),
            // SAFETY: so many bytes, until the next call.
            _ => unsafe { std::slice::from_raw_parts(value, size) }.to_vec(),
        };
        Ok(values.into_iter().zip(sizes).map(|pair| Value::Binary(bytes(pair))).collect())
    }

    /// The partial derivatives of Reals, arrays as a whole, with respect to one Real: `None` where the model has none, NaN
    /// where it returns no finite number.
    pub fn partials(&mut self, unknowns: &[u32], known: u32) -> Vec<Option<f64>> {
        if let Ok(all) = self.all_partials(unknowns, known) {
            return all.into_iter().map(Some).collect();
        }
        let mut found = Vec::with_capacity(unknowns.len());
        while let Some(place) = unknowns.get(found.len()) {
            let array = match self.standard {
                Standard::Fmi2 => vec![*place],
                Standard::Fmi3 => self.of.table.array(*place),
            };
            match self.all_partials(&array, known) {
                Ok(all) => found.extend(all.into_iter().map(Some)),
                Err(message) => {
                    // Without a message in FMI 2.0.
                    let has_none = message.is_empty() || message.ends_with("is not provided");
                    found.extend(array.iter().map(|_| (!has_none).then_some(f64::NAN)));
                }
            }
        }
        found
    }

    /// The unknowns have all elements of their arrays.
    fn all_partials(&self, unknowns: &[u32], known: u32) -> Outcome<Vec<f64>> {
        let (length, element) = match self.of.table.variable(known) {
            Some(of) if self.standard == Standard::Fmi3 => (of.length(), of.element),
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
        let mut states = vec![0.0; self.of.table.states.len()];
        call!(self, fmi3GetContinuousStates(states.as_mut_ptr(), states.len()))?;
        Ok(states)
    }

    pub fn set_states(&mut self, states: &[f64]) -> Outcome {
        call!(self, fmi3SetContinuousStates(states.as_ptr(), states.len()))
    }

    pub fn derivatives(&mut self) -> Outcome<Vec<f64>> {
        let mut derivatives = vec![0.0; self.of.table.states.len()];
        call!(self, fmi3GetContinuousStateDerivatives(derivatives.as_mut_ptr(), derivatives.len()))?;
        Ok(derivatives)
    }

    /// The event indicators, and the nominal values of the states.
    pub fn indicators_and_nominals(&mut self) -> Vec<f64> {
        let mut indicators = vec![0.0; self.of.table.indicators()];
        let mut nominals = vec![1.0; self.of.table.states.len()];
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
        Ok(Saved(state))
    }

    pub fn restore(&mut self, saved: Saved, time: f64) -> Outcome {
        call!(self, fmi2SetFMUstate, fmi3SetFMUState(saved.0))?;
        self.time = time;
        Ok(())
    }

    /// A saved state as bytes.
    pub fn serialize(&mut self, saved: Saved) -> Outcome<Vec<u8>> {
        let mut size = 0;
        call!(self, fmi2SerializedFMUstateSize, fmi3SerializedFMUStateSize(saved.0, &raw mut size))?;
        let mut bytes = vec![0_u8; size];
        let start = bytes.as_mut_ptr();
        call!(
            self,
            fmi2SerializeFMUstate(saved.0, start.cast(), size),
            fmi3SerializeFMUState(saved.0, start, size)
        )?;
        Ok(bytes)
    }

    /// Goes to the state that these bytes hold.
    pub fn read(&mut self, bytes: &[u8], time: f64) -> Outcome {
        let (mut state, start, size) = (null_mut(), bytes.as_ptr(), bytes.len());
        call!(
            self,
            fmi2DeSerializeFMUstate(start.cast(), size, &raw mut state),
            fmi3DeserializeFMUState(start, size, &raw mut state)
        )?;
        self.restore(Saved(state), time)
    }
}

impl Drop for Instance<'_> {
    fn drop(&mut self) {
        // SAFETY: the instance is living, and nobody else has it.
        unsafe {
            match self.standard {
                Standard::Fmi2 => (self.of.fmi2.fmi2FreeInstance)(self.handle),
                Standard::Fmi3 => (self.of.fmi3.fmi3FreeInstance)(self.handle),
            }
        }
    }
}

/// Keeps a message of an instance without the name of the function that rejects a call.
///
/// # Safety
/// The environment is the message of an instance; the text is a string.
unsafe extern "C" fn remember(environment: *mut c_void, _: c_int, _: *const c_char, text: *const c_char) {
    // SAFETY: the caller's promise.
    let (message, text) = unsafe { (&*environment.cast::<RefCell<String>>(), CStr::from_ptr(text)) };
    let text = text.to_string_lossy();
    let (function, rest) = text.split_once(": ").unwrap_or_default();
    message.replace(if function.starts_with("fmi") { rest.to_owned() } else { text.into_owned() });
}
