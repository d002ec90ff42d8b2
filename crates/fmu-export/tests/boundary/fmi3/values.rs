//! Values of every type.

use crate::models::grumbler::{self, Trouble};
use crate::models::palette::{Colour, Name};
use crate::models::{Counter, Grumbler, Oscillator, Palette, Talker, oscillator, talker};
use fmu_export::fmi3::{independent, reference, types::*};
use fmu_export::{Causality, Enumeration, Exported, Interface::*, Variables};
use fmu_test_kit::Either;
use fmu_test_kit::fmi3::Importer;
use std::ffi::CStr;
use std::ptr::{null, null_mut};

fn palette() -> Importer {
    let fmu = Importer::of::<Palette>(CoSimulation);
    fmu.initialize(0.0);
    fmu
}

macro_rules! every_number {
    ($fmu:ident: $($name:ident $get:ident $set:ident [$($value:expr),+];)+) => {
        $(for value in [$($value),+] {
            let vr = reference(Name::$name as u32);
            $fmu.ok($fmu.$set(&vr, 1, &value, 1));
            let mut read = value - value;
            $fmu.ok($fmu.$get(&vr, 1, &mut read, 1));
            assert_eq!(read, value, stringify!($name));
        })+
    };
}

#[test]
fn numbers() {
    let fmu = palette();
    every_number! { fmu:
        float64 fmi3GetFloat64 fmi3SetFloat64 [1e300, -0.1];
        float32 fmi3GetFloat32 fmi3SetFloat32 [f32::MAX, -0.1];
        int8 fmi3GetInt8 fmi3SetInt8 [i8::MIN, i8::MAX];
        uint8 fmi3GetUInt8 fmi3SetUInt8 [0, u8::MAX];
        int16 fmi3GetInt16 fmi3SetInt16 [i16::MIN, i16::MAX];
        uint16 fmi3GetUInt16 fmi3SetUInt16 [1024, u16::MAX];
        int32 fmi3GetInt32 fmi3SetInt32 [i32::MIN, i32::MAX];
        uint32 fmi3GetUInt32 fmi3SetUInt32 [0, u32::MAX];
        int64 fmi3GetInt64 fmi3SetInt64 [i64::MIN, i64::MAX];
        uint64 fmi3GetUInt64 fmi3SetUInt64 [0, u64::MAX];
    }
    // A serialized state contains all of them.
    let bytes = fmu.bytes();
    let other = palette();
    other.restore(&bytes);
    assert_eq!(other.bytes(), bytes);
}

/// Checks a user-defined type with only the required functions, and values that are not finite.
#[test]
fn types_of_authors() {
    let fmu = Importer::of::<Grumbler>(CoSimulation);
    let [ambient, warmer] = [grumbler::Name::ambient, grumbler::Name::warmer].map(|name| name as u32);
    fmu.set(&[ambient], &[-273.25]);
    fmu.initialize(0.0);
    assert_eq!(fmu.get([ambient]), [-273.25]);
    fmu.set(&[ambient], &[4.5]);
    assert_eq!(fmu.get([ambient, ambient]), [4.5; 2]);
    let mut value = f32::NAN;
    fmu.ok(fmu.fmi3GetFloat32(&reference(warmer), 1, &mut value, 1));
    assert_eq!(value, 0.0);
    fmu.ok(fmu.fmi3SetInt64(&reference(grumbler::Name::trouble as u32), 1, &(Trouble::Heat as i64), 1));
    fmu.step(0.0, 0.5);
    assert_eq!(fmu.fmi3GetFloat32(&reference(warmer), 1, &mut value, 1), Status::Error);
    let log = fmu.take_log();
    assert!(log.last().unwrap().text.contains("warmer is out of the range of numbers"), "{log:?}");
}

#[test]
fn ranges() {
    let fmu = palette();
    let port = reference(Name::uint16 as u32);
    fmu.refused_with(&["uint16 must be between 1024 and 65535, it is 80"], |fmu| {
        fmu.fmi3SetUInt16(&port, 1, &80, 1)
    });
    let fmu = Importer::of::<Palette>(CoSimulation);
    let shade = reference(Name::shade as u32);
    fmu.refused_with(&["shade must not be above 8, it is 8.5"], |fmu| fmu.fmi3SetFloat32(&shade, 1, &8.5, 1));
    fmu.refused_with(&["must be a finite number"], |fmu| fmu.fmi3SetFloat32(&shade, 1, &f32::NAN, 1));
}

