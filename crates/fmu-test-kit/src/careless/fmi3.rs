//! The careless importer of FMI 3.0.

use super::call::{Caller, Outputs, finite, truth};
use crate::fmi3::Importer;
use crate::serialized::fnv1a;
use fmu_export::Standard;
use fmu_export::fmi3::types::*;
use std::ffi::CStr;
use std::ptr::null;
use std::slice::from_mut;

/// Functions of numbers: the arguments that are set, and the bits of what is got.
macro_rules! numbers {
    ($self:ident $out:ident $m:ident: $($get:ident $set:ident $source:ident $untouched:expr, $convert:expr, $bits:expr;)+) => {
        /// Gets or sets numbers of one type, if the function does.
        fn numbers(&$self, function: &str, $out: &mut Outputs, $m: usize) -> Option<Status> {
            let a = $out.arguments;
            let (vr, n) = (a.pointer(0, &a.vr), a.count(a.vr.len()));
            Some(match function {
                $(
                    stringify!($get) => {
                        $out.array((1, a.values), $untouched, |value| $self.$get(vr, n, value, $m), $bits)
                    }
                    stringify!($set) => {
                        let mut source: Vec<_> = a.$source.iter().map($convert).collect();
                        source.resize(a.values + 2, source.first().copied().unwrap_or_default());
                        $self.$set(vr, n, a.pointer(1, &source), $m)
                    }
                )+
                _ => return None,
            })
        }
    };
}

impl Importer {
    numbers! { self out m:
        fmi3GetFloat32 fmi3SetFloat32 reals f32::INFINITY, |v| *v as f32, |v| u64::from(v.to_bits());
        fmi3GetFloat64 fmi3SetFloat64 reals f64::INFINITY, |v| *v, |v| finite(*v);
        fmi3GetInt8 fmi3SetInt8 integers 77, |v| *v as i8, |v| *v as u64;
        fmi3GetUInt8 fmi3SetUInt8 integers 77, |v| *v as u8, |v| u64::from(*v);
        fmi3GetInt16 fmi3SetInt16 integers 77, |v| *v as i16, |v| *v as u64;
        fmi3GetUInt16 fmi3SetUInt16 integers 77, |v| *v as u16, |v| u64::from(*v);
        fmi3GetInt32 fmi3SetInt32 integers 77, |v| *v, |v| *v as u64;
        fmi3GetUInt32 fmi3SetUInt32 integers 77, |v| *v as u32, |v| u64::from(*v);
        fmi3GetInt64 fmi3SetInt64 integers 77, |v| i64::from(*v), |v| *v as u64;
        fmi3GetUInt64 fmi3SetUInt64 integers 77, |v| *v as u64, |v| *v;
        fmi3GetBoolean fmi3SetBoolean integers 77, |v| *v as u8, |v| truth(*v);
    }
}

