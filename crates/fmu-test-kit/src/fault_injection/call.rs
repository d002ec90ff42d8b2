//! One call of a function on an instance. Arguments are chosen by the types and names in the list of functions.

use super::arguments::CallArguments;
use super::standards::Caller;
use crate::serialized::fnv1a;
use fmi_abi::calls::{Argument, signature};
use fmu_export::Status;
use std::ffi::{CStr, c_char};

/// A function with its arguments.
#[derive(Clone, Debug)]
pub struct Call {
    pub function: &'static str,
    pub arguments: CallArguments,
}

/// Result of a call. Values are stored as bits, so that even NaN can be compared.
#[derive(Clone, Debug, PartialEq)]
pub struct CallResult {
    pub status: Status,
    pub values: Vec<u64>,
}

/// Returns whether a function has a handle of a saved state as an argument. The session calls such functions itself.
pub fn has_handles(function: &str) -> bool {
    function.contains("FMUstate") || function.contains("FMUState")
}

/// Returns the size in bytes of an element to which an argument of type `of` points. It is 4 for an `EventInfo`, which is
/// handled as an array of 4-byte words.
pub fn element_size(of: &str, function: &str) -> usize {
    match of {
        "Boolean" if function.starts_with("fmi2") => 4,
        "Int8" | "UInt8" | "Boolean" | "Clock" | "Byte" => 1,
        "Int16" | "UInt16" => 2,
        "Float64" | "Real" | "Int64" | "UInt64" | "String" | "Binary" | "usize" => 8,
        _ => 4,
    }
}

impl Call {
    /// Returns whether a call with this status must leave the state unchanged. A step of FMI 2.0 that ends early returns
    /// Discard, but changes the state.
    pub fn must_not_change(&self, status: Status) -> bool {
        let early = self.function == "fmi2DoStep" && status == Status::Discard;
        status != Status::Ok && !early || self.function[4..].starts_with("Get")
    }

    /// Calls the function. Panics if the result is invalid, such as an unexpected status, a value that is not finite, a string
    /// that is not UTF-8, or more or fewer values than requested.
    pub fn run<F: Caller>(&self, fmu: &F) -> CallResult {
        let (name, a) = (self.function, &self.arguments);
        let list = signature(name).expect("a function of the standard").arguments;
        let mut arrays: Vec<Array> = Vec::new();
        let mut flags = a.flags.iter().cycle();
        let word = |argument: &Argument| {
            if let Some(pointee) = argument.pointee() {
                let mut array = Array::new(pointee, argument.name, list, name, a);
                let address = a.address(arrays.len(), array.elements.address(), array.elements.size);
                arrays.push(array);
                return address as u64;
            }
            match (argument.of, argument.name) {
                ("usize", of) => self.count(of) as u64,
                (_, "tolerance") => a.numbers[2].to_bits(),
                (_, "stop_time") => (a.numbers[0] + a.numbers[2]).to_bits(),
                (_, "step_size") => a.numbers[1].to_bits(),
                (of, _) if of.ends_with("Real") || of.ends_with("Float64") => a.numbers[0].to_bits(),
                // Sometimes passes an invalid Boolean.
                (of, _) if of.ends_with("Boolean") => match flags.next() {
                    Some(0 | 2) => 0,
                    other => other.map_or(0, |flag| *flag as u64),
                },
                _ => a.kind as u64,
            }
        };
        let words: Vec<u64> = list.iter().map(word).collect();
        // SAFETY: the function has this name. Each pointer points to at least one value more than the counts say, and
        // the values live as long as `arrays`. The FMU rejects arrays that are NULL, misaligned or of impossible length
        // before it accesses them.
        let status = unsafe { fmu.call(name, &words) };
        let discards = (name.ends_with("Status") || name.ends_with("DoStep")) && status == Status::Discard;
        assert!(discards || [Status::Ok, Status::Error].contains(&status), "{name} returns {status:?}");
        let mut values = Vec::new();
        for index in 0..arrays.len() {
            let array = &arrays[index];
            let Some(count) = array.written else { continue };
            assert!(array.elements.end_untouched(count), "written after the end: {self:?}");
            if status == Status::Ok {
                let before = index.checked_sub(1).map(|index| &arrays[index].elements);
                array.values(count, before, &mut values);
            }
        }
        if name.ends_with("DoStep") && status == Status::Ok {
            let [point, size, _] = a.numbers;
            assert!(size >= 0.0 && (point + size).is_finite(), "time goes back: {self:?}");
            if let [_, _, early, end] = values[..] {
                let end = f64::from_bits(end);
                assert!(end >= point && end <= point + size, "{end}: {self:?}");
                assert!(early == 0 || end < point + size, "an early return at the end of the step: {self:?}");
            }
        }
        CallResult { status, values }
    }

