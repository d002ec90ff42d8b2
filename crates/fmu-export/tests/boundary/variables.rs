//! Values of Strings, Booleans, Enumerations, tunable parameters and time (section 2.2.7 of FMI 2.0, 2.4.7.4 of FMI 3.0).

use crate::INTERFACES;
use crate::models::*;
use crate::models::{palette::Name as Kind, talker::Name};
use fmu_export::Interface::{CoSimulation, ModelExchange};
use fmu_export::Mode::*;
use fmu_export::fmi3::{independent, reference};
use fmu_export::{Causality, Exported, Status, Variables};
use fmu_test_kit::{Either, Importer, fmi3};
use std::ffi::CStr;
use std::ptr::null;

pub fn texts<F: Either, const N: usize>(fmu: &F, names: [Name; N]) -> [String; N] {
    names.map(|name| fmu.string(name as u32))
}

/// Checks that strings of any length and script are set and read, several in one call and with repeated variables.
fn strings_are_set_and_read<F: Either>() {
    let long = "long ".repeat(10_000);
    for interface in INTERFACES {
        let fmu = F::in_mode::<Talker>(interface, Initialization);
        assert_eq!(texts(&fmu, [Name::heard, Name::greeting]), ["", "Hello"]);
        for text in ["", "Hi", "Gödel said: ∀x ∃y 🙂", "100%s #r1# \n\t", &long] {
            fmu.write_string(Name::heard as u32, text);
            assert_eq!(texts(&fmu, [Name::reply, Name::heard, Name::reply]), [text; 3]);
        }
        fmu.rejected_with(&["heard is NULL"], |fmu| fmu.set_string(Name::heard as u32, null()));
        fmu.rejected_with(&["heard is not UTF-8"], |fmu| {
            fmu.set_string(Name::heard as u32, c"G\xc3".as_ptr())
        });
    }
}

/// Checks that the strings that a call returns stay valid until the next call on this instance, even if other instances
/// are called in between.
fn strings_stay_valid<F: Either>() {
    let [one, other] = [(); 2].map(|()| F::in_mode::<Talker>(CoSimulation, StepComplete));
    one.write_string(Name::heard as u32, "the one");
    let mut text = null();
    one.ok(one.get_string(Name::reply as u32, &mut text));
    other.write_string(Name::heard as u32, "the other");
    texts(&other, [Name::reply]);
    // SAFETY: there was no later call on this instance.
    assert_eq!(unsafe { CStr::from_ptr(text) }, c"the one");
}

/// Checks that Enumerations accept only their items, and that a step uses the items and strings that are set.
fn enumerations<F: Either>() {
    let fmu = F::in_mode::<Talker>(CoSimulation, StepComplete);
    assert_eq!(texts(&fmu, [Name::said]), ["Hello"]);
    for (point, mood, expected) in [(0.0, 1, "Ping"), (1.0, 2, "Ping!"), (2.0, 7, "Ping!")] {
        fmu.write_string(Name::heard as u32, "Ping");
        fmu.ok(fmu.set_item(Name::mood as u32, mood));
        assert_eq!([Name::mood, Name::own_mood].map(|name| fmu.item(name as u32)), [mood; 2]);
        fmu.step(point, 1.0);
        assert_eq!(texts(&fmu, [Name::said]), [expected]);
    }
    for mood in [0, 3, -1, i32::MAX] {
        fmu.rejected_with(&["mood must be one of 1 (Calm), 2 (Excited), 7 (Sulking)"], |fmu| {
            fmu.set_item(Name::mood as u32, mood)
        });
    }
    fmu.rejected_with(&["mood is of type Enumeration, not Real"], |fmu| {
        fmu.try_get(&[Name::mood as u32], &mut [0.0])
    });
}

fn booleans<F: Either>() {
    let fmu = F::initialized_at::<Palette>(0.0);
    for value in [1, 0] {
        fmu.ok(fmu.set_boolean(Kind::boolean as u32, value));
        assert_eq!(fmu.boolean(Kind::boolean as u32), value == 1);
    }
    fmu.rejected_with(&["boolean must be 0 (false) or 1 (true), it is 2"], |fmu| {
        fmu.set_boolean(Kind::boolean as u32, 2)
    });
}

