//! One valid call of each function of both FMI versions, for any model in any mode.

use fmu_export::fmi2::types::fmi2EventInfo;
use fmu_export::{Causality, Exported, Mode, Status, Variability, Variable};
use fmu_test_kit::calls::{Argument, signature};
use fmu_test_kit::fault_injection::{bases_of, element_size};
use fmu_test_kit::{Either, serialized};
use std::ffi::c_void;
use std::mem::MaybeUninit;
use std::ptr::without_provenance;

/// Arguments of a call as 64-bit words, with the memory to which they point. Memory that the function must write is
/// uninitialized, so that Miri and valgrind detect missing values.
pub struct ValidCall {
    pub function: &'static str,
    pub arguments: &'static [Argument],
    pub words: Vec<u64>,
    memory: Vec<Box<[MaybeUninit<u64>]>>,
}

/// Returns the index of the first variable that satisfies `wanted`.
fn first<M: Exported>(wanted: impl Fn(&Variable<M>) -> bool) -> Option<u32> {
    M::TABLE.iter().position(wanted).map(|index| index as u32)
}

/// Returns the value reference for the argument of this name; `None` if the model has no such variable.
fn reference<F: Either, M: Exported>(name: &str, function: &str, mode: Mode) -> Option<u32> {
    let is_set = function[4..].starts_with("Set");
    let is_settable = |variable: &Variable<M>| match variable.causality() {
        Causality::Parameter => true,
        Causality::Input => mode != Mode::ContinuousTime || variable.variability() == Variability::Continuous,
        _ => false,
    };
    let found = match name {
        "unknown" => first::<M>(|variable| variable.causality() == Causality::Output),
        "known" => first::<M>(|variable| variable.causality() == Causality::Input || variable.is_state()),
        _ if function.ends_with("InputDerivatives") => {
            first::<M>(|variable| variable.causality() == Causality::Input)
        }
        _ if function.ends_with("OutputDerivatives") => {
            first::<M>(|variable| variable.causality() == Causality::Output)
        }
        _ => first::<M>(|variable| {
            bases_of(function).contains(&variable.base()) && (!is_set || is_settable(variable))
        }),
    };
    found.map(|index| F::standard().reference(index))
}

impl ValidCall {
    pub fn new<F: Either, M: Exported>(fmu: &F, function: &'static str, mode: Mode) -> Self {
        let arguments = signature(function).expect("a function of the standard").arguments;
        let mut call = Self { function, arguments, words: Vec::new(), memory: Vec::new() };
        let bytes = fmu.bytes();
        let has_variables = arguments.iter().any(|argument| ["vr", "unknown"].contains(&argument.name));
        let count = has_variables && reference::<F, M>(arguments[0].name, function, mode).is_some();
        for argument in arguments {
            let word = match (argument.pointee(), argument.of, argument.name) {
                (Some((of, read)), _, name) => {
                    let number = match (of, name) {
                        ("ValueReference", _) => reference::<F, M>(name, function, mode).unwrap_or(0).into(),
                        ("Real" | "Float64", _) => 1.0_f64.to_bits(),
                        ("Float32", _) => 1.0_f32.to_bits().into(),
                        ("UInt16", _) => 2000,
                        _ if is_handle(of) => 0,
                        _ => 1,
                    };
                    // The first word of the memory. It is stored as a pointer, because a pointer that is stored as an
                    // integer has no provenance.
                    let content = match of {
                        "String" if read => c"text".as_ptr().cast(),
                        "Binary" if read => c"bytes".as_ptr().cast(),
                        _ if is_handle(of) && function.contains("Free") => fmu.save().cast_const().cast(),
                        _ => without_provenance(number as usize),
                    };
                    let mut memory = Box::new_uninit_slice(bytes.len().div_ceil(8).max(16));
                    if read || is_handle(of) {
                        memory.fill(MaybeUninit::new(if name == "x" { 0.5_f64.to_bits() } else { 0 }));
                        // SAFETY: the memory has the size and alignment of at least one pointer.
                        unsafe { memory.as_mut_ptr().cast::<*const c_void>().write(content) };
                    }
                    if name == "bytes" && read {
                        for (word, chunk) in memory.iter_mut().zip(bytes.chunks(8)) {
                            let mut all = [0; 8];
                            all[..chunk.len()].copy_from_slice(chunk);
                            word.write(u64::from_le_bytes(all));
                        }
                    }
                    call.memory.push(memory);
                    call.memory.last_mut().expect("pushed").as_mut_ptr().expose_provenance() as u64
                }
                (_, of, _) if is_handle(&of[4..]) => handle(fmu),
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

    /// Makes the call after `change` has changed some of the words.
    pub fn make(&self, fmu: &impl Either, change: impl FnOnce(&mut [u64])) -> Status {
        let mut words = self.words.clone();
        change(&mut words);
        // SAFETY: the pointers point to enough memory, or the FMU must reject them before it accesses them.
        unsafe { fmu.call(self.function, &words) }
    }

    /// Lets the array to which the call writes begin in the middle of the one of its references, of which there are three, because the
    /// fast paths take one, two or four. Returns the number of the argument that is written; `None` if the call lacks one of the two.
    pub fn overlap(&mut self) -> Option<usize> {
        let written = self.arguments.iter().rposition(|of| of.pointee().is_some_and(|(_, read)| !read));
        let first = self.arguments.first().and_then(Argument::pointee);
        let (Some(written), Some(("ValueReference", true))) = (written, first) else {
            return None;
        };
        let reference = self.memory[0].as_mut_ptr().cast::<u32>();
        // SAFETY: the memory of an argument has at least 16 words, and `new` has written the first reference.
        unsafe { (1..3).for_each(|index| reference.add(index).write(*reference)) };
        self.words[written] = self.words[0] + 8;
        for (word, argument) in self.words.iter_mut().zip(self.arguments) {
            *word = if argument.of == "usize" { 3 } else { *word };
        }
        Some(written)
    }

    /// Reads all values that a successful call must have written, so that Miri and valgrind detect uninitialized ones.
    /// Returns the number of values.
    pub fn read_outputs(&self) -> usize {
        let mut sizes = self.arguments.iter().zip(&self.words).filter(|(argument, _)| argument.of == "usize");
        let count = sizes.next_back().map_or(1, |(_, word)| *word as usize);
        let outputs = self.arguments.iter().filter_map(Argument::pointee).zip(&self.memory);
        let mut read = 0;
        for ((of, _), memory) in outputs.filter(|((of, to_read), _)| !to_read && !is_handle(of)) {
            let start = memory.as_ptr();
            for index in 0..count {
                // SAFETY: the call returned OK, so it has written the values.
                let value = unsafe {
                    match element_size(of, self.function) {
                        _ if of == "EventInfo" => {
                            u64::from(*start.cast::<fmi2EventInfo>() == Default::default())
                        }
                        1 => start.cast::<u8>().add(index).read().into(),
                        2 => start.cast::<u16>().add(index).read().into(),
                        4 => start.cast::<u32>().add(index).read().into(),
                        _ => start.cast::<*const u8>().add(index).read().addr() as u64,
                    }
                };
                assert_ne!(std::hint::black_box(value), 0x0123_4567_89ab_cdef);
                read += 1;
            }
        }
        read
    }
}

fn is_handle(of: &str) -> bool {
    ["FMUstate", "FMUState"].contains(&of)
}

fn handle(fmu: &impl Either) -> u64 {
    fmu.save().expose_provenance() as u64
}