/// Checks every function of values with every variable: only the function of its type succeeds, and an
/// Enumeration is an Int64.
#[test]
fn wrong_types() {
    let fmu = palette();
    let (mut number, mut text, mut bytes, mut size) = (0_u64, null(), null(), 0);
    for (vr, variable) in (reference(0)..).zip(Palette::TABLE) {
        let number = &raw mut number;
        let answers = [
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
        for (of, status) in answers {
            let base = variable.base().to_string();
            let fits = of == base || of == "Int64" && base == "Enumeration";
            assert_eq!(status == Status::Ok, fits, "{of}: {}", variable.name());
        }
    }
    fmu.take_log();
}

#[test]
fn fmi2_refuses_what_it_lacks() {
    let fmu = fmu_test_kit::Importer::of::<Palette>(CoSimulation);
    fmu.initialize(0.0);
    for (vr, variable) in (0..).zip(Palette::TABLE).filter(|(_, variable)| !variable.base().is_in_fmi2()) {
        let (mut real, mut whole, mut text) = (0.0, 0, null());
        for status in [
            fmu.fmi2GetReal(&vr, 1, &mut real),
            fmu.fmi2GetInteger(&vr, 1, &mut whole),
            fmu.fmi2GetBoolean(&vr, 1, &mut whole),
            fmu.fmi2GetString(&vr, 1, &mut text),
            fmu.fmi2SetInteger(&vr, 1, &1),
        ] {
            assert_eq!(status, Status::Error, "{}", variable.name());
        }
    }
    fmu.take_log();
}

#[test]
fn truths() {
    let (fmu, vr) = (palette(), reference(Name::boolean as u32));
    fmu.ok(fmu.fmi3SetBoolean(&vr, 1, &1, 1));
    let mut read = 7;
    fmu.ok(fmu.fmi3GetBoolean(&vr, 1, &mut read, 1));
    assert_eq!(read, fmi3True);
    let text = fmu.refused("a truth", |fmu| fmu.fmi3SetBoolean(&vr, 1, &2, 1));
    assert!(text.contains("boolean must be 0 (false) or 1 (true), it is 2"), "{text}");
}

#[test]
fn texts() {
    let (fmu, vr) = (palette(), reference(Name::string as u32));
    fmu.ok(fmu.fmi3SetString(&vr, 1, &c"Gödel".as_ptr(), 1));
    let mut read = null();
    fmu.ok(fmu.fmi3GetString(&vr, 1, &mut read, 1));
    // SAFETY: a string of the FMU, valid until the next call.
    assert_eq!(unsafe { CStr::from_ptr(read) }, c"Gödel");
    fmu.refused("no text", |fmu| fmu.fmi3SetString(&vr, 1, &null(), 1));
    fmu.refused("no UTF-8", |fmu| fmu.fmi3SetString(&vr, 1, &c"\xff".as_ptr(), 1));
}

#[test]
fn bytes() {
    let (fmu, vr) = (palette(), reference(Name::binary as u32));
    let read = || {
        let (mut size, mut value) = (usize::MAX, null());
        fmu.ok(fmu.fmi3GetBinary(&vr, 1, &mut size, &mut value, 1));
        // SAFETY: bytes of the FMU, valid until the next call.
        unsafe { std::slice::from_raw_parts(value, size) }.to_vec()
    };
    assert!(read().is_empty());
    fmu.ok(fmu.fmi3SetBinary(&vr, 1, &3, &[1, 0, 255].as_ptr(), 1));
    assert_eq!(read(), [1, 0, 255]);
    fmu.refused_with(&["binary must not have more than 16 bytes, it has 17"], |fmu| {
        fmu.fmi3SetBinary(&vr, 1, &17, &[0; 17].as_ptr(), 1)
    });
    fmu.refused("no bytes", |fmu| fmu.fmi3SetBinary(&vr, 1, &3, &null(), 1));
    fmu.refused("no sizes", |fmu| fmu.fmi3SetBinary(&vr, 1, null(), &[0; 3].as_ptr(), 1));
    fmu.refused("endless", |fmu| fmu.fmi3SetBinary(&vr, 1, &usize::MAX, &[0; 3].as_ptr(), 1));
    fmu.ok(fmu.fmi3SetBinary(&vr, 1, &0, &null(), 1));
    assert!(read().is_empty());
}

#[test]
fn enumerations() {
    let (fmu, mut read) = (palette(), 0);
    fmu.ok(fmu.fmi3GetInt64(&reference(Name::colour as u32), 1, &mut read, 1));
    assert_eq!(read, i64::from(Colour::Red.number()));
    let fmu = Importer::of::<Talker>(CoSimulation);
    let mood = reference(talker::Name::mood as u32);
    fmu.ok(fmu.fmi3SetInt64(&mood, 1, &7, 1));
    fmu.refused_with(&["it is 3"], |fmu| fmu.fmi3SetInt64(&mood, 1, &3, 1));
    fmu.refused("the initialization", |fmu| fmu.enter_initialization_mode(0.0, None));
    fmu.refused("beyond Int32", |fmu| fmu.fmi3SetInt64(&mood, 1, &(7 + (1 << 32)), 1));
}

/// Checks that value references begin with 1; every function rejects 0.
#[test]
fn value_references_count_from_1() {
    let (fmu, mut value) = (Importer::of::<Oscillator>(CoSimulation), 0.0);
    fmu.initialize(0.0);
    fmu.set(&[oscillator::Name::force as u32], &[7.0]);
    fmu.ok(fmu.fmi3GetFloat64(&1, 1, &mut value, 1));
    assert_eq!((value, Oscillator::TABLE[0].name()), (7.0, "force"));
    let nobody = |text: String| assert!(text.contains("no variable with value reference 0"), "{text}");
    nobody(fmu.refused("get", |fmu| fmu.fmi3GetFloat64(&0, 1, &mut value, 1)));
    nobody(fmu.refused("set", |fmu| fmu.fmi3SetFloat64(&0, 1, &1.0, 1)));
    nobody(fmu.refused("of a type", |fmu| fmu.fmi3SetInt8(&0, 1, &1, 1)));
    nobody(fmu.refused("a rate", |fmu| fmu.fmi3GetOutputDerivatives(&0, 1, &1, &mut value, 1)));
    nobody(fmu.refused("a partial derivative", |fmu| {
        fmu.fmi3GetDirectionalDerivative(&0, 1, &1, 1, &1.0, 1, &mut value, 1)
    }));
}

/// Checks that the number of values must equal the number of variables, which are all scalars.
#[test]
fn counts() {
    let (fmu, vr) = (palette(), reference(Name::float64 as u32));
    let mut values = [0.0; 2];
    for count in [0, 2, usize::MAX] {
        fmu.refused_with(&["there are 1 values, the array has"], |fmu| {
            fmu.fmi3GetFloat64(&vr, 1, values.as_mut_ptr(), count)
        });
        fmu.refused("set", |fmu| fmu.fmi3SetFloat64(&vr, 1, values.as_ptr(), count));
    }
    fmu.refused("texts", |fmu| fmu.fmi3GetString(&reference(Name::string as u32), 1, null_mut(), 0));
}

/// Checks that every model has a time: in its table, or after all other variables.
#[test]
fn time() {
    fn check<M: Exported>(expected: Option<u32>) {
        let (place, variable) = independent::<M>();
        assert_eq!(place, expected.unwrap_or(M::TABLE.len() as u32));
        assert_eq!((variable.name(), variable.causality()), ("time", Causality::Independent));
        let fmu = Importer::of::<M>(CoSimulation);
        fmu.initialize(2.0);
        assert_eq!(fmu.get([place]), [2.0]);
        fmu.step(2.0, 0.5);
        assert_eq!(fmu.get([place]), [2.5]);
        fmu.refused("the time is no input", |fmu| fmu.try_set(&[place], &[1.0]));
        fmu.refused("what is behind it", |fmu| fmu.try_set(&[M::TABLE.len() as u32 + 1], &[1.0]));
    }
    check::<Palette>(None);
    check::<Counter>(None);
    let of_talker = Talker::TABLE.iter().position(|variable| variable.causality() == Causality::Independent);
    check::<Talker>(of_talker.map(|place| place as u32));
    // FMI 2.0 has no such variable.
    let fmu = fmu_test_kit::Importer::of::<Palette>(CoSimulation);
    fmu.initialize(0.0);
    fmu.refused("the time", |fmu| fmu.fmi2GetReal(&(Palette::TABLE.len() as u32), 1, &mut 0.0));
}
