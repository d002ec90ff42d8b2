//! One call of a function that works on an instance.

use super::arguments::CallArguments;
use crate::serialized::fnv1a;
use crate::{FUNCTIONS, Importer};
use fmu_export::fmi2::types::*;
use std::ffi::CStr;

/// A function with its arguments.
#[derive(Clone, Debug)]
pub struct Call {
    pub function: &'static str,
    pub arguments: CallArguments,
}

/// What a call answered, as bits: NaN compares too.
#[derive(Clone, Debug, PartialEq)]
pub struct Answer {
    pub status: Status,
    pub values: Vec<u64>,
}

/// What lies behind the last element of an array that the FMU writes, and in it before.
const UNTOUCHED: u64 = 0x7ff8_dead_beef_0000;
const UNTOUCHED_INTEGER: i32 = i32::MIN + 77;
static UNTOUCHED_TEXT: &CStr = c"untouched";

/// The functions of saved states have handles besides arguments: the session calls them.
fn has_handles(function: &str) -> bool {
    function.contains("FMUstate")
}

/// All functions that are called here: those of components without those of saved states.
pub fn functions() -> impl Iterator<Item = &'static str> {
    FUNCTIONS.iter().copied().filter(|name| !has_handles(name))
}

/// What a function wrote.
struct Written {
    reals: usize,
    integers: usize,
    texts: usize,
}

impl Call {
    /// Whether the state must be the same after an answer with this status. A step that ends early has got somewhere.
    pub fn must_not_change(&self, status: Status) -> bool {
        let early = self.function == "fmi2DoStep" && status == Status::Discard;
        status != Status::Ok && !early || self.function.starts_with("fmi2Get")
    }

