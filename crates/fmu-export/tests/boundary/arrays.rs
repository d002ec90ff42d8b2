//! Arrays, which are one variable in FMI 3.0 and one scalar variable per element in FMI 2.0; and values of all types of
//! FMI 3.0.

use crate::models::rod::{Name, PIECES};
use crate::models::{Palette, Rod, Talker, palette, talker};
use fmu_export::fmi3::{reference, types::*};
use fmu_export::*;
use fmu_test_kit::Either;
use fmu_test_kit::fmi3::Importer;
use std::ffi::{CStr, c_char};
use std::ptr::null;

fn vr(name: Name) -> u32 {
    reference(Rod::index(name) as u32)
}

fn reals<const COUNT: usize>(fmu: &Importer, names: &[Name]) -> [f64; COUNT] {
    let (vr, mut values) = (names.iter().map(|name| vr(*name)).collect::<Vec<_>>(), [f64::NAN; COUNT]);
    fmu.ok(fmu.fmi3GetFloat64(vr.as_ptr(), vr.len(), values.as_mut_ptr(), COUNT));
    values
}

fn set(fmu: &Importer, name: Name, values: &[f64]) -> Status {
    fmu.fmi3SetFloat64(&vr(name), 1, values.as_ptr(), values.len())
}

#[test]
fn names_and_indices() {
    let names: Vec<_> = Rod::TABLE.iter().map(|variable| variable.name()).collect();
    assert_eq!(names[..4], ["wall", "T[1]", "T[2]", "T[3]"]);
    let of = |name: Name| &Rod::TABLE[Rod::index(name)];
    assert_eq!((of(Name::der_T).name(), of(Name::der_T).name_of_array()), ("der(T[1])", "der(T)"));
    let limits: Vec<_> = Rod::TABLE
        .iter()
        .filter(|variable| variable.name_of_array() == "limits")
        .map(|variable| variable.name())
        .collect();
    assert_eq!(limits, ["limits[1,1]", "limits[1,2]", "limits[2,1]", "limits[2,2]"]);
    assert_eq!((of(Name::limits).dimensions(), of(Name::limits).length()), (&[2, 2][..], 4));
    let second = &Rod::TABLE[Rod::index(Name::der_T) + 1];
    assert_eq!((second.element(), second.differentiates()), (1, Some(Rod::index(Name::T) as u32 + 1)));
    assert_eq!(Rod::STATES.len(), PIECES);
}

/// Checks calls for several arrays and scalars, in any order and with repeated variables.
#[test]
fn whole_arrays_are_read_and_set() {
    let fmu = Importer::in_mode::<Rod>(Interface::CoSimulation, Mode::StepComplete);
    assert_eq!(reals(&fmu, &[Name::power, Name::wall, Name::power]), [10.0, 5.0, 20.0, 10.0, 5.0]);
    fmu.ok(set(&fmu, Name::power, &[1.0, 2.0]));
    let both = [vr(Name::wall), vr(Name::power)];
    fmu.ok(fmu.fmi3SetFloat64(both.as_ptr(), 2, [30.0, 3.0, 4.0].as_ptr(), 3));
    assert_eq!(reals(&fmu, &[Name::power, Name::wall]), [3.0, 4.0, 30.0]);
    // Matrices are stored row by row.
    assert_eq!(reals(&fmu, &[Name::limits]), [10.0, 25.0, 12.5, 30.0]);
    fmu.ok(set(&fmu, Name::limits, &[1.0, 2.0, 3.0, 4.0]));
    assert_eq!(reals(&fmu, &[Name::limits]), [1.0, 2.0, 3.0, 4.0]);
    let of_fmi2 = fmu_test_kit::Importer::in_mode::<Rod>(Interface::CoSimulation, Mode::StepComplete);
    let index = Rod::index(Name::limits) as u32;
    assert_eq!(of_fmi2.get([index + 1, index + 2]), [25.0, 12.5]);

    let (mut switches, mut hot, mut counted) = ([7_i64; 2], [7; PIECES], [7; 2]);
    fmu.ok(fmu.fmi3SetInt64(&vr(Name::switches), 1, [0, 3].as_ptr(), 2));
    fmu.ok(fmu.fmi3GetInt64(&vr(Name::switches), 1, switches.as_mut_ptr(), 2));
    fmu.ok(fmu.fmi3GetBoolean(&vr(Name::hot), 1, hot.as_mut_ptr(), PIECES));
    fmu.ok(fmu.fmi3GetInt32(&vr(Name::counted), 1, counted.as_mut_ptr(), 2));
    assert_eq!((switches, hot, counted), ([0, 3], [0; PIECES], [1, 2]));
    fmu.step(0.0, 0.01);
    fmu.ok(fmu.fmi3GetBoolean(&vr(Name::hot), 1, hot.as_mut_ptr(), PIECES));
    assert_eq!(hot, [1; PIECES]);

    let texts = [c"one".as_ptr(), c"two".as_ptr()];
    fmu.ok(fmu.fmi3SetString(&vr(Name::labels), 1, texts.as_ptr(), 2));
    let mut read: [*const c_char; 2] = [null(); 2];
    fmu.ok(fmu.fmi3GetString(&vr(Name::reports), 1, read.as_mut_ptr(), 2));
    // SAFETY: the FMU's strings are valid until the next call.
    let read = read.map(|text| unsafe { CStr::from_ptr(text) });
    assert_eq!(read, [c"one is warm", c"two is warm"]);
}

