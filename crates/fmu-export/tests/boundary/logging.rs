//! Content of log messages, and when they are logged (sections 2.1.5 and 2.2.4 of FMI 2.0).

use crate::models::clumsy::{ClumsyOnHeapName, Failure};
use crate::models::{ClumsyOnHeap, Oscillator, Talker, talker::Name};
use fmu_export::Exported;
use fmu_export::Interface::{CoSimulation, ModelExchange};
use fmu_export::Status;
use fmu_test_kit::serialized::{VALUES, with};
use fmu_test_kit::{Arguments, Either, Importer, Message, fmi3};
use std::ffi::CStr;
use std::ptr::{null, null_mut};

fn logging<M: Exported>(logging_on: bool) -> Importer {
    let arguments = Arguments { logging_on: logging_on.into(), ..Arguments::new::<M>(CoSimulation) };
    Importer::make::<M>(&arguments).unwrap()
}

/// Causes an event, a warning, a discarded query and an error. Returns the letters O, W, D and E of those that are logged.
fn shown(fmu: &Importer) -> String {
    fmu.take_log();
    fmu.ok(fmu.fmi2Reset());
    fmu.initialize(0.0);
    fmu.write_string(Name::heard as u32, "%s#r1#\n");
    fmu.step(0.0, 0.1);
    fmu.set(&[Name::volume as u32], &[10.5]);
    assert_eq!(fmu.fmi2GetStatus(0, &mut 0), Status::Discard);
    assert_eq!(fmu.try_set(&[99], &[0.0]), Status::Error);
    let log = fmu.take_log();
    log.iter().for_each(|message| {
        message.assert_clean();
        assert_eq!(message.instance_name, "instance");
        let category = match message.status {
            Status::Ok => "logEvents",
            Status::Warning => "logStatusWarning",
            Status::Discard => "logStatusDiscard",
            _ => "logStatusError",
        };
        assert_eq!(message.category, category, "{message:?}");
    });
    let mut letters: Vec<_> = log.iter().map(|message| format!("{:?}", message.status).remove(0)).collect();
    letters.dedup();
    letters.into_iter().collect()
}

/// Checks that without a list of categories, errors and warnings are always logged, and other messages only if logging is
/// on. According to section 2.1.3 of FMI 2.0, the message of fmi2Discard is logged only in debug mode.
#[test]
fn logging_on_and_off() {
    assert_eq!(shown(&logging::<Talker>(false)), "WE");
    assert_eq!(shown(&logging::<Talker>(true)), "OWDE");
    let fmu = logging::<Talker>(true);
    fmu.ok(fmu.fmi2SetDebugLogging(0, 0, null()));
    assert_eq!(shown(&fmu), "WE");
    fmu.ok(fmu.fmi2SetDebugLogging(1, 0, null()));
    assert_eq!(shown(&fmu), "OWDE");
}

/// Checks that fmi2SetDebugLogging with a list of categories changes only these.
#[test]
fn categories() {
    let cases: &[(bool, bool, &[&CStr], &str)] = &[
        // loggingOn of fmi2Instantiate, loggingOn of fmi2SetDebugLogging, the list, the logged statuses
        (false, true, &[c"logEvents"], "OWE"),
        (false, true, &[c"logAll"], "OWDE"),
        (false, true, &[c"logStatusDiscard"], "WDE"),
        (true, false, &[c"logEvents"], "WDE"),
        (true, false, &[c"logEvents", c"logStatusDiscard"], "WE"),
        (true, false, &[c"logStatusWarning"], "ODE"),
        (true, false, &[c"logStatusError"], "OWD"),
        (true, false, &[c"logAll"], ""),
    ];
    for (first, on, list, expected) in cases {
        let fmu = logging::<Talker>(*first);
        fmu.ok(fmu.set_debug_logging(*on, list));
        assert_eq!(shown(&fmu), *expected, "{first} {on} {list:?}");
    }
}

#[test]
fn categories_that_do_not_exist() {
    let fmu = logging::<Talker>(false);
    let message = fmu.rejected("unknown", |fmu| fmu.set_debug_logging(true, &[c"logEvents", c"logWishes%s"]));
    for category in fmu_export::Category::ALL {
        assert!(message.contains(category.name().to_str().unwrap()), "{message}");
    }
    assert!(message.contains("logWishes"), "{message}");
    fmu.rejected("NULL entry", |fmu| fmu.fmi2SetDebugLogging(1, 2, [c"logEvents".as_ptr(), null()].as_ptr()));
    fmu.rejected("NULL list", |fmu| fmu.fmi2SetDebugLogging(1, 3, null()));
    fmu.rejected("no UTF-8", |fmu| fmu.set_debug_logging(true, &[c"\xff"]));
    assert_eq!(shown(&fmu), "WE", "no category must be changed");
}

/// Checks that FMI 3.0 logs only errors if logging is off (section 2.3.1). Errors cannot be disabled.
#[test]
fn logging_of_fmi3() {
    let fmu = fmi3::Importer::new::<Talker>(CoSimulation);
    let volume = Name::volume as u32;
    fmu.set(&[volume], &[10.5]);
    assert_eq!(fmu.take_log(), [], "a warning must not be logged");
    fmu.ok(fmu.fmi3SetDebugLogging(1, 1, &c"logStatusWarning".as_ptr()));
    fmu.set(&[volume], &[10.6]);
    assert_eq!(fmu.take_log().len(), 1);
    fmu.ok(fmu.fmi3SetDebugLogging(1, 0, null()));
    fmu.initialize(0.0);
    assert!(fmu.take_log().iter().any(|message| message.message == "initialized"));
    fmu.ok(fmu.fmi3SetDebugLogging(0, 1, &c"logAll".as_ptr()));
    fmu.rejected("no category", |fmu| fmu.fmi3SetDebugLogging(1, 1, &c"logNothing".as_ptr()));
}

