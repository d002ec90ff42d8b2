//! What the importer's log shows, and when (sections 2.1.5 and 2.2.4).

use crate::support::{Arguments, Fmu, Message, Status, assert_clean};
use fmi2_export::Interface::CoSimulation;
use prw_testbed::variables::vr;
use std::ffi::CStr;
use std::ptr::null;

fn fmu(logging_on: bool) -> Fmu {
    Fmu::instantiate(&Arguments { logging_on, ..Arguments::new(CoSimulation) }).unwrap()
}

/// What is logged of an event, a discarded question and an error: O, D, E for their statuses.
fn shown(fmu: &Fmu) -> String {
    fmu.take_log();
    fmu.ok(fmu.fmi2Reset());
    fmu.initialize(0.0);
    assert_eq!(fmu.fmi2GetStatus(0, &mut Status::Ok), Status::Discard);
    assert_eq!(fmu.try_set(&[99], &[0.0]), Status::Error);
    let log = fmu.take_log();
    log.iter().for_each(|message| {
        assert_clean(message);
        assert_eq!(message.instance_name, "wrist");
        let category = match message.status {
            Status::Ok => "logEvents",
            Status::Discard => "logStatusDiscard",
            _ => "logStatusError",
        };
        assert_eq!(message.category, category, "{message:?}");
    });
    let mut letters: Vec<_> = log.iter().map(|message| format!("{:?}", message.status).remove(0)).collect();
    letters.dedup();
    letters.into_iter().collect()
}

/// Errors are always told, the rest on demand: section 2.1.3 has fmi2Discard shown in debug mode only.
#[test]
fn logging_on_and_off() {
    assert_eq!(shown(&fmu(false)), "E");
    assert_eq!(shown(&fmu(true)), "ODE");
    let fmu = fmu(true);
    fmu.ok(fmu.fmi2SetDebugLogging(0, 0, null()));
    assert_eq!(shown(&fmu), "E");
    fmu.ok(fmu.fmi2SetDebugLogging(1, 0, null()));
    assert_eq!(shown(&fmu), "ODE");
}

/// A list switches what it names.
#[test]
fn categories() {
    let cases: &[(bool, bool, &[&CStr], &str)] = &[
        // loggingOn of fmi2Instantiate, of fmi2SetDebugLogging, the list, what is shown
        (false, true, &[c"logEvents"], "OE"),
        (false, true, &[c"logAll"], "ODE"),
        (false, true, &[c"logStatusDiscard"], "DE"),
        (true, false, &[c"logEvents"], "DE"),
        (true, false, &[c"logEvents", c"logStatusDiscard"], "E"),
        (true, false, &[c"logStatusError"], "OD"),
        (true, false, &[c"logAll"], ""),
    ];
    for (first, on, list, expected) in cases {
        let fmu = fmu(*first);
        fmu.ok(fmu.set_debug_logging(*on, list));
        assert_eq!(shown(&fmu), *expected, "{first} {on} {list:?}");
    }
}

#[test]
fn categories_that_do_not_exist() {
    let fmu = fmu(false);
    let message = fmu.refused("unknown", |fmu| fmu.set_debug_logging(true, &[c"logEvents", c"logWishes%s"]));
    for word in ["logWishes", "logEvents", "logStatusDiscard", "logStatusError", "logStatusFatal", "logAll"] {
        assert!(message.contains(word), "{message}");
    }
    fmu.refused("NULL entry", |fmu| fmu.fmi2SetDebugLogging(1, 2, [c"logEvents".as_ptr(), null()].as_ptr()));
    fmu.refused("NULL list", |fmu| fmu.fmi2SetDebugLogging(1, 3, null()));
    fmu.refused("no UTF-8", |fmu| fmu.set_debug_logging(true, &[c"\xff"]));
    assert_eq!(shown(&fmu), "E", "nothing was switched");
}

/// The course of a run as a user reads it.
#[test]
fn events() {
    let fmu = fmu(true);
    fmu.initialize(0.0);
    fmu.set(&[vr::theta1], &[0.1]);
    fmu.step(0.0, 0.1);
    fmu.ok(fmu.fmi2Terminate());
    fmu.ok(fmu.fmi2Reset());
    let log = fmu.take_log();
    let texts: Vec<_> = log.iter().map(|message| message.text.as_str()).collect();
    assert_eq!(texts, ["instantiated", "initialized", "terminated", "reset to the start values"]);
    assert!(log.iter().all(|Message { status, category, .. }| (*status, category.as_str()) == (Status::Ok, "logEvents")));
}

/// Every instance logs under its own name to its own environment.
#[test]
fn instances_do_not_mix() {
    let fmus = [c"left", c"right"].map(|name| {
        Fmu::instantiate(&Arguments { instance_name: Some(name), ..Arguments::new(CoSimulation) }).unwrap()
    });
    for (fmu, name) in fmus.iter().zip(["left", "right"]) {
        assert_eq!(fmu.try_set(&[99], &[0.0]), Status::Error);
        let log = fmu.take_log();
        assert_eq!(log.len(), 1);
        assert_eq!(log[0].instance_name, name);
    }
}