#[test]
fn states_and_their_derivatives_are_in_the_same_order() {
    let fmu = Importer::in_mode::<Rod>(Interface::ModelExchange, Mode::ContinuousTime);
    let states: [f64; PIECES] = std::array::from_fn(|piece| 3.0 * piece as f64);
    fmu.ok(fmu.set_states(states.as_ptr(), PIECES));
    assert_eq!(reals(&fmu, &[Name::T]), states);
    assert_eq!(reals::<PIECES>(&fmu, &[Name::der_T]), fmu.derivatives());
    let other = fmu_test_kit::Importer::in_mode::<Rod>(Interface::ModelExchange, Mode::ContinuousTime);
    other.ok(other.set_states(states.as_ptr(), PIECES));
    assert_eq!(other.derivatives::<PIECES>(), fmu.derivatives());
}

/// Checks derivatives of whole arrays with respect to whole arrays, and time derivatives of whole arrays.
#[test]
fn partial_derivatives_of_arrays() {
    let fmu = Importer::in_mode::<Rod>(Interface::ModelExchange, Mode::ContinuousTime);
    let unknowns = [vr(Name::mean), vr(Name::der_T)];
    let knowns = [vr(Name::T), vr(Name::wall)];
    let mut seed = [0.0; PIECES + 1];
    (seed[1], seed[PIECES]) = (1.0, 2.0);
    let mut found = [f64::NAN; PIECES + 1];
    let call = |found: &mut [f64], seeds| {
        let (seed, count) = (seed.as_ptr(), found.len());
        let (unknowns, knowns) = (unknowns.as_ptr(), knowns.as_ptr());
        fmu.fmi3GetDirectionalDerivative(unknowns, 2, knowns, 2, seed, seeds, found.as_mut_ptr(), count)
    };
    fmu.ok(call(&mut found, PIECES + 1));
    let capacity = |piece: usize| 2.0 + 0.125 * piece as f64;
    let expected = [0.125, 1.5 / capacity(0), -1.0 / capacity(1), 0.5 / capacity(2), 0.0, 0.0, 0.0, 0.0, 0.0];
    assert_eq!(found, expected);
    fmu.rejected_with(&["there are 9 knowns, the array has 2 elements"], |_| call(&mut [0.0; PIECES + 1], 2));
    fmu.rejected_with(&["there are 9 unknowns, the array has 2 elements"], |_| {
        call(&mut [0.0; 2], PIECES + 1)
    });
    // If the number of references is too large, the first one that belongs to no variable is rejected, and no later one is read.
    let (wrong, many, mut found) = ([vr(Name::T), u32::MAX], 1 << 40, [f64::NAN; PIECES]);
    let (knowns, result, unknown) =
        (wrong.as_ptr(), found.as_mut_ptr(), "no variable with value reference 4294967295");
    for [of, with] in [[many, 1], [1, many]] {
        fmu.rejected_with(&[unknown], |fmu| {
            fmu.fmi3GetDirectionalDerivative(
                wrong.as_ptr(),
                of,
                knowns,
                with,
                seed.as_ptr(),
                PIECES,
                result,
                PIECES,
            )
        });
    }

    let fmu = Importer::in_mode::<Rod>(Interface::CoSimulation, Mode::StepComplete);
    fmu.rejected_with(&[unknown], |fmu| {
        fmu.fmi3GetOutputDerivatives(wrong.as_ptr(), many, [1; 2].as_ptr(), result, PIECES)
    });
    let (vr, mut rates) = ([vr(Name::means), vr(Name::T)], [f64::NAN; PIECES + 2]);
    fmu.ok(fmu.fmi3GetOutputDerivatives(vr.as_ptr(), 2, [1, 1].as_ptr(), rates.as_mut_ptr(), PIECES + 2));
    assert_eq!(rates[2..], reals::<PIECES>(&fmu, &[Name::der_T]));
    assert_eq!(rates[1], rates[6..].iter().sum::<f64>() / 4.0);
}