/// Checks which messages about a run are logged if logging is on.
#[test]
fn events() {
    let fmu = logging::<Oscillator>(true);
    fmu.initialize(0.0);
    fmu.set(&[0], &[0.1]);
    fmu.step(0.0, 0.1);
    fmu.ok(fmu.fmi2Terminate());
    fmu.ok(fmu.fmi2Reset());
    let log = fmu.take_log();
    let texts: Vec<_> = log.iter().map(|message| message.message.as_str()).collect();
    assert_eq!(texts, ["instantiated", "initialized", "terminated", "reset to the start values"]);
    assert!(log.iter().all(|Message { status, category, .. }| (*status, category.as_str()) == (Status::Ok, "logEvents")));
}

/// Checks that a message of the model is delivered once, at the end of the call in which it is logged, and that a warning
/// has the status Warning.
#[test]
fn messages_of_the_model() {
    let fmu = logging::<Talker>(true);
    fmu.initialize(0.0);
    fmu.write_string(Name::heard as u32, "Ping");
    fmu.take_log();
    fmu.step(0.0, 1.0);
    assert_eq!(
        fmu.take_log().iter().map(|message| message.message.as_str()).collect::<Vec<_>>(),
        ["says Ping"]
    );
    let volume = [Name::volume as u32];
    fmu.set(&volume, &[10.5]);
    let log = fmu.take_log();
    assert_eq!(
        (log.len(), log[0].status, log[0].message.as_str()),
        (1, Status::Warning, "a volume of 10.5 hurts")
    );
    fmu.set(&volume, &[1.0]);
    assert_eq!(fmu.take_log(), []);
    // Saved states contain no messages.
    let bytes = fmu.bytes();
    fmu.restore(&bytes);
    assert_eq!(fmu.take_log(), []);
}

/// Checks messages that the model logs in a rejected call and during instantiation.
#[test]
fn messages_of_a_model_that_fails() {
    let fmu = logging::<ClumsyOnHeap>(true);
    let messages =
        |fmu: &Importer| fmu.take_log().into_iter().map(|message| message.message).collect::<Vec<_>>();
    let fails = |failure: Failure| fmu.set_item(ClumsyOnHeapName::fails as u32, failure as i32);
    assert_eq!(messages(&fmu), ["made", "instantiated"]);
    let failed = |function: &str, at: &str| {
        [format!("{at} will fail"), format!("{function}: {at} has failed half-way")]
    };
    assert_eq!(fails(Failure::Update), Status::Error);
    assert_eq!(messages(&fmu), failed("fmi2SetInteger", "Update"));
    fmu.ok(fails(Failure::Initialize));
    assert_eq!(fmu.fmi2EnterInitializationMode(), Status::Error);
    assert_eq!(messages(&fmu), failed("fmi2EnterInitializationMode", "Initialize"));
    fmu.ok(fails(Failure::Event));
    fmu.ok(fmu.fmi2EnterInitializationMode());
    assert_eq!(fmu.fmi2ExitInitializationMode(), Status::Error);
    assert_eq!(messages(&fmu), failed("fmi2ExitInitializationMode", "Event"));
    // The model rejects the de-serialized bytes.
    let bytes = with(fmu.bytes(), VALUES..VALUES + 8, &(Failure::Update as i64).to_le_bytes());
    let status = fmu.fmi2DeSerializeFMUstate(bytes.as_ptr().cast(), bytes.len(), &mut null_mut());
    assert_eq!(status, Status::Error);
    assert_eq!(messages(&fmu), failed("fmi2DeSerializeFMUstate", "Update"));
    fmu.ok(fmu.fmi2Reset());
    assert_eq!(messages(&fmu), ["reset to the start values", "made"]);
    // The model logs in steps that end at an event.
    fmu.initialize(0.0);
    fmu.step(0.0, 2.0);
    assert_eq!(messages(&fmu), ["initialized", "stops at 1", "stops at 2"]);
}

/// Checks that every instance logs with its name and its environment.
#[test]
fn instances_do_not_mix() {
    let fmus = [c"left", c"right"].map(|name| {
        let arguments = Arguments { instance_name: Some(name), ..Arguments::new::<Talker>(CoSimulation) };
        Importer::make::<Talker>(&arguments).unwrap()
    });
    for (fmu, name) in fmus.iter().zip(["left", "right"]) {
        assert_eq!(fmu.try_set(&[99], &[0.0]), Status::Error);
        let log = fmu.take_log();
        assert_eq!(log.len(), 1);
        assert_eq!(log[0].instance_name, name);
    }
}

/// Checks that a NULL logger suppresses the messages, and does not change the statuses of calls. All tests here pass NULL
/// for the memory callbacks.
#[test]
fn no_logger() {
    let arguments = Arguments { logger: false, logging_on: 1, ..Arguments::new::<Talker>(ModelExchange) };
    let fmu = Importer::make::<Talker>(&arguments).unwrap();
    fmu.initialize(0.0);
    assert_eq!(fmu.try_set(&[99], &[0.0]), Status::Error);
    assert_eq!(fmu.take_log(), []);
}