    /// Calls the function. Panics if it answers what it must not: a status that no function here has, a value that is no
    /// finite number, more values than were asked for.
    pub fn run(&self, fmu: &Importer) -> Answer {
        let a = &self.arguments;
        let (vr, count) = (a.pointer(0, &a.vr), a.count(a.vr.len()));
        let room = a.vr.len().max(1) + 1;
        let mut reals = vec![f64::from_bits(UNTOUCHED); room];
        let mut integers = vec![UNTOUCHED_INTEGER; room];
        let mut texts = vec![UNTOUCHED_TEXT.as_ptr(); room];
        let mut info = [fmi2EventInfo { next_event_time: f64::NAN, ..Default::default() }];
        let mut flags = [[-1], [-1]];
        let mut no_status = [Status::Warning as i32];
        let [first, second, third] = a.numbers;
        let [flag, other_flag] = a.flags;
        let status = match self.function {
            "fmi2SetDebugLogging" => fmu.fmi2SetDebugLogging(flag, count, a.pointer(1, &a.categories)),
            "fmi2SetupExperiment" => fmu.fmi2SetupExperiment(flag, first, second, other_flag, third),
            "fmi2EnterInitializationMode" => fmu.fmi2EnterInitializationMode(),
            "fmi2ExitInitializationMode" => fmu.fmi2ExitInitializationMode(),
            "fmi2Terminate" => fmu.fmi2Terminate(),
            "fmi2Reset" => fmu.fmi2Reset(),
            "fmi2GetReal" => fmu.fmi2GetReal(vr, count, a.output(1, &mut reals)),
            "fmi2GetInteger" => fmu.fmi2GetInteger(vr, count, a.output(1, &mut integers)),
            "fmi2GetBoolean" => fmu.fmi2GetBoolean(vr, count, a.output(1, &mut integers)),
            "fmi2GetString" => fmu.fmi2GetString(vr, count, a.output(1, &mut texts)),
            "fmi2SetReal" => fmu.fmi2SetReal(vr, count, a.pointer(1, &a.reals)),
            "fmi2SetInteger" => fmu.fmi2SetInteger(vr, count, a.pointer(1, &a.integers)),
            "fmi2SetBoolean" => fmu.fmi2SetBoolean(vr, count, a.pointer(1, &a.integers)),
            "fmi2SetString" => fmu.fmi2SetString(vr, count, a.pointer(1, &a.texts)),
            "fmi2GetDirectionalDerivative" => {
                let (known, seed) = (a.pointer(1, &a.known), a.pointer(2, &a.reals));
                let result = a.output(3, &mut reals);
                fmu.fmi2GetDirectionalDerivative(vr, count, known, a.known.len(), seed, result)
            }
            "fmi2EnterEventMode" => fmu.fmi2EnterEventMode(),
            "fmi2NewDiscreteStates" => fmu.fmi2NewDiscreteStates(a.output(0, &mut info)),
            "fmi2EnterContinuousTimeMode" => fmu.fmi2EnterContinuousTimeMode(),
            "fmi2CompletedIntegratorStep" => {
                let [enter, terminate] = &mut flags;
                fmu.fmi2CompletedIntegratorStep(flag, a.output(0, enter), a.output(1, terminate))
            }
            "fmi2SetTime" => fmu.fmi2SetTime(first),
            "fmi2SetContinuousStates" => fmu.fmi2SetContinuousStates(a.pointer(1, &a.reals), count),
            "fmi2GetDerivatives" => fmu.fmi2GetDerivatives(a.output(1, &mut reals), count),
            "fmi2GetEventIndicators" => fmu.fmi2GetEventIndicators(a.output(1, &mut reals), count),
            "fmi2GetContinuousStates" => fmu.fmi2GetContinuousStates(a.output(1, &mut reals), count),
            "fmi2GetNominalsOfContinuousStates" => {
                fmu.fmi2GetNominalsOfContinuousStates(a.output(1, &mut reals), count)
            }
            "fmi2SetRealInputDerivatives" => {
                let orders = a.pointer(1, &a.orders);
                fmu.fmi2SetRealInputDerivatives(vr, count, orders, a.pointer(2, &a.reals))
            }
            "fmi2GetRealOutputDerivatives" => {
                let orders = a.pointer(1, &a.orders);
                fmu.fmi2GetRealOutputDerivatives(vr, count, orders, a.output(2, &mut reals))
            }
            "fmi2DoStep" => fmu.fmi2DoStep(first, second, flag),
            "fmi2CancelStep" => fmu.fmi2CancelStep(),
            "fmi2GetStatus" => fmu.fmi2GetStatus(a.kind, a.output(0, &mut no_status)),
            "fmi2GetRealStatus" => fmu.fmi2GetRealStatus(a.kind, a.output(0, &mut reals)),
            "fmi2GetIntegerStatus" => fmu.fmi2GetIntegerStatus(a.kind, a.output(0, &mut integers)),
            "fmi2GetBooleanStatus" => fmu.fmi2GetBooleanStatus(a.kind, a.output(0, &mut integers)),
            "fmi2GetStringStatus" => fmu.fmi2GetStringStatus(a.kind, a.output(0, &mut texts)),
            other => unreachable!("{other} is not called here"),
        };
        let name = self.function;
        let discards = (name.ends_with("Status") || name == "fmi2DoStep") && status == Status::Discard;
        assert!(discards || [Status::Ok, Status::Error].contains(&status), "{name} answers {status:?}");
        assert_eq!(no_status, [Status::Warning as i32], "{name} has no status to give");

        let written = self.written();
        assert_eq!(reals[written.reals].to_bits(), UNTOUCHED, "{name} writes too much: {self:?}");
        assert_eq!(integers[written.integers], UNTOUCHED_INTEGER, "{name} writes too much: {self:?}");
        assert_eq!(texts[written.texts], UNTOUCHED_TEXT.as_ptr(), "{name} writes too much: {self:?}");
        let mut values = Vec::new();
        if status == Status::Ok {
            for value in &reals[..written.reals] {
                assert!(value.is_finite(), "{name} gives {value}: {self:?}");
                values.push(value.to_bits());
            }
            for value in &integers[..written.integers] {
                let truth = name.contains("Boolean");
                assert!(!truth || [0, 1].contains(value), "{name} gives {value}: {self:?}");
                assert_ne!(*value, UNTOUCHED_INTEGER, "{name} gives no value: {self:?}");
                values.push(*value as u64);
            }
            for text in &texts[..written.texts] {
                assert!(
                    !text.is_null() && *text != UNTOUCHED_TEXT.as_ptr(),
                    "{name} gives no text: {self:?}"
                );
                // SAFETY: a string of the FMU's (section 2.1.7), valid until the next call.
                let bytes = unsafe { CStr::from_ptr(*text) }.to_bytes();
                assert!(std::str::from_utf8(bytes).is_ok(), "{name} gives no UTF-8: {self:?}");
                values.push(u64::from_le_bytes(fnv1a(bytes)));
            }
            match name {
                "fmi2NewDiscreteStates" => values.extend(self.check_event(info[0])),
                "fmi2CompletedIntegratorStep" => {
                    assert!(flags.iter().flatten().all(|flag| [0, 1].contains(flag)), "{flags:?}");
                    values.extend(flags.as_flattened().iter().map(|flag| *flag as u64));
                }
                "fmi2DoStep" => {
                    assert!(second > 0.0 && (first + second).is_finite(), "time does not pass: {self:?}");
                }
                _ => {}
            }
        }
        Answer { status, values }
    }

    /// How many values the function writes if it succeeds.
    fn written(&self) -> Written {
        let count = self.arguments.vr.len();
        let none = Written { reals: 0, integers: 0, texts: 0 };
        match self.function {
            "fmi2GetInteger" | "fmi2GetBoolean" => Written { integers: count, ..none },
            "fmi2GetString" => Written { texts: count, ..none },
            "fmi2GetRealStatus" => Written { reals: 1, ..none },
            "fmi2GetBooleanStatus" => Written { integers: 1, ..none },
            "fmi2GetStatus" | "fmi2GetIntegerStatus" | "fmi2GetStringStatus" => none,
            name if name.starts_with("fmi2Get") => Written { reals: count, ..none },
            _ => none,
        }
    }

    fn check_event(&self, info: fmi2EventInfo) -> [u64; 6] {
        let flags = [
            info.new_discrete_states_needed,
            info.terminate_simulation,
            info.nominals_of_continuous_states_changed,
            info.values_of_continuous_states_changed,
            info.next_event_time_defined,
        ];
        assert!(flags.iter().all(|flag| [0, 1].contains(flag)), "{info:?}");
        assert!(info.next_event_time.is_finite(), "{info:?}");
        let [again, terminate, nominals, states, defined] = flags.map(|flag| flag as u64);
        [again, terminate, nominals, states, defined, info.next_event_time.to_bits()]
    }
}