#[test]
fn rejections_name_the_element() {
    let fmu = Importer::in_mode::<Rod>(Interface::CoSimulation, Mode::Instantiated);
    fmu.rejected_with(&["fmi3SetFloat64: capacities[3] must not be below 0.1, it is 0.05"], |fmu| {
        set(fmu, Name::capacities, &[1.0, 1.0, 0.05, 1.0, 1.0, 1.0, 1.0, 1.0])
    });
    fmu.ok(set(&fmu, Name::capacities, &[1.0; PIECES]));
    fmu.rejected_with(&["T[2] must be a finite number"], |fmu| {
        set(fmu, Name::T, &[1.0, f64::NAN, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0])
    });
    fmu.ok(set(&fmu, Name::T, &[1.0; PIECES]));
    for count in [0, 1, PIECES - 1, PIECES + 1] {
        let words = format!("there are 8 values, the array has {count} elements");
        fmu.rejected_with(&[&words], |fmu| set(fmu, Name::T, &[0.0; PIECES + 1][..count]));
    }
    let element = vr(Name::T) + 2;
    fmu.rejected_with(&["there is no variable with value reference 4"], |fmu| {
        fmu.fmi3SetFloat64(&element, 1, &1.0, 1)
    });
    fmu.initialize(0.0);
    fmu.rejected_with(&["hot[1] cannot be set in state"], |fmu| {
        fmu.fmi3SetBoolean(&vr(Name::hot), 1, [1; PIECES].as_ptr(), PIECES)
    });
}

/// Checks each getter and setter of numbers with the largest and the smallest number of its type. The tests with `Rod`
/// check arrays of several types.
#[test]
fn numbers_of_every_type() {
    let palette = Importer::initialized_at::<Palette>(0.0);
    macro_rules! check {
        ($($name:ident: $type:ty, $get:ident $set:ident;)+) => { $({
            let vr = reference(palette::Name::$name as u32);
            for value in [<$type>::MAX, <$type>::MIN] {
                let mut read = <$type>::default();
                palette.ok(palette.$set(&vr, 1, &value, 1));
                palette.ok(palette.$get(&vr, 1, &mut read, 1));
                assert_eq!(read, value, stringify!($name));
            }
            for count in [0, 2, usize::MAX] {
                let words = ["there are 1 values, the array has"];
                palette.rejected_with(&words, |fmu| fmu.$get(&vr, 1, &mut <$type>::default(), count));
                palette.rejected_with(&words, |fmu| fmu.$set(&vr, 1, &<$type>::default(), count));
            }
        })+ };
    }
    check! {
        float64: f64, fmi3GetFloat64 fmi3SetFloat64;
        float32: f32, fmi3GetFloat32 fmi3SetFloat32;
        int8: i8, fmi3GetInt8 fmi3SetInt8;
        uint8: u8, fmi3GetUInt8 fmi3SetUInt8;
        int16: i16, fmi3GetInt16 fmi3SetInt16;
        int32: i32, fmi3GetInt32 fmi3SetInt32;
        uint32: u32, fmi3GetUInt32 fmi3SetUInt32;
        int64: i64, fmi3GetInt64 fmi3SetInt64;
        uint64: u64, fmi3GetUInt64 fmi3SetUInt64;
    }
    let port = reference(palette::Name::uint16 as u32);
    palette.ok(palette.fmi3SetUInt16(&port, 1, &u16::MAX, 1));
    let (mut read, other) = (0, Importer::initialized_at::<Palette>(0.0));
    other.restore(&palette.bytes());
    assert_eq!(other.bytes(), palette.bytes());
    other.ok(other.fmi3GetUInt16(&port, 1, &mut read, 1));
    assert_eq!(read, u16::MAX);
}

