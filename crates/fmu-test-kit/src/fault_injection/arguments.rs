//! Decodes the arguments of a call from bytes. Most are valid, so that simulations make progress. The others cover the
//! faults of a C caller that an FMU can detect.

use arbitrary::{Result, Unstructured};
use fmu_export::fmi2::types::*;
use fmu_export::{BaseType, Causality, Exported, Standard, Variable};
use std::ffi::CStr;
use std::ptr::null;

/// Base types of the variables that getters and setters accept, by the last part of the function's name.
#[rustfmt::skip]
const BY_END: [(&str, &[BaseType]); 15] = {
    use BaseType::*;
    [
        ("Real", &[Real]),
        ("Float64", &[Real]),
        ("Integer", &[Integer, Enumeration]),
        ("Boolean", &[Boolean]),
        ("String", &[String]),
        ("Float32", &[Float32]),
        ("UInt8", &[UInt8]),
        ("Int8", &[Int8]),
        ("UInt16", &[UInt16]),
        ("Int16", &[Int16]),
        ("UInt32", &[UInt32]),
        ("Int32", &[Integer]),
        ("UInt64", &[UInt64]),
        ("Int64", &[Int64, Enumeration]),
        ("Binary", &[Binary]),
    ]
};

/// Returns the base types of the variables that a function accepts; Real if its name has no ending of the table.
pub fn bases_of(function: &str) -> &'static [BaseType] {
    BY_END.into_iter().find(|(end, _)| function.ends_with(end)).unwrap_or(BY_END[0]).1
}