    /// Returns the number to pass for the size argument of this name.
    fn count(&self, of: &str) -> usize {
        let (a, adjoint) = (&self.arguments, self.function.contains("Adjoint"));
        match of {
            "n_known" => a.count(a.known.len()),
            "n_seed" if !adjoint => a.count(a.known_values),
            "n_sensitivity" if adjoint => a.count(a.known_values),
            "n_seed" | "n_sensitivity" => a.count(a.values),
            // Sometimes passes a wrong number of values.
            "n_value" => a.count(a.values).saturating_add((a.kind == 3).into()),
            _ => a.count(a.vr.len()),
        }
    }
}

/// Value of each byte of an array before the FMU writes to it.
const UNTOUCHED: u8 = 0xa5;

/// Memory of an array of numbers or pointers of one size, followed by at least two more elements. It is aligned for any type.
struct Elements {
    size: usize,
    memory: Vec<u64>,
}

impl Elements {
    fn new(size: usize, count: usize, bits: impl Iterator<Item = u64>) -> Self {
        let mut bytes: Vec<u8> = bits.flat_map(|bits| bits.to_le_bytes().into_iter().take(size)).collect();
        bytes.resize((count + 2).next_multiple_of(8) * size, UNTOUCHED);
        let (words, _) = bytes.as_chunks();
        Self { size, memory: words.iter().map(|word| u64::from_le_bytes(*word)).collect() }
    }

    fn address(&mut self) -> usize {
        self.memory.as_mut_ptr().expose_provenance()
    }

    /// Returns the bits of the element at this index.
    fn bits(&self, index: usize) -> u64 {
        let at = index * self.size;
        let shifted = self.memory[at / 8] >> (8 * (at % 8));
        if self.size == 8 { shifted } else { shifted & ((1 << (8 * self.size)) - 1) }
    }

    fn untouched(&self) -> u64 {
        u64::from_le_bytes([UNTOUCHED; 8]) >> (64 - 8 * self.size)
    }

    /// Returns whether nothing has been written after `count` elements.
    fn end_untouched(&self, count: usize) -> bool {
        let all = 8 * self.memory.len() / self.size;
        (count..all).all(|index| self.bits(index) == self.untouched())
    }
}

/// An array that a function reads or writes.
struct Array {
    /// Type of the elements, without the prefix of the FMI version.
    of: &'static str,
    elements: Elements,
    /// Number of elements that the function may write; `None` if it only reads.
    written: Option<usize>,
    /// Memory to which the elements point.
    _bytes: Vec<u8>,
}

