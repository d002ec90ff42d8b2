//! Invalid arguments. (`tests/soundness` covers loggers that call back; `tests/panics` covers models that
//! panic.)

use crate::models::*;
use fmu_export::Interface::*;
use fmu_export::fmi3::types::*;
use fmu_export::{Exported, Mode};
use fmu_test_kit::checks::modes_of_model;
use fmu_test_kit::fmi3::Importer;
use fmu_test_kit::{Arguments, Either};
use std::cell::RefCell;
use std::ffi::CStr;
use std::ptr::{null, null_mut};

fn refusal(arguments: &Arguments) -> String {
    let log = Importer::try_with::<Sum>(arguments).unwrap_err();
    let [message] = log.as_slice() else { panic!("one message: {log:?}") };
    assert_eq!((message.status, message.category.as_str()), (Status::Error, "logStatusError"));
    message.text.clone()
}

#[test]
fn instances_that_are_refused() {
    let good = Arguments::of::<Sum>(CoSimulation);
    let cases = [
        (Arguments { instance_name: Some(c" \t"), ..good.clone() }, "the instance needs a name"),
        (Arguments { instance_name: None, ..good.clone() }, "the instance needs a name"),
        (Arguments { guid: None, ..good.clone() }, "the instantiationToken NULL is not"),
        (Arguments { fmu_type: 0, ..good.clone() }, "this FMU has no Model Exchange"),
        (
            Arguments { required_intermediate_variables: &[0], ..good },
            "requiredIntermediateVariables must be empty",
        ),
    ];
    for (arguments, expected) in cases {
        let text = refusal(&arguments);
        assert!(text.starts_with("fmi3Instantiate") && text.contains(expected), "{text}");
        let silent = Arguments { logger: false, ..arguments };
        assert_eq!(Importer::try_with::<Sum>(&silent).unwrap_err(), []);
    }
}

#[test]
fn scheduled_execution_is_refused() {
    thread_local!(static LOG: RefCell<Vec<(Status, String)>> = const { RefCell::new(Vec::new()) });
    unsafe extern "C" fn remember(
        _: fmi3InstanceEnvironment,
        status: fmi3Status,
        _: fmi3String,
        text: fmi3String,
    ) {
        // SAFETY: the FMU passes a string.
        let text = unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned();
        LOG.with_borrow_mut(|log| log.push((Status::from_c(status), text)));
    }
    let functions = fmu_export::fmi3::functions::<Sum>();
    // SAFETY: strings, NULL and a logger are valid arguments.
    let instance = unsafe {
        (functions.fmi3InstantiateScheduledExecution)(
            c"name".as_ptr(),
            c"{sum}".as_ptr(),
            null(),
            0,
            0,
            null_mut(),
            Some(remember),
            None,
            None,
            None,
        )
    };
    assert!(instance.is_null());
    let log = LOG.take();
    assert_eq!(log.len(), 1);
    assert!(log[0].1.contains("this FMU has no Scheduled Execution"), "{log:?}");
}

#[test]
fn version() {
    let nothing = Importer::null::<Sum>();
    // SAFETY: a string that the library keeps.
    assert_eq!(unsafe { CStr::from_ptr((nothing.functions().fmi3GetVersion)()) }, c"3.0");
}

/// Checks that NULL and zeros as arguments do not crash in any state.
#[test]
fn zeros() {
    fn zeros<M: Exported>() {
        for (interface, mode) in modes_of_model::<Importer, M>() {
            Importer::in_mode::<M>(interface, mode).call_all();
        }
    }
    zeros::<Palette>();
    zeros::<Oscillator>();
    zeros::<Ticker>();
}

#[test]
fn instances_of_the_other_standard() {
    let old = fmu_test_kit::Importer::of::<Sum>(CoSimulation);
    let functions = fmu_export::fmi3::functions::<Sum>();
    // SAFETY: a live instance of the same model.
    let status = unsafe { (functions.fmi3Reset)(old.instance()) };
    assert_eq!(Status::from_c(status), Status::Error);
    old.take_log();
}

#[test]
fn what_no_model_has() {
    let fmu = Importer::in_mode::<Ticker>(CoSimulation, Mode::Event);
    for (function, reason) in [
        ("fmi3GetClock", "this FMU has no clocks"),
        ("fmi3SetClock", "this FMU has no clocks"),
        ("fmi3GetIntervalDecimal", "this FMU has no clocks"),
        ("fmi3EvaluateDiscreteStates", "providesEvaluateDiscreteStates is false"),
    ] {
        let text = fmu.refused(function, |fmu| fmu.call_with_zeros(function));
        assert!(text.contains(reason), "{text}");
    }
    let fmu = Importer::of::<Ticker>(ModelExchange);
    fmu.refused_with(&["this FMU has no structural parameters"], |fmu| fmu.fmi3EnterConfigurationMode());
    fmu.refused("partitions", |fmu| fmu.fmi3ActivateModelPartition(0, 0.0));
}

/// Section 2.3.1: without logging there are only errors; with logging, or for single categories, more.
#[test]
fn logging() {
    let fmu = Importer::of::<Talker>(CoSimulation);
    let volume = talker::Name::volume as u32;
    fmu.set(&[volume], &[10.5]);
    assert_eq!(fmu.take_log(), [], "a warning is no error");
    fmu.ok(fmu.fmi3SetDebugLogging(fmi3True, 1, &c"logStatusWarning".as_ptr()));
    fmu.set(&[volume], &[10.6]);
    assert_eq!(fmu.take_log().len(), 1);
    fmu.ok(fmu.fmi3SetDebugLogging(fmi3True, 0, null()));
    fmu.initialize(0.0);
    assert!(fmu.take_log().iter().any(|message| message.text == "initialized"));
    // Errors cannot be disabled.
    fmu.ok(fmu.fmi3SetDebugLogging(fmi3False, 1, &c"logAll".as_ptr()));
    fmu.refused("no category", |fmu| fmu.fmi3SetDebugLogging(fmi3True, 1, &c"logNothing".as_ptr()));
}