#[test]
fn arrays_of_binary_values() {
    let fmu = Importer::initialized_at::<Palette>(0.0);
    let vr = reference(Palette::index(palette::Name::pair) as u32);
    let (sizes, values) = ([3, 1], [c"abc", c"d"].map(|text| text.as_ptr().cast()));
    fmu.ok(fmu.fmi3SetBinary(&vr, 1, sizes.as_ptr(), values.as_ptr(), 2));
    let (mut sizes, mut read) = ([0; 2], [null::<u8>(); 2]);
    fmu.ok(fmu.fmi3GetBinary(&vr, 1, sizes.as_mut_ptr(), read.as_mut_ptr(), 2));
    // SAFETY: the FMU's bytes have these lengths and are valid until the next call.
    let read = [0, 1].map(|k| unsafe { std::slice::from_raw_parts(read[k], sizes[k]) });
    assert_eq!(read, [&b"abc"[..], b"d"]);
    fmu.rejected_with(&["pair[2]", "NULL"], |fmu| {
        fmu.fmi3SetBinary(&vr, 1, [0, 1].as_ptr(), [c"".as_ptr().cast(), null()].as_ptr(), 2)
    });
}

#[test]
fn binary_values() {
    let (fmu, vr) = (Importer::initialized_at::<Palette>(0.0), reference(palette::Name::binary as u32));
    let read = || {
        let (mut size, mut value) = (usize::MAX, null());
        fmu.ok(fmu.fmi3GetBinary(&vr, 1, &mut size, &mut value, 1));
        // SAFETY: the FMU's bytes have this length and are valid until the next call.
        unsafe { std::slice::from_raw_parts(value, size) }.to_vec()
    };
    assert!(read().is_empty());
    fmu.ok(fmu.fmi3SetBinary(&vr, 1, &3, &[1, 0, 255].as_ptr(), 1));
    assert_eq!(read(), [1, 0, 255]);
    fmu.rejected_with(&["binary must not have more than 16 bytes, it has 17"], |fmu| {
        fmu.fmi3SetBinary(&vr, 1, &17, &[0; 17].as_ptr(), 1)
    });
    fmu.rejected("no bytes", |fmu| fmu.fmi3SetBinary(&vr, 1, &3, &null(), 1));
    fmu.rejected("endless", |fmu| fmu.fmi3SetBinary(&vr, 1, &usize::MAX, &[0; 3].as_ptr(), 1));
    fmu.ok(fmu.fmi3SetBinary(&vr, 1, &0, &null(), 1));
    assert!(read().is_empty());
}

#[test]
fn ranges() {
    let fmu = Importer::new::<Palette>(Interface::CoSimulation);
    let [port, shade, colour] = [palette::Name::uint16, palette::Name::shade, palette::Name::colour]
        .map(|name| reference(name as u32));
    let words = ["uint16 must be between 1024 and 65535, it is 80"];
    fmu.rejected_with(&words, |fmu| fmu.fmi3SetUInt16(&port, 1, &80, 1));
    fmu.rejected_with(&["shade must not be above 8, it is 8.5"], |fmu| {
        fmu.fmi3SetFloat32(&shade, 1, &8.5, 1)
    });
    fmu.rejected_with(&["must be a finite number"], |fmu| fmu.fmi3SetFloat32(&shade, 1, &f32::NAN, 1));
    let mut item = 0;
    fmu.ok(fmu.fmi3GetInt64(&colour, 1, &mut item, 1));
    assert_eq!(item, i64::from(palette::Colour::Red.number()));
    // The number of an item has 32 bits, but is passed in 64 bits, whose upper half must not be ignored.
    let (fmu, mood) =
        (Importer::new::<Talker>(Interface::CoSimulation), reference(talker::Name::mood as u32));
    fmu.rejected("beyond Int32", |fmu| fmu.fmi3SetInt64(&mood, 1, &(7 + (1 << 32)), 1));
}