impl Array {
    /// Creates the array for the argument of this name with this element type.
    fn new(
        (of, to_read): (&'static str, bool),
        name: &str,
        list: &[Argument],
        function: &str,
        a: &CallArguments,
    ) -> Self {
        let size = element_size(of, function);
        let mut bytes = Vec::new();
        if !to_read {
            let count = match list.iter().rfind(|other| other.of == "usize").map(|variable| variable.name) {
                _ if of == "EventInfo" => EVENT_INFO / size,
                Some("n_value") => a.values,
                Some("n_sensitivity") if function.contains("Adjoint") => a.known_values,
                Some("n_sensitivity") => a.values,
                Some(_) => a.vr.len(),
                None => 1,
            };
            let elements = Elements::new(size, count, std::iter::empty());
            return Self { of, elements, written: Some(count), _bytes: bytes };
        }
        let address = |string: *const c_char| string.expose_provenance() as u64;
        // As many elements as the largest count that may be passed.
        let room = a.values.max(a.known_values).max(a.vr.len()) + 2;
        let bits: Vec<u64> = match (of, name) {
            ("ValueReference", "known") => a.known.iter().map(|vr| u64::from(*vr)).collect(),
            ("ValueReference", _) => a.vr.iter().map(|vr| u64::from(*vr)).collect(),
            ("String", "categories") => a.categories.iter().map(|string| address(*string)).collect(),
            ("String", _) => a.strings.iter().map(|string| address(*string)).collect(),
            // Some of these sizes of binary values are larger than any variable of the test models permits.
            ("usize", _) => a.integers.iter().map(|n| *n as u64 % (LONGEST + 1)).collect(),
            ("Binary", _) => {
                bytes = a.reals.iter().flat_map(|value| value.to_le_bytes()).collect();
                bytes.resize(bytes.len() + LONGEST as usize, 7);
                vec![bytes.as_ptr().expose_provenance() as u64; room]
            }
            (_, "order") => a.orders.iter().map(|order| *order as u64).collect(),
            ("Real" | "Float64", _) => a.reals.iter().map(|value| value.to_bits()).collect(),
            ("Float32", _) => a.reals.iter().map(|value| (*value as f32).to_bits().into()).collect(),
            _ => a.integers.iter().map(|value| *value as u64).collect(),
        };
        let rest = match of {
            "String" | "usize" => 0,
            _ => bits.first().copied().unwrap_or_default(),
        };
        let count = bits.len().max(room);
        let bits = bits.into_iter().chain(std::iter::repeat(rest)).take(count);
        Self { of, elements: Elements::new(size, count, bits), written: None, _bytes: bytes }
    }

    /// Checks the written values and appends their bits to `values`; strings and binary values are hashed. `sizes` is the
    /// previous array, which contains the sizes of binary values.
    fn values(&self, count: usize, sizes: Option<&Elements>, values: &mut Vec<u64>) {
        if self.of == "EventInfo" {
            let bits = |index| self.elements.bits(index);
            values.extend((0..5).map(|index| checked_boolean(bits(index))));
            values.push(finite(f64::from_bits(bits(6) | bits(7) << 32)));
            return;
        }
        for index in 0..count {
            let bits = self.elements.bits(index);
            assert!(self.elements.size < 4 || bits != self.elements.untouched(), "no value");
            values.push(match self.of {
                "Real" | "Float64" => finite(f64::from_bits(bits)),
                "Float32" => {
                    finite(f32::from_bits(bits as u32).into());
                    bits
                }
                "Boolean" | "Clock" => checked_boolean(bits),
                "String" => {
                    assert!(bits != 0, "no string");
                    // SAFETY: the FMU's string is valid until the next call.
                    let string = unsafe { CStr::from_ptr(std::ptr::with_exposed_provenance(bits as usize)) }
                        .to_bytes();
                    assert!(std::str::from_utf8(string).is_ok(), "not UTF-8: {string:?}");
                    u64::from_le_bytes(fnv1a(string))
                }
                "Binary" => {
                    let size = sizes.expect("an array of sizes must precede").bits(index) as usize;
                    // SAFETY: the FMU's bytes have this length and are valid until the next call.
                    let bytes = unsafe {
                        std::slice::from_raw_parts(std::ptr::with_exposed_provenance(bits as usize), size)
                    };
                    u64::from_le_bytes(fnv1a(bytes))
                }
                _ => bits,
            });
        }
    }
}

/// Largest size in bytes of a binary value that is set.
const LONGEST: u64 = 24;

/// Size of `fmi2EventInfo` in bytes: five Booleans, padding, and the time of the next event.
const EVENT_INFO: usize = size_of::<fmu_export::fmi2::types::fmi2EventInfo>();

/// Checks that a number is finite and returns its bits.
fn finite(value: f64) -> u64 {
    assert!(value.is_finite(), "{value} is not finite");
    value.to_bits()
}

/// Checks that a Boolean is 0 or 1 and returns its bits.
fn checked_boolean(flag: u64) -> u64 {
    assert!(flag <= 1, "{flag} is neither 0 nor 1");
    flag
}