impl Caller for Importer {
    const STANDARD: Standard = Standard::Fmi3;
    #[rustfmt::skip]
    const STEPS: &'static [&'static str] = &[
        "fmi3DoStep", "fmi3DoStep", "fmi3DoStep", "fmi3SetFloat64", "fmi3GetFloat64",
        "fmi3EnterEventMode", "fmi3UpdateDiscreteStates", "fmi3EnterStepMode",
    ];
    #[rustfmt::skip]
    const INTEGRATION: &'static [&'static str] = &[
        "fmi3SetTime", "fmi3SetContinuousStates", "fmi3SetFloat64", "fmi3GetFloat64",
        "fmi3GetContinuousStateDerivatives", "fmi3CompletedIntegratorStep", "fmi3EnterEventMode",
        "fmi3UpdateDiscreteStates", "fmi3EnterContinuousTimeMode",
    ];
    const BEGINNING: &'static [&'static str] =
        &["fmi3Reset", "fmi3EnterInitializationMode", "fmi3ExitInitializationMode"];
    const INSTANTIATE: [&'static str; 2] = ["fmi3InstantiateCoSimulation", "fmi3InstantiateModelExchange"];
    const FREE: &'static str = "fmi3FreeInstance";
    #[rustfmt::skip]
    const HANDLES: [&'static str; 6] = [
        "fmi3GetFMUState", "fmi3SetFMUState", "fmi3FreeFMUState", "fmi3SerializedFMUStateSize",
        "fmi3SerializeFMUState", "fmi3DeserializeFMUState",
    ];

    fn check_version(&self) -> &'static [&'static str] {
        // SAFETY: a string that the library keeps.
        assert_eq!(unsafe { CStr::from_ptr((self.functions().fmi3GetVersion)()) }, c"3.0");
        &["fmi3GetVersion"]
    }

    fn call(&self, function: &'static str, out: &mut Outputs) -> Status {
        let a = out.arguments;
        let (vr, n, all) = (a.pointer(0, &a.vr), a.count(a.vr.len()), (1, a.vr.len()));
        // At times another number of values.
        let m = a.count(a.values);
        let m = if a.kind == 3 { m.saturating_add(1) } else { m };
        let room = a.values + 2;
        if let Some(status) = self.numbers(function, out, m) {
            return status;
        }
        let [first, second, third] = a.numbers;
        match function {
            "fmi3SetDebugLogging" => {
                self.fmi3SetDebugLogging(a.flags[0] as u8, n, a.pointer(0, &a.categories))
            }
            "fmi3EnterInitializationMode" => {
                let [tolerance_defined, stop_defined] = a.flags.map(|flag| u8::from(flag == 3));
                let stop_time = first + 1e4;
                self.fmi3EnterInitializationMode(tolerance_defined, third, first, stop_defined, stop_time)
            }
            "fmi3GetString" => out.texts(|value| self.fmi3GetString(vr, n, value, m)),
            "fmi3SetString" => {
                let mut texts = a.texts.clone();
                texts.resize(room, null());
                self.fmi3SetString(vr, n, a.pointer(1, &texts), m)
            }
            "fmi3GetBinary" => {
                let (mut sizes, mut arrays) = (vec![usize::MAX; room], vec![null(); room]);
                let arrays_to = a.output(1, &mut arrays);
                let status = self.fmi3GetBinary(vr, n, a.output(2, &mut sizes), arrays_to, m);
                let written = if status == Status::Ok { a.values } else { 0 };
                assert!(sizes[written..].iter().all(|size| *size == usize::MAX), "too much: {a:?}");
                for (size, bytes) in sizes[..written].iter().zip(&arrays) {
                    // SAFETY: as many bytes of the FMU's, valid until the next call.
                    let bytes = unsafe { std::slice::from_raw_parts(*bytes, *size) };
                    out.values.push(u64::from_le_bytes(fnv1a(bytes)));
                }
                status
            }
            "fmi3SetBinary" => {
                // Some are longer than any variable here allows.
                const LONGEST: usize = 24;
                let mut bytes: Vec<u8> = a.reals.iter().flat_map(|value| value.to_le_bytes()).collect();
                bytes.resize(bytes.len() + LONGEST, 7);
                let sizes = (0..room).map(|at| a.integers.get(at).map_or(0, |n| *n as usize % (LONGEST + 1)));
                let (sizes, arrays): (Vec<_>, _) = (sizes.collect(), vec![bytes.as_ptr(); room]);
                self.fmi3SetBinary(vr, n, a.pointer(2, &sizes), a.pointer(1, &arrays), m)
            }
            "fmi3GetDirectionalDerivative" | "fmi3GetAdjointDerivative" => {
                let forward = function == "fmi3GetDirectionalDerivative";
                let (unknowns, knowns) = (a.count(a.values), a.known_values);
                let (wanted, seeds) = if forward { (unknowns, knowns) } else { (knowns, unknowns) };
                let (seed, known) = (a.pointer(2, &a.reals), a.pointer(3, &a.known));
                let call =
                    if forward { Self::fmi3GetDirectionalDerivative } else { Self::fmi3GetAdjointDerivative };
                let count = if forward { a.values } else { a.known_values };
                out.reals((1, count), |result| {
                    call(self, vr, n, known, a.known.len(), seed, seeds, result, wanted)
                })
            }
            "fmi3UpdateDiscreteStates" => {
                let (mut flags, mut next) = ([2_u8; 5], f64::NAN);
                let [x, y, z, v, w] = flags.each_mut().map(from_mut);
                let (x, w, next_time) = (a.output(0, x), a.output(1, w), a.output(2, from_mut(&mut next)));
                let (y, z, v) = (y.as_mut_ptr(), z.as_mut_ptr(), v.as_mut_ptr());
                let status = self.fmi3UpdateDiscreteStates(x, y, z, v, w, next_time);
                if status == Status::Ok {
                    out.values.extend(flags.map(truth));
                    out.values.push(finite(next));
                }
                status
            }
            "fmi3CompletedIntegratorStep" => {
                let mut terminate = [2_u8];
                let to_terminate = a.output(1, &mut terminate);
                let call = |event| self.fmi3CompletedIntegratorStep(1, event, to_terminate);
                let status = out.array((0, 1), 2, call, |event| truth(*event));
                if status == Status::Ok {
                    out.values.push(truth(terminate[0]));
                }
                status
            }
            "fmi3SetTime" => self.fmi3SetTime(first),
            "fmi3SetContinuousStates" => self.fmi3SetContinuousStates(a.pointer(0, &a.reals), n),
            "fmi3GetContinuousStateDerivatives" => {
                out.reals(all, |x| self.fmi3GetContinuousStateDerivatives(x, n))
            }
            "fmi3GetEventIndicators" => out.reals(all, |x| self.fmi3GetEventIndicators(x, n)),
            "fmi3GetContinuousStates" => out.reals(all, |x| self.fmi3GetContinuousStates(x, n)),
            "fmi3GetNominalsOfContinuousStates" => {
                out.reals(all, |x| self.fmi3GetNominalsOfContinuousStates(x, n))
            }
            "fmi3GetOutputDerivatives" => {
                let orders = a.pointer(2, &a.orders);
                out.reals((1, a.values), |x| self.fmi3GetOutputDerivatives(vr, n, orders, x, m))
            }
            "fmi3DoStep" => {
                let (mut flags, mut end) = ([2_u8; 3], f64::NAN);
                let [event, terminate, early] = flags.each_mut().map(from_mut);
                let (event, terminate) = (a.output(0, event), a.output(1, terminate));
                let (early, to_end) = (a.output(2, early), a.output(3, from_mut(&mut end)));
                let status = self.fmi3DoStep(first, second, 1, event, terminate, early, to_end);
                if status == Status::Ok {
                    out.values.extend(flags.map(truth));
                    out.values.push(finite(end));
                    assert!(end >= first && end <= first + second, "{end}: {a:?}");
                    assert!(flags[2] == 0 || end < first + second, "not early: {a:?}");
                }
                status
            }
            "fmi3GetNumberOfEventIndicators" => {
                out.array((0, 1), usize::MAX, |n| self.fmi3GetNumberOfEventIndicators(n), |n| *n as u64)
            }
            "fmi3GetNumberOfContinuousStates" => {
                out.array((0, 1), usize::MAX, |n| self.fmi3GetNumberOfContinuousStates(n), |n| *n as u64)
            }
            without_arguments => self.call_with_zeros(without_arguments),
        }
    }
}
