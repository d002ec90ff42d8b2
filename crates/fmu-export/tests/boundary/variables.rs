//! Strings, enumerations and rarer kinds of variables (section 2.2.7).

use crate::INTERFACES;
use crate::models::{Talker, talker::Name};
use fmu_export::Interface::{CoSimulation, ModelExchange};
use fmu_export::Mode::*;
use fmu_export::fmi2::types::Status;
use fmu_test_kit::{Either, Importer};
use std::ffi::{CStr, CString};
use std::ptr::null;

pub fn texts<const N: usize>(fmu: &Importer, names: [Name; N]) -> [String; N] {
    let mut texts = [null(); N];
    fmu.ok(fmu.fmi2GetString(names.map(|name| name as u32).as_ptr(), N, texts.as_mut_ptr()));
    // SAFETY: strings of the instance, valid until the next call (section 2.1.7).
    texts.map(|text| unsafe { CStr::from_ptr(text) }.to_str().unwrap().to_owned())
}

pub fn try_say(fmu: &Importer, name: Name, text: &str) -> Status {
    let text = CString::new(text).unwrap();
    fmu.fmi2SetString(&(name as u32), 1, &text.as_ptr())
}

pub fn say(fmu: &Importer, name: Name, text: &str) {
    fmu.ok(try_say(fmu, name, text));
}

fn integer(fmu: &Importer, name: Name) -> i32 {
    let mut value = i32::MIN;
    fmu.ok(fmu.fmi2GetInteger(&(name as u32), 1, &mut value));
    value
}

fn set_mood(fmu: &Importer, mood: i32) -> Status {
    fmu.fmi2SetInteger(&(Name::mood as u32), 1, &mood)
}

/// Checks strings in both directions, several at once and repeated, of any length and script.
#[test]
fn texts_in_and_out() {
    let long = "long ".repeat(10_000);
    for interface in INTERFACES {
        let fmu = Importer::in_mode::<Talker>(interface, Initialization);
        assert_eq!(texts(&fmu, [Name::heard, Name::greeting]), ["", "Hello"]);
        for text in ["", "Hi", "Gödel said: ∀x ∃y 🙂", "100%s #r1# \n\t", &long] {
            say(&fmu, Name::heard, text);
            assert_eq!(texts(&fmu, [Name::reply, Name::heard, Name::reply]), [text; 3]);
        }
        let (heard, greeting) = (Name::heard as u32, Name::greeting as u32);
        let values = [c"one", c"two", c"three"].map(CStr::as_ptr);
        fmu.ok(fmu.fmi2SetString([heard, greeting, heard].as_ptr(), 3, values.as_ptr()));
        assert_eq!(texts(&fmu, [Name::heard, Name::greeting]), ["three", "two"], "the last one counts");
    }
}

/// Checks that the strings of a call stay valid until the next call on this instance, regardless of other
/// instances.
#[test]
fn how_long_texts_live() {
    let [one, other] = [(); 2].map(|()| Importer::in_mode::<Talker>(CoSimulation, StepComplete));
    say(&one, Name::heard, "the one");
    let mut text = null();
    one.ok(one.fmi2GetString(&(Name::reply as u32), 1, &mut text));
    say(&other, Name::heard, "the other");
    texts(&other, [Name::reply]);
    // SAFETY: there was no call on this instance since.
    assert_eq!(unsafe { CStr::from_ptr(text) }, c"the one");
}

/// Checks that a text logged by a step is available after it.
#[test]
fn steps_with_texts() {
    let fmu = Importer::in_mode::<Talker>(CoSimulation, StepComplete);
    assert_eq!(texts(&fmu, [Name::said]), ["Hello"]);
    for (point, mood, expected) in [(0.0, 1, "Ping"), (1.0, 2, "Ping!"), (2.0, 7, "Ping!")] {
        say(&fmu, Name::heard, "Ping");
        fmu.ok(set_mood(&fmu, mood));
        fmu.step(point, 1.0);
        assert_eq!(texts(&fmu, [Name::said]), [expected]);
    }
}

/// Checks that Enumerations use the functions of Integers and accept only their items.
#[test]
fn enumerations() {
    let fmu = Importer::in_mode::<Talker>(CoSimulation, Initialization);
    for mood in [1, 2, 7] {
        fmu.ok(set_mood(&fmu, mood));
        assert_eq!((integer(&fmu, Name::mood), integer(&fmu, Name::own_mood)), (mood, mood));
    }
    for mood in [0, 3, -1, i32::MAX] {
        fmu.refused_with(&["mood must be one of 1 (Calm), 2 (Excited), 7 (Sulking)"], |fmu| {
            set_mood(fmu, mood)
        });
    }
    fmu.refused_with(&["mood is of type Enumeration, not Real"], |fmu| {
        fmu.fmi2GetReal(&(Name::mood as u32), 1, &mut 0.0)
    });
}

/// Checks a tunable parameter and a variable that depends on it, during the simulation.
#[test]
fn tunable_and_calculated_parameters() {
    for (interface, mode) in [(CoSimulation, StepComplete), (ModelExchange, Event)] {
        let fmu = Importer::in_mode::<Talker>(interface, mode);
        for volume in [1.0, 10.0] {
            fmu.set(&[Name::volume as u32], &[volume]);
            let [decibels] = fmu.get([Name::decibels as u32]);
            assert!((decibels - 20.0 * (volume + 1e-3).log10()).abs() < 1e-12);
        }
        say(&fmu, Name::greeting, "12345");
        assert_eq!(integer(&fmu, Name::length), 5);
    }
}

/// Checks that the calculation begins with the start value: different start values lead to different roots.
#[test]
fn start_values_of_calculations() {
    for (start, root) in [(1.0, 3.0), (-0.1, -3.0)] {
        let fmu = Importer::of::<Talker>(CoSimulation);
        fmu.set(&[Name::root as u32, Name::square as u32], &[start, 9.0]);
        fmu.initialize(0.0);
        assert!((fmu.get([Name::root as u32])[0] - root).abs() < 1e-12);
    }
}

#[test]
fn constants_and_the_time() {
    let fmu = Importer::in_mode::<Talker>(CoSimulation, StepComplete);
    assert_eq!(integer(&fmu, Name::answer), 42);
    let time = Name::time as u32;
    assert_eq!(fmu.get([time]), [0.0]);
    fmu.step(0.0, 0.5);
    assert_eq!(fmu.get([time]), [0.5]);
    fmu.refused("the time is not set like this", |fmu| fmu.try_set(&[time], &[1.0]));
    let fmu = Importer::in_mode::<Talker>(ModelExchange, ContinuousTime);
    fmu.ok(fmu.fmi2SetTime(-3.0));
    assert_eq!(fmu.get([time]), [-3.0]);
}
