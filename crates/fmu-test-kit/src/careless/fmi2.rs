//! The careless importer of FMI 2.0.

use super::call::{Caller, Outputs, finite, truth};
use crate::Importer;
use fmu_export::Standard;
use fmu_export::fmi2::types::*;

/// What is in an array before the FMU writes.
const UNTOUCHED: i32 = i32::MIN + 77;

impl Caller for Importer {
    const STANDARD: Standard = Standard::Fmi2;
    #[rustfmt::skip]
    const STEPS: &'static [&'static str] = &[
        "fmi2DoStep", "fmi2DoStep", "fmi2DoStep", "fmi2SetReal", "fmi2SetInteger", "fmi2SetBoolean",
        "fmi2SetString", "fmi2GetReal", "fmi2SetRealInputDerivatives", "fmi2GetRealOutputDerivatives",
    ];
    #[rustfmt::skip]
    const INTEGRATION: &'static [&'static str] = &[
        "fmi2SetTime", "fmi2SetContinuousStates", "fmi2SetReal", "fmi2GetReal", "fmi2GetDerivatives",
        "fmi2GetEventIndicators", "fmi2CompletedIntegratorStep", "fmi2EnterEventMode",
        "fmi2NewDiscreteStates", "fmi2EnterContinuousTimeMode",
    ];
    const BEGINNING: &'static [&'static str] =
        &["fmi2Reset", "fmi2SetupExperiment", "fmi2EnterInitializationMode", "fmi2ExitInitializationMode"];
    const INSTANTIATE: [&'static str; 2] = ["fmi2Instantiate"; 2];
    const FREE: &'static str = "fmi2FreeInstance";
    #[rustfmt::skip]
    const HANDLES: [&'static str; 6] = [
        "fmi2GetFMUstate", "fmi2SetFMUstate", "fmi2FreeFMUstate", "fmi2SerializedFMUstateSize",
        "fmi2SerializeFMUstate", "fmi2DeSerializeFMUstate",
    ];

    fn check_version(&self) -> &'static [&'static str] {
        assert_eq!(self.version_and_platform(), [c"2.0", c"default"]);
        &["fmi2GetVersion", "fmi2GetTypesPlatform"]
    }

    fn call(&self, function: &'static str, out: &mut Outputs) -> Status {
        let a = out.arguments;
        let (vr, n, all) = (a.pointer(0, &a.vr), a.count(a.vr.len()), (1, a.vr.len()));
        let ([first, second, third], [flag, other_flag], kind) = (a.numbers, a.flags, a.kind);
        let written = |value: &i32| {
            assert_ne!(*value, UNTOUCHED, "no value");
            *value as u64
        };
        match function {
            "fmi2SetDebugLogging" => self.fmi2SetDebugLogging(flag, n, a.pointer(1, &a.categories)),
            "fmi2SetupExperiment" => self.fmi2SetupExperiment(flag, first, second, other_flag, third),
            "fmi2GetReal" => out.reals(all, |value| self.fmi2GetReal(vr, n, value)),
            "fmi2GetInteger" => out.array(all, UNTOUCHED, |v| self.fmi2GetInteger(vr, n, v), written),
            "fmi2GetBoolean" => {
                out.array(all, UNTOUCHED, |value| self.fmi2GetBoolean(vr, n, value), |value| truth(*value))
            }
            "fmi2GetString" => out.texts(|value| self.fmi2GetString(vr, n, value)),
            "fmi2SetReal" => self.fmi2SetReal(vr, n, a.pointer(1, &a.reals)),
            "fmi2SetInteger" => self.fmi2SetInteger(vr, n, a.pointer(1, &a.integers)),
            "fmi2SetBoolean" => self.fmi2SetBoolean(vr, n, a.pointer(1, &a.integers)),
            "fmi2SetString" => self.fmi2SetString(vr, n, a.pointer(1, &a.texts)),
            "fmi2GetDirectionalDerivative" => {
                let (known, seed) = (a.pointer(1, &a.known), a.pointer(2, &a.reals));
                out.reals((3, a.vr.len()), |result| {
                    self.fmi2GetDirectionalDerivative(vr, n, known, a.known.len(), seed, result)
                })
            }
            "fmi2NewDiscreteStates" => {
                let mut info = [fmi2EventInfo { next_event_time: f64::NAN, ..Default::default() }];
                let status = self.fmi2NewDiscreteStates(a.output(0, &mut info));
                if status == Status::Ok {
                    let [now] = info;
                    let flags = [
                        now.new_discrete_states_needed,
                        now.terminate_simulation,
                        now.nominals_of_continuous_states_changed,
                        now.values_of_continuous_states_changed,
                        now.next_event_time_defined,
                    ];
                    out.values.extend(flags.map(truth));
                    out.values.push(finite(now.next_event_time));
                }
                status
            }
            "fmi2CompletedIntegratorStep" => {
                let mut terminate = [-1];
                let to_terminate = a.output(1, &mut terminate);
                let call = |event| self.fmi2CompletedIntegratorStep(flag, event, to_terminate);
                let status = out.array((0, 1), -1, call, |event| truth(*event));
                if status == Status::Ok {
                    out.values.push(truth(terminate[0]));
                }
                status
            }
            "fmi2SetTime" => self.fmi2SetTime(first),
            "fmi2SetContinuousStates" => self.fmi2SetContinuousStates(a.pointer(1, &a.reals), n),
            "fmi2GetDerivatives" => out.reals(all, |x| self.fmi2GetDerivatives(x, n)),
            "fmi2GetEventIndicators" => out.reals(all, |x| self.fmi2GetEventIndicators(x, n)),
            "fmi2GetContinuousStates" => out.reals(all, |x| self.fmi2GetContinuousStates(x, n)),
            "fmi2GetNominalsOfContinuousStates" => {
                out.reals(all, |x| self.fmi2GetNominalsOfContinuousStates(x, n))
            }
            "fmi2SetRealInputDerivatives" => {
                let orders = a.pointer(1, &a.orders);
                self.fmi2SetRealInputDerivatives(vr, n, orders, a.pointer(2, &a.reals))
            }
            "fmi2GetRealOutputDerivatives" => {
                let orders = a.pointer(1, &a.orders);
                out.reals((2, a.vr.len()), |x| self.fmi2GetRealOutputDerivatives(vr, n, orders, x))
            }
            "fmi2DoStep" => self.fmi2DoStep(first, second, flag),
            // These have nothing to tell.
            "fmi2GetStatus" => {
                out.array((0, 0), Status::Warning as i32, |value| self.fmi2GetStatus(kind, value), written)
            }
            "fmi2GetIntegerStatus" => {
                out.array((0, 0), UNTOUCHED, |value| self.fmi2GetIntegerStatus(kind, value), written)
            }
            "fmi2GetStringStatus" => {
                out.array((0, 0), c"untouched".as_ptr(), |text| self.fmi2GetStringStatus(kind, text), |_| 0)
            }
            "fmi2GetRealStatus" => out.reals((0, 1), |value| self.fmi2GetRealStatus(kind, value)),
            "fmi2GetBooleanStatus" => {
                let call = |value| self.fmi2GetBooleanStatus(kind, value);
                out.array((0, 1), UNTOUCHED, call, |value| truth(*value))
            }
            without_arguments => self.call_with_zeros(without_arguments),
        }
    }
}
