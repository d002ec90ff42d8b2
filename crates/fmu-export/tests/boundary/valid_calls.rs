//! One valid call of each function of both FMI versions, for any model in any mode.

use crate::settable;
use fmu_export::{BaseType, Causality, Exported, Interface, Mode, Standard, Status, Variable};
use fmu_test_kit::calls::{Argument, signature};
use fmu_test_kit::{Either, serialized};

/// Arguments of a call, as words, with the memory to which they point.
pub struct ValidCall {
    pub function: &'static str,
    pub arguments: &'static [Argument],
    pub words: Vec<u64>,
    memory: Vec<Box<[u64]>>,
}

/// Returns the index of the first variable that satisfies `wanted`.
fn first<M: Exported>(wanted: impl Fn(&Variable<M>) -> bool) -> Option<u32> {
    M::TABLE.iter().position(wanted).map(|index| index as u32)
}

/// Returns the type of the variables of a getter or setter, by the end of its name.
fn base_of(function: &str) -> BaseType {
    const BASES: [(&str, BaseType); 14] = [
        ("UInt8", BaseType::UInt8),
        ("UInt16", BaseType::UInt16),
        ("UInt32", BaseType::UInt32),
        ("UInt64", BaseType::UInt64),
        ("Int8", BaseType::Int8),
        ("Int16", BaseType::Int16),
        ("Int32", BaseType::Integer),
        ("Int64", BaseType::Int64),
        ("Float32", BaseType::Float32),
        ("Integer", BaseType::Integer),
        ("Boolean", BaseType::Boolean),
        ("String", BaseType::String),
        ("Binary", BaseType::Binary),
        ("", BaseType::Real),
    ];
    BASES.into_iter().find(|(end, _)| function.ends_with(end)).expect("the last one fits").1
}

/// Returns the value reference for the argument of this name; `None` if the model has no such variable.
fn reference<F: Either, M: Exported>(
    name: &str,
    function: &str,
    interface: Interface,
    mode: Mode,
) -> Option<u32> {
    let is_set = function[4..].starts_with("Set");
    let found = match name {
        "unknown" => first::<M>(|of| of.causality() == Causality::Output),
        "known" => first::<M>(|of| of.causality() == Causality::Input || of.is_state()),
        _ if function.ends_with("InputDerivatives") => first::<M>(|of| of.causality() == Causality::Input),
        _ if function.ends_with("OutputDerivatives") => first::<M>(|of| of.causality() == Causality::Output),
        _ => first::<M>(|of| {
            of.base() == base_of(function) && (!is_set || settable::accepted(of, interface, mode))
        }),
    };
    found.map(|index| F::standard().reference(index))
}

impl ValidCall {
    pub fn new<F: Either, M: Exported>(
        fmu: &F,
        function: &'static str,
        interface: Interface,
        mode: Mode,
    ) -> Self {
        let arguments = signature(function).expect("a function of the standard").arguments;
        let mut call = Self { function, arguments, words: Vec::new(), memory: Vec::new() };
        let bytes = fmu.bytes();
        let has_variables = arguments.iter().any(|of| ["vr", "unknown"].contains(&of.name));
        let count =
            has_variables && reference::<F, M>(arguments[0].name, function, interface, mode).is_some();
        for argument in arguments {
            let word = match (argument.pointee(), argument.of, argument.name) {
                (Some((of, read)), _, name) => {
                    let content = match (of, name) {
                        ("ValueReference", _) => {
                            reference::<F, M>(name, function, interface, mode).unwrap_or(0).into()
                        }
                        ("FMUstate" | "FMUState", _) if function.contains("Free") => handle(fmu),
                        (_, "order") => 1,
                        ("Real" | "Float64", _) => 1.0_f64.to_bits(),
                        ("Float32", _) => 1.0_f32.to_bits().into(),
                        ("Boolean", _) => 1,
                        ("UInt16", _) => 2000,
                        ("String", _) if read => c"text".as_ptr().expose_provenance() as u64,
                        ("Binary", _) if read => c"bytes".as_ptr().expose_provenance() as u64,
                        ("String" | "Binary" | "FMUstate" | "FMUState", _) => 0,
                        _ => 3,
                    };
                    let mut memory = vec![0; bytes.len().div_ceil(8).max(16)].into_boxed_slice();
                    memory[0] = content;
                    if name == "x" && read {
                        memory.fill(0.5_f64.to_bits());
                    } else if name == "bytes" && read {
                        for (word, chunk) in memory.iter_mut().zip(bytes.chunks(8)) {
                            let mut all = [0; 8];
                            all[..chunk.len()].copy_from_slice(chunk);
                            *word = u64::from_le_bytes(all);
                        }
                    }
                    call.memory.push(memory);
                    call.memory.last_mut().expect("pushed").as_mut_ptr().expose_provenance() as u64
                }
                (_, of, _) if of.ends_with("FMUstate") || of.ends_with("FMUState") => handle(fmu),
                (_, "usize", "nx") => M::STATES.len() as u64,
                (_, "usize", "ni") => M::MODEL_EXCHANGE.map_or(0, |offer| offer.indicators) as u64,
                (_, "usize", "size") => bytes.len() as u64,
                (_, "usize", _) => count.into(),
                (_, _, "point") => serialized::time(&bytes).to_bits(),
                (_, _, "step_size") => 0.01_f64.to_bits(),
                (_, _, "time") => 0.5_f64.to_bits(),
                (_, _, "kind") if function == "fmi2GetStringStatus" => 1,
                (_, _, "kind") if function == "fmi2GetRealStatus" => 2,
                (_, _, "kind") if function == "fmi2GetBooleanStatus" => 3,
                _ => 0,
            };
            call.words.push(word);
        }
        call
    }