/// Checks a variable that depends on a tunable parameter, during the simulation. Also checks that an iterative calculation
/// begins at the start value, because different start values lead to different roots.
fn tunable_and_calculated_variables<F: Either>() {
    for (interface, mode) in [(CoSimulation, StepComplete), (ModelExchange, Event)] {
        let fmu = F::in_mode::<Talker>(interface, mode);
        for volume in [1.0, 10.0] {
            fmu.set(&[Name::volume as u32], &[volume]);
            let [decibels] = fmu.get([Name::decibels as u32]);
            assert!((decibels - 20.0 * (volume + 1e-3).log10()).abs() < 1e-12);
        }
        assert_eq!([Name::length, Name::answer].map(|name| fmu.integer(name as u32)), [5, 42]);
    }
    for (start, root) in [(1.0, 3.0), (-0.1, -3.0)] {
        let fmu = F::in_mode::<Talker>(CoSimulation, Instantiated);
        fmu.set(&[Name::root as u32, Name::square as u32], &[start, 9.0]);
        fmu.initialize(0.0);
        assert!((fmu.get([Name::root as u32])[0] - root).abs() < 1e-12);
    }
}

fn the_time<F: Either>() {
    let time = Name::time as u32;
    let fmu = F::in_mode::<Talker>(CoSimulation, StepComplete);
    assert_eq!(fmu.get([time]), [0.0]);
    fmu.step(0.0, 0.5);
    assert_eq!(fmu.get([time]), [0.5]);
    fmu.rejected("the time is not settable", |fmu| fmu.try_set(&[time], &[1.0]));
    let fmu = F::in_mode::<Talker>(ModelExchange, ContinuousTime);
    fmu.ok(fmu.set_time(-3.0));
    assert_eq!(fmu.get([time]), [-3.0]);
}

/// Checks a variable whose type is defined by the author of a model, with only the required functions.
fn types_of_authors<F: Either>() {
    let fmu = F::in_mode::<Palette>(CoSimulation, Instantiated);
    let celsius = Kind::celsius as u32;
    fmu.set(&[celsius], &[-273.25]);
    fmu.initialize(0.0);
    assert_eq!(fmu.get([celsius]), [-273.25]);
    fmu.set(&[celsius], &[4.5]);
    assert_eq!(fmu.get([celsius, celsius]), [4.5; 2]);
}

#[test]
fn in_both_versions() {
    fn check<F: Either>() {
        strings_are_set_and_read::<F>();
        strings_stay_valid::<F>();
        enumerations::<F>();
        booleans::<F>();
        tunable_and_calculated_variables::<F>();
        the_time::<F>();
        types_of_authors::<F>();
    }
    check::<Importer>();
    check::<fmi3::Importer>();
}

/// Checks several strings in one call of FMI 2.0. If a variable is repeated, its last value is used.
#[test]
fn several_texts() {
    let fmu = Importer::in_mode::<Talker>(CoSimulation, StepComplete);
    let (heard, greeting) = (Name::heard as u32, Name::greeting as u32);
    let values = [c"one", c"two", c"three"].map(CStr::as_ptr);
    fmu.ok(fmu.fmi2SetString([heard, greeting, heard].as_ptr(), 3, values.as_ptr()));
    assert_eq!(texts(&fmu, [Name::heard, Name::greeting]), ["three", "two"]);
}

/// Checks that only the getter of its type succeeds for each variable. An Enumeration is read as an Integer in FMI 2.0 and
/// as an Int64 in FMI 3.0.
#[test]
fn wrong_types() {
    let (fmu, old) =
        (fmi3::Importer::initialized_at::<Palette>(0.0), Importer::initialized_at::<Palette>(0.0));
    let (mut number, mut text, mut bytes, mut size) = (0_u64, null(), null(), 0);
    let scalars = (0..).zip(Palette::TABLE).filter(|(_, variable)| variable.dimensions().is_empty());
    for (index, variable) in scalars {
        let (vr, number, base) = (reference(index), &raw mut number, variable.base().to_string());
        let results = [
            ("Real", fmu.fmi3GetFloat64(&vr, 1, number.cast(), 1)),
            ("Float32", fmu.fmi3GetFloat32(&vr, 1, number.cast(), 1)),
            ("Int8", fmu.fmi3GetInt8(&vr, 1, number.cast(), 1)),
            ("UInt8", fmu.fmi3GetUInt8(&vr, 1, number.cast(), 1)),
            ("Int16", fmu.fmi3GetInt16(&vr, 1, number.cast(), 1)),
            ("UInt16", fmu.fmi3GetUInt16(&vr, 1, number.cast(), 1)),
            ("Integer", fmu.fmi3GetInt32(&vr, 1, number.cast(), 1)),
            ("UInt32", fmu.fmi3GetUInt32(&vr, 1, number.cast(), 1)),
            ("Int64", fmu.fmi3GetInt64(&vr, 1, number.cast(), 1)),
            ("UInt64", fmu.fmi3GetUInt64(&vr, 1, number, 1)),
            ("Boolean", fmu.fmi3GetBoolean(&vr, 1, number.cast(), 1)),
            ("String", fmu.fmi3GetString(&vr, 1, &mut text, 1)),
            ("Binary", fmu.fmi3GetBinary(&vr, 1, &mut size, &mut bytes, 1)),
        ];
        for (of, status) in results {
            let fits = of == base || of == "Int64" && base == "Enumeration";
            assert_eq!(status == Status::Ok, fits, "{of}: {}", variable.name());
        }
        let results = [
            ("Real", old.fmi2GetReal(&index, 1, number.cast())),
            ("Integer", old.fmi2GetInteger(&index, 1, number.cast())),
            ("Boolean", old.fmi2GetBoolean(&index, 1, number.cast())),
            ("String", old.fmi2GetString(&index, 1, &mut text)),
        ];
        for (of, status) in results {
            let fits = of == base || of == "Integer" && base == "Enumeration";
            assert_eq!(status == Status::Ok, fits, "{of}: {}", variable.name());
        }
        if !variable.base().is_in_fmi2() {
            assert_eq!(old.fmi2SetInteger(&index, 1, &1), Status::Error);
        }
    }
}