/// Value references, grouped by the functions that use them.
pub struct Variables {
    all: u32,
    real_inputs: Vec<u32>,
    real_starts: Vec<u32>,
    unknowns: Vec<u32>,
    /// Value references for the functions whose names end with this string.
    by_end: [(&'static str, Vec<u32>); BY_END.len()],
    states: usize,
    indicators: usize,
    /// Value references of arrays in FMI 3.0, each with its number of values.
    arrays: Vec<(u32, usize)>,
}

impl Variables {
    /// Collects the value references of a model in an FMI version.
    pub fn new<M: Exported>(standard: Standard) -> Self {
        let reference = |index| standard.reference(index);
        // In FMI 3.0, elements of arrays are not variables.
        let is_one = |variable: &Variable<M>| standard == Standard::Fmi2 || variable.element() == 0;
        let references = |wanted: &dyn Fn(&Variable<M>) -> bool| {
            let indices = (0..).zip(M::TABLE).filter(|(_, variable)| is_one(variable) && wanted(variable));
            indices.map(|(index, _)| reference(index)).collect::<Vec<u32>>()
        };
        let reals = |wanted: fn(&Variable<M>) -> bool| {
            references(&|variable| variable.base() == BaseType::Real && wanted(variable))
        };
        Self {
            all: reference(M::TABLE.len() as u32),
            real_inputs: reals(|variable| variable.causality() == Causality::Input),
            real_starts: reals(Variable::has_start),
            unknowns: reals(|variable| {
                variable.causality() == Causality::Output || variable.differentiates().is_some()
            }),
            by_end: BY_END
                .map(|(end, bases)| (end, references(&|variable| bases.contains(&variable.base())))),
            states: M::STATES.len(),
            indicators: M::MODEL_EXCHANGE.map_or(0, |offer| offer.indicators),
            arrays: (0..)
                .zip(M::TABLE)
                .filter(|(_, variable)| standard == Standard::Fmi3 && variable.element() == 0)
                .map(|(index, variable)| (reference(index), variable.length()))
                .filter(|(_, length)| *length > 1)
                .collect(),
        }
    }

    /// Returns the number of values of these variables; an array has one value for each element.
    fn values(&self, references: &[u32]) -> usize {
        let length = |reference: &u32| self.arrays.iter().find(|(array, _)| array == reference);
        references.iter().map(|reference| length(reference).map_or(1, |(_, length)| *length)).sum()
    }

    /// Chooses value references, mostly of variables that the function accepts.
    fn references(&self, u: &mut Unstructured, count: usize, function: &str) -> Result<Vec<u32>> {
        let fitting = match function {
            "fmi2SetReal" if u.ratio(1, 2)? => &self.real_inputs,
            "fmi2SetReal" => &self.real_starts,
            "fmi2SetRealInputDerivatives" => &self.real_inputs,
            "fmi2GetDirectionalDerivative" => &self.unknowns,
            name => {
                let of_type = self.by_end.iter().find(|(end, _)| name.ends_with(end));
                &of_type.unwrap_or(&self.by_end[0]).1
            }
        };
        let fits = u.ratio(15, 16)? && !fitting.is_empty();
        array(count, || {
            let odd = [self.all, self.all + 1, u32::MAX, 1 << 31, self.all / 2, 0];
            Ok(*u.choose(if fits { fitting } else { &odd })?)
        })
    }
}

/// Kind of a pointer that is passed. The FMU must be able to detect an invalid one, because any other crashes the test.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Pointer {
    Valid,
    Null,
    Misaligned,
}

/// Arguments for any function; each function uses some of them.
#[derive(Clone, Debug)]
pub struct CallArguments {
    pub vr: Vec<u32>,
    pub known: Vec<u32>,
    /// Number of values of the variables in `vr`, which is larger than their number if they include arrays.
    pub values: usize,
    pub known_values: usize,
    pub orders: Vec<i32>,
    pub reals: Vec<f64>,
    pub integers: Vec<i32>,
    pub strings: Vec<fmi2String>,
    pub categories: Vec<fmi2String>,
    pub flags: [i32; 2],
    pub kind: i32,
    pub numbers: [f64; 3],
    pointers: [Pointer; 4],
    /// A length that none of the arrays has, which is passed instead of their lengths.
    wrong_length: Option<usize>,
}

/// Lengths of arrays that an importer may pass by mistake: negative numbers as unsigned ones, lengths in bytes, and numbers
/// whose products overflow. Some would fit in the memory of the machine, some only in its address space.
const WRONG_LENGTHS: [usize; 9] = [
    usize::MAX,
    isize::MAX as usize,
    1 << 61,
    1 << 60,
    1 << 48,
    1 << 32,
    u32::MAX as usize,
    i32::MAX as usize,
    1 << 28,
];

/// Special numbers, which make up two thirds of the [`wild`] ones.
#[rustfmt::skip]
const SPECIAL: [f64; 20] = [
    0.0, -0.0, 1.0, -1.0, 1e-9, 1e9, 1e150, -1e150, 1e308, -1e308, f64::MAX, f64::MIN, f64::EPSILON,
    f64::MIN_POSITIVE, 5e-324, -5e-324, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e-300,
];

const STRINGS: [Option<&CStr>; 8] = [
    Some(c"hello"),
    Some(c""),
    Some(c"G\xc3\xb6del"),
    Some(c"%s%n#r1#\n"),
    Some(c"rather a long text, longer than what fits next to a pointer in a structure of a few words"),
    Some(c"no UTF-8: \xff\xfe"),
    Some(c"\xf0\x9f\x99\x82"),
    None,
];

#[rustfmt::skip]
const CATEGORIES: [Option<&CStr>; 8] = [
    Some(c"logEvents"), Some(c"logStatusDiscard"), Some(c"logStatusError"), Some(c"logStatusFatal"),
    Some(c"logAll"), Some(c"%s%n"), Some(c""), None,
];

const STEP_SIZES: [f64; 8] = [1e-3, 1e-3, 1e-2, 1.0 / 60.0, 0.1, 2.0, 1e-9, 1e4];

/// Chooses any number, including infinite ones and NaN.
fn wild(u: &mut Unstructured) -> Result<f64> {
    Ok(if u.ratio(2, 3)? { *u.choose(&SPECIAL)? } else { f64::from_bits(u.arbitrary()?) })
}

/// Chooses a number from -4 to 4.
fn tame(u: &mut Unstructured) -> Result<f64> {
    Ok(f64::from(u.arbitrary::<i16>()?) / 8192.0)
}

/// Creates an array of `count` elements; from the 17th on, they repeat the first 16.
fn array<T: Clone>(count: usize, element: impl FnMut() -> Result<T>) -> Result<Vec<T>> {
    let first: Vec<T> = std::iter::repeat_with(element).take(count.min(16)).collect::<Result<_>>()?;
    Ok(first.into_iter().cycle().take(count).collect())
}

fn reals(u: &mut Unstructured, count: usize) -> Result<Vec<f64>> {
    let is_tame = u.ratio(4, 5)?;
    array(count, || if is_tame { tame(u) } else { wild(u) })
}

fn strings(u: &mut Unstructured, count: usize, known: &[Option<&CStr>]) -> Result<Vec<fmi2String>> {
    array(count, || Ok(u.choose(known)?.map_or(null(), CStr::as_ptr)))
}

/// Returns the function of FMI 2.0 that has similar arguments; the same name for all other functions.
fn like(function: &str) -> &str {
    match function {
        "fmi3GetFloat64" => "fmi2GetReal",
        "fmi3SetFloat64" => "fmi2SetReal",
        "fmi3DoStep" => "fmi2DoStep",
        "fmi3GetOutputDerivatives" => "fmi2GetRealOutputDerivatives",
        "fmi3GetDirectionalDerivative" | "fmi3GetAdjointDerivative" => "fmi2GetDirectionalDerivative",
        "fmi3GetContinuousStateDerivatives" => "fmi2GetDerivatives",
        "fmi3GetEventIndicators" => "fmi2GetEventIndicators",
        name => name,
    }
}

/// Chooses a wrong length for one call in 64.
pub fn wrong_length(u: &mut Unstructured) -> Result<Option<usize>> {
    u.ratio(1, 64)?.then(|| u.choose(&WRONG_LENGTHS).copied()).transpose()
}

impl CallArguments {
    /// Decodes the arguments of a call to an instance that is at this time.
    pub fn decode(u: &mut Unstructured, function: &str, time: f64, variables: &Variables) -> Result<Self> {
        let function = like(function);
        let count = match u.int_in_range(0..=63_u8)? {
            0 => 5000,
            n @ 1..=50 => usize::from(n % 5),
            n => usize::from(n - 50),
        };
        let right = match function {
            "fmi2GetEventIndicators" => Some(variables.indicators),
            name if name.contains("Continuous") || name == "fmi2GetDerivatives" => Some(variables.states),
            _ => None,
        };
        let count = match right {
            Some(right) if u.ratio(7, 8)? => right,
            _ => count,
        };
        let mut pointer = || -> Result<Pointer> {
            Ok(match u.int_in_range(0..=63_u8)? {
                0 => Pointer::Null,
                1 => Pointer::Misaligned,
                _ => Pointer::Valid,
            })
        };
        let pointers = [pointer()?, pointer()?, pointer()?, pointer()?];
        let numbers = if function == "fmi2DoStep" {
            let off = if u.ratio(1, 16)? { wild(u)? } else { *u.choose(&[0.0, 0.0, 1e-12, -1e-12])? };
            let size = if u.ratio(1, 16)? { wild(u)? } else { *u.choose(&STEP_SIZES)? };
            [time + off, size, 0.0]
        } else if u.ratio(3, 4)? {
            [tame(u)?.abs(), tame(u)?, 10.0 + tame(u)?]
        } else {
            [wild(u)?, wild(u)?, wild(u)?]
        };
        // Limits the knowns to 100 if there are many unknowns, because 5000 by 5000 derivatives would take seconds.
        let known_count = if count > 100 { 100 } else { u.int_in_range(0..=6)? };
        let small = |u: &mut Unstructured| -> Result<i32> {
            Ok(if u.ratio(15, 16)? { u.int_in_range(0..=3)? } else { u.arbitrary()? })
        };
        let mut known = variables.references(u, known_count, "fmi2SetReal")?;
        if known_count == 0 && u.ratio(1, 8)? {
            known.push(u.arbitrary()?);
        }
        // Only a quarter of the calls choose among all strings, some of which are invalid.
        let good = if u.ratio(3, 4)? { &STRINGS[..5] } else { &STRINGS };
        let mut vr = variables.references(u, count, function)?;
        let mut categories = strings(u, count, &CATEGORIES)?;
        let wrong_length = wrong_length(u)?;
        if wrong_length.is_some() {
            // The last element is invalid, because an FMU cannot notice a wrong length before the first invalid element.
            vr.push(u32::MAX);
            known.push(u32::MAX);
            categories.push(c"%s%n".as_ptr());
        }
        let (values, known_values) = (variables.values(&vr), variables.values(&known));
        Ok(Self {
            vr,
            values,
            known_values,
            orders: array(count, || if u.ratio(15, 16)? { Ok(1) } else { small(u) })?,
            reals: reals(u, count.max(values).max(known_values))?,
            integers: array(count, || small(u))?,
            strings: strings(u, count, good)?,
            categories,
            flags: [small(u)?, small(u)?],
            kind: small(u)?,
            numbers,
            known,
            pointers,
            wrong_length,
        })
    }

    /// Returns the length to pass for an array of `count` values.
    pub fn count(&self, count: usize) -> usize {
        self.wrong_length.unwrap_or(count)
    }

    /// Returns whether the passed lengths are wrong.
    pub fn has_wrong_length(&self) -> bool {
        self.wrong_length.is_some()
    }

    /// Returns the address to pass for an array with elements of `size` bytes. `array` is its real address, and `index` is
    /// its index among the array arguments of the function.
    pub fn address(&self, index: usize, array: usize, size: usize) -> usize {
        match self.pointers[index % self.pointers.len()] {
            Pointer::Null => 0,
            // Never dereferenced, because the FMU rejects the pointer. An array of bytes cannot be misaligned.
            Pointer::Misaligned if size > 1 => array + 1,
            _ => array,
        }
    }
}