    /// Makes the call, with other words than the valid ones if `change` changes them.
    pub fn make(&self, fmu: &impl Either, change: impl FnOnce(&mut [u64])) -> Status {
        let mut words = self.words.clone();
        change(&mut words);
        // SAFETY: the pointers refer to enough memory, or the FMU must reject them without access.
        unsafe { fmu.call(self.function, &words) }
    }
}

fn handle(fmu: &impl Either) -> u64 {
    fmu.save().expose_provenance() as u64
}

/// Functions that reject a NULL or misaligned pointer, but need none here.
fn needs_no_pointer(function: &str, name: &str) -> bool {
    matches!(function, "fmi2GetStatus" | "fmi2GetIntegerStatus" | "fmi2GetStringStatus")
        || function.contains("FreeFMU") && name == "state"
}

/// Checks every pointer of every function: NULL, misaligned, and of an array larger than memory. The call is
/// rejected with the reason, and changes nothing.
fn pointers<F: Either, M: Exported>() {
    let mut checked = 0;
    for (interface, mode) in fmu_test_kit::checks::modes_of_model::<F, M>() {
        if [Mode::StepFailed, Mode::Terminated, Mode::Error].contains(&mode) {
            continue;
        }
        let fmu = F::in_mode::<M>(interface, mode);
        for function in F::functions() {
            if !crate::call_table::accepted(function, interface, mode)
                || crate::call_table::lacking::<M>(function, interface).is_some()
            {
                continue;
            }
            let mut call = ValidCall::new::<F, M>(&fmu, function, interface, mode);
            if function.ends_with("SetDebugLogging") {
                call.words[1] = 1;
            }
            let is_empty = |of: &Argument| of.of == "usize" && call.words[position(&call, of)] == 0;
            if call.arguments.iter().any(is_empty) {
                continue;
            }
            for (index, argument) in call.arguments.iter().enumerate() {
                let label = format!("{function} in {mode} of {interface}, {}", argument.name);
                let Some((of, _)) = argument.pointee() else { continue };
                if needs_no_pointer(function, argument.name) {
                    continue;
                }
                let message = fmu.rejected(&label, |fmu| call.make(fmu, |words| words[index] = 0));
                assert!(message.contains("NULL"), "{label}: {message}");
                checked += 1;
                let one_byte = ["Int8", "UInt8", "Byte"].contains(&of)
                    || of == "Boolean" && F::standard() == Standard::Fmi3;
                if !one_byte {
                    let message = fmu.rejected(&label, |fmu| call.make(fmu, |words| words[index] += 1));
                    assert!(message.contains("not aligned"), "{label}: {message}");
                }
            }
            let is_array =
                call.arguments.first().is_some_and(|of| of.name == "vr") && !function.ends_with("Binary");
            if is_array || function.ends_with("InputDerivatives") {
                let message = fmu.rejected(function, |fmu| {
                    call.make(fmu, |words| {
                        for (word, argument) in words.iter_mut().zip(call.arguments) {
                            *word = if argument.of == "usize" { u64::MAX / 4 } else { *word };
                        }
                    })
                });
                assert!(message.contains("larger than memory"), "{function}: {message}");
            }
        }
    }
    assert!(checked > 40, "only {checked}");
}

fn position(call: &ValidCall, argument: &Argument) -> usize {
    call.arguments.iter().position(|of| std::ptr::eq(of, argument)).expect("an argument of the call")
}

#[test]
fn null_and_misaligned_pointers() {
    use crate::models::*;
    use fmu_test_kit::{Importer, fmi3};
    pointers::<Importer, Oscillator>();
    pointers::<Importer, Talker>();
    pointers::<Importer, Ball>();
    pointers::<fmi3::Importer, Oscillator>();
    pointers::<fmi3::Importer, Ball>();
    pointers::<fmi3::Importer, Talker>();
    pointers::<fmi3::Importer, Palette>();
}