/// Checks that value references of FMI 3.0 begin with 1, and that functions reject 0.
#[test]
fn value_references_count_from_1() {
    let (fmu, mut value) = (fmi3::Importer::initialized_at::<Oscillator>(0.0), 0.0);
    fmu.set(&[oscillator::Name::force as u32], &[7.0]);
    fmu.ok(fmu.fmi3GetFloat64(&1, 1, &mut value, 1));
    assert_eq!((value, Oscillator::TABLE[0].name()), (7.0, "force"));
    let words = ["no variable with value reference 0"];
    fmu.rejected_with(&words, |fmu| fmu.fmi3GetFloat64(&0, 1, &mut value, 1));
    fmu.rejected_with(&words, |fmu| fmu.fmi3SetFloat64(&0, 1, &1.0, 1));
    fmu.rejected_with(&words, |fmu| fmu.fmi3SetInt8(&0, 1, &1, 1));
    fmu.rejected_with(&words, |fmu| fmu.fmi3GetOutputDerivatives(&0, 1, &1, &mut value, 1));
    fmu.rejected_with(&words, |fmu| fmu.fmi3GetDirectionalDerivative(&0, 1, &1, 1, &1.0, 1, &mut value, 1));
}

/// Checks that every FMU for FMI 3.0 has the independent variable `time`: the one of the model's table, or else one that
/// follows all other variables.
#[test]
fn the_time_of_fmi3() {
    fn check<M: Exported>() {
        let (index, variable) = independent::<M>();
        let in_table = M::TABLE.iter().position(|variable| variable.causality() == Causality::Independent);
        assert_eq!(index as usize, in_table.unwrap_or(M::TABLE.len()));
        assert_eq!((variable.name(), variable.causality()), ("time", Causality::Independent));
        let fmu = fmi3::Importer::initialized_at::<M>(2.0);
        assert_eq!(fmu.get([index]), [2.0]);
        fmu.step(2.0, 0.5);
        assert_eq!(fmu.get([index]), [2.5]);
        fmu.rejected("the time is not an input", |fmu| fmu.try_set(&[index], &[1.0]));
        fmu.rejected("no variable", |fmu| fmu.try_set(&[M::TABLE.len() as u32 + 1], &[1.0]));
    }
    check::<Palette>();
    check::<Counter>();
    check::<Talker>();
    // FMI 2.0 has no such variable.
    let fmu = Importer::initialized_at::<Palette>(0.0);
    fmu.rejected("the time", |fmu| fmu.try_get(&[Palette::TABLE.len() as u32], &mut [0.0]));
}

/// Checks that reading a value that is not finite is rejected.
#[test]
fn out_of_the_range_of_float32() {
    let (fmu, mut value) = (fmi3::Importer::initialized_at::<Palette>(0.0), f32::NAN);
    let twice = reference(Kind::twice as u32);
    fmu.ok(fmu.fmi3GetFloat32(&twice, 1, &mut value, 1));
    assert_eq!(value, 0.2);
    fmu.ok(fmu.fmi3SetFloat32(&reference(Kind::float32 as u32), 1, &f32::MAX, 1));
    fmu.take_log();
    assert_eq!(fmu.fmi3GetFloat32(&twice, 1, &mut value, 1), Status::Error);
    assert!(fmu.take_log()[0].message.contains("twice is not a finite number"));
}
