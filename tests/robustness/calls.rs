//! One call of a function that works on an instance.

use crate::arguments::{Answer, Arguments};
use crate::support::{FUNCTIONS_OF_COMPONENTS, Fmu, Status};
use fmi2_export::types::*;

/// A function with its arguments.
#[derive(Clone, Debug)]
pub struct Call {
    pub function: &'static str,
    pub arguments: Arguments,
}

/// What lies behind the last element of an array that the FMU writes, and in it before.
const UNTOUCHED: u64 = 0x7ff8_dead_beef_0000;

/// The functions of saved states, which have handles besides arguments: `session` calls them.
pub fn has_handles(function: &str) -> bool {
    function.contains("FMUstate")
}

/// Functions that only read.
fn reads(function: &str) -> bool {
    let mode_changes = ["fmi2NewDiscreteStates", "fmi2CompletedIntegratorStep", "fmi2CancelStep"];
    function.starts_with("fmi2Get") || mode_changes.contains(&function)
}

impl Call {
    /// Whether the state must be the same after an answer with this status.
    pub fn must_not_change(&self, status: Status) -> bool {
        status != Status::Ok || reads(self.function)
    }

    /// Calls the function. Panics if it answers what it must not: a status that no function here has,
    /// a value that is no finite number, more values than were asked for.
    pub fn run(&self, fmu: &Fmu) -> Answer {
        let a = &self.arguments;
        let (vr, count) = (a.pointer(0, &a.vr), a.count(a.vr.len()));
        let mut reals = vec![f64::from_bits(UNTOUCHED); a.vr.len() + 1];
        let mut integers = vec![i32::MIN; a.vr.len() + 1];
        let mut strings = vec![c"untouched".as_ptr(); a.vr.len()];
        let mut info = [fmi2EventInfo { next_event_time: f64::NAN, ..Default::default() }];
        let mut flags = [[-1], [-1]];
        let mut no_status = [Status::Warning];
        let mut written_reals = 0;
        let mut written_integers = 0;
        let [first, second, third] = a.numbers;
        let [flag, other_flag] = a.flags;
        let status = match self.function {
            "fmi2SetDebugLogging" => fmu.fmi2SetDebugLogging(flag, count, a.pointer(1, &a.categories)),
            "fmi2SetupExperiment" => fmu.fmi2SetupExperiment(flag, first, second, other_flag, third),
            "fmi2EnterInitializationMode" => fmu.fmi2EnterInitializationMode(),
            "fmi2ExitInitializationMode" => fmu.fmi2ExitInitializationMode(),
            "fmi2Terminate" => fmu.fmi2Terminate(),
            "fmi2Reset" => fmu.fmi2Reset(),
            "fmi2GetReal" => {
                written_reals = a.vr.len();
                fmu.fmi2GetReal(vr, count, a.output(1, &mut reals))
            }
            "fmi2GetInteger" => {
                written_integers = a.vr.len();
                fmu.fmi2GetInteger(vr, count, a.output(1, &mut integers))
            }
            "fmi2GetBoolean" => {
                written_integers = a.vr.len();
                fmu.fmi2GetBoolean(vr, count, a.output(1, &mut integers))
            }
            "fmi2GetString" => fmu.fmi2GetString(vr, count, a.output(1, &mut strings)),
            "fmi2SetReal" => fmu.fmi2SetReal(vr, count, a.pointer(1, &a.reals)),
            "fmi2SetInteger" => fmu.fmi2SetInteger(vr, count, a.pointer(1, &a.integers)),
            "fmi2SetBoolean" => fmu.fmi2SetBoolean(vr, count, a.pointer(1, &a.integers)),
            "fmi2SetString" => fmu.fmi2SetString(vr, count, a.pointer(1, &strings)),
            "fmi2GetDirectionalDerivative" => {
                written_reals = a.vr.len();
                let known = a.pointer(1, &a.known);
                let seed = a.pointer(2, &a.reals);
                fmu.fmi2GetDirectionalDerivative(
                    vr,
                    count,
                    known,
                    a.known.len(),
                    seed,
                    a.output(3, &mut reals),
                )
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
            "fmi2GetDerivatives" => {
                written_reals = a.vr.len();
                fmu.fmi2GetDerivatives(a.output(1, &mut reals), count)
            }
            "fmi2GetEventIndicators" => fmu.fmi2GetEventIndicators(a.output(1, &mut reals), count),
            "fmi2GetContinuousStates" => {
                written_reals = a.vr.len();
                fmu.fmi2GetContinuousStates(a.output(1, &mut reals), count)
            }
            "fmi2GetNominalsOfContinuousStates" => {
                written_reals = a.vr.len();
                fmu.fmi2GetNominalsOfContinuousStates(a.output(1, &mut reals), count)
            }
            "fmi2SetRealInputDerivatives" => {
                let orders = a.pointer(1, &a.orders);
                fmu.fmi2SetRealInputDerivatives(vr, count, orders, a.pointer(2, &a.reals))
            }
            "fmi2GetRealOutputDerivatives" => {
                written_reals = a.vr.len();
                let orders = a.pointer(1, &a.orders);
                fmu.fmi2GetRealOutputDerivatives(vr, count, orders, a.output(2, &mut reals))
            }
            "fmi2DoStep" => fmu.fmi2DoStep(first, second, flag),
            "fmi2CancelStep" => fmu.fmi2CancelStep(),
            "fmi2GetStatus" => fmu.fmi2GetStatus(a.kind, a.output(0, &mut no_status)),
            "fmi2GetRealStatus" => {
                written_reals = 1;
                fmu.fmi2GetRealStatus(a.kind, a.output(0, &mut reals))
            }
            "fmi2GetIntegerStatus" => fmu.fmi2GetIntegerStatus(a.kind, a.output(0, &mut integers)),
            "fmi2GetBooleanStatus" => {
                written_integers = 1;
                fmu.fmi2GetBooleanStatus(a.kind, a.output(0, &mut integers))
            }
            "fmi2GetStringStatus" => fmu.fmi2GetStringStatus(a.kind, a.output(0, &mut strings)),
            other => unreachable!("{other} is not called here"),
        };
        let name = self.function;
        let discards = name.ends_with("Status") && status == Status::Discard;
        assert!(discards || [Status::Ok, Status::Error].contains(&status), "{name} answers {status:?}");
        let mut values = Vec::new();
        if status == Status::Ok {
            for value in &reals[..written_reals] {
                assert!(value.is_finite(), "{name} gives {value}: {self:?}");
                values.push(value.to_bits());
            }
            for value in &integers[..written_integers] {
                assert_ne!(*value, i32::MIN, "{name} gives no value: {self:?}");
                values.push(*value as u64);
            }
            if name == "fmi2NewDiscreteStates" {
                assert_eq!(info, [fmi2EventInfo::default()]);
            }
            if name == "fmi2DoStep" {
                assert!(second > 0.0 && (first + second).is_finite(), "time does not pass: {self:?}");
            }
            if name == "fmi2CompletedIntegratorStep" {
                assert_eq!(flags, [[fmi2False], [fmi2False]]);
            }
        }
        if written_reals < reals.len() && written_reals == a.vr.len() {
            assert_eq!(reals[written_reals].to_bits(), UNTOUCHED, "{name} writes too much: {self:?}");
        }
        if written_integers == a.vr.len() {
            assert_eq!(integers[written_integers], i32::MIN, "{name} writes too much: {self:?}");
        }
        assert_eq!(no_status, [Status::Warning], "{name} has no status to give");
        Answer { status, values }
    }
}

/// All functions that are called here: those of components without those of saved states.
pub fn functions() -> impl Iterator<Item = &'static str> {
    FUNCTIONS_OF_COMPONENTS.iter().copied().filter(|name| !has_handles(name))
}
