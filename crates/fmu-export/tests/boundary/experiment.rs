//! Names, resources, times and tolerances that the importer passes (sections 2.1.5 and 2.1.6 of FMI 2.0), and how the
//! model receives them.

use crate::models::{Talker, talker::Name};
use crate::variables::texts;
use fmu_export::Interface::CoSimulation;
use fmu_test_kit::{Arguments, Either, Importer};
use std::ffi::{CStr, CString};
use std::path::PathBuf;

fn talker(instance_name: &'static CStr, resource_location: Option<&CStr>) -> Importer {
    let arguments = Arguments {
        instance_name: Some(instance_name),
        resource_location,
        ..Arguments::new::<Talker>(CoSimulation)
    };
    Importer::make::<Talker>(&arguments).unwrap()
}

#[test]
fn the_instance_name() {
    let [one, other] = [c"G\xc3\xb6del", c"Turing"].map(|name| talker(name, None));
    one.enter_initialization(0.0, None);
    other.enter_initialization(0.0, None);
    assert_eq!(texts(&one, [Name::who]), ["Gödel"]);
    assert_eq!(texts(&other, [Name::who]), ["Turing"]);
    one.ok(one.fmi2Reset());
    one.enter_initialization(0.0, None);
    assert_eq!(texts(&one, [Name::who]), ["Gödel"], "after a reset too");
}

/// Checks start time, stop time and tolerance. The model returns -1 for an undefined value.
#[test]
fn times_and_tolerance() {
    for (tolerance, start, stop) in [(None, 0.0, None), (Some(1e-4), 2.0, Some(3.0)), (Some(0.0), -1.5, None)]
    {
        let fmu = talker(c"talker", None);
        fmu.ok(fmu.fmi2SetupExperiment(
            tolerance.is_some().into(),
            tolerance.unwrap_or(f64::NAN),
            start,
            stop.is_some().into(),
            stop.unwrap_or(f64::NAN),
        ));
        fmu.ok(fmu.fmi2EnterInitializationMode());
        let found = fmu.get([Name::begin, Name::end, Name::tolerance, Name::time].map(|name| name as u32));
        assert_eq!(found, [start, stop.unwrap_or(-1.0), tolerance.unwrap_or(-1.0), start]);
        // The state includes the experiment.
        let other = talker(c"other", None);
        other.restore(&fmu.bytes());
        assert_eq!(other.get([Name::begin, Name::end].map(|name| name as u32)), found[..2]);
    }
}

/// Checks that the start time is 0 without fmi2SetupExperiment.
#[test]
fn no_experiment() {
    let fmu = talker(c"talker", None);
    fmu.ok(fmu.fmi2EnterInitializationMode());
    assert_eq!(fmu.get([Name::begin, Name::time].map(|name| name as u32)), [0.0, 0.0]);
}

/// Creates a directory for resources, with a space in its name.
fn resources(name: &str, words: &str) -> PathBuf {
    let directory = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("resources of").join(name);
    std::fs::create_dir_all(&directory).unwrap();
    std::fs::write(directory.join("words.txt"), words).unwrap();
    directory
}

/// Checks that a resource file is read. Unit tests of `Setup` check the forms of the location.
#[test]
fn files_in_the_resources() {
    let path = resources("talker", "To be or not to be\n");
    let location = CString::new(format!("file://{}", path.display()).replace(' ', "%20")).unwrap();
    for (location, expected) in [(Some(&*location), "To be or not to be"), (None, "none")] {
        let fmu = talker(c"talker", location);
        fmu.enter_initialization(0.0, None);
        assert_eq!(texts(&fmu, [Name::words]), [expected]);
    }
}

/// Checks that the message of a model that rejects its resources is logged.
#[test]
fn bad_resources() {
    let location = CString::new(resources("mute", "\n").to_str().unwrap()).unwrap();
    let arguments =
        Arguments { resource_location: Some(&location), ..Arguments::new::<Talker>(CoSimulation) };
    let log = Importer::make::<Talker>(&arguments).expect_err("an empty file must be rejected");
    assert_eq!(log.len(), 1);
    assert_eq!(log[0].message, "fmi2Instantiate: resources/words.txt is empty");
}
