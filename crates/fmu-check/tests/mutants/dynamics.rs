//! Faults in the behaviour in time. Each check tests several of them, because a check takes much longer than finding another
//! fault.

use super::wagon::{all_found, findings};
use fmu_test_kit::c_models;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Packs the FMU of `spring.c`.
fn spring(directory: &Path, fmi: u32) -> PathBuf {
    let description = c_models::read(&format!("spring{fmi}.xml"));
    c_models::pack(directory, ("spring", fmi), &description, &c_models::library("spring", &[]), &[])
}

/// Asserts that each of the faults is found, as [`all_found`] does.
fn found(fmi: u32, topics: &str, expected: &[(&str, &str, &str)]) {
    let directory = TempDir::new().expect("a directory");
    all_found(&spring(directory.path(), fmi), topics, expected);
}

/// Without the number of event indicators, an importer does not look for state events. So the event that spring.c has there must be found
/// as one that is not announced.
#[test]
fn events_without_indicators() {
    let directory = TempDir::new().expect("a directory");
    let description = c_models::read("spring2.xml").replace(r#" numberOfEventIndicators="2""#, "");
    let library = c_models::library("spring", &[]);
    let path = c_models::pack(directory.path(), ("spring", 2), &description, &library, &[]);
    let found = findings(&path, "none", "dynamics", &directory.path().join("out"));
    assert_eq!(found.len(), 1, "{found:#?}");
    let observed = found[0]["observed"].as_str().expect("a string");
    assert!(found[0]["name"] == "dynamics.unannounced" && observed.contains("touches changes"), "{observed}");
}

#[test]
fn steps_and_indicators() {
    let faults = [
        ("remainder_dropped", "dynamics.small-steps", "before and after 8 steps"),
        ("count_late", "dynamics.late-output", "count is"),
        ("indicator_squared", "dynamics.unannounced", "touches"),
        ("event_input_latched", "dynamics.event-inputs", "state derivative 2"),
        ("late_is_nan", "dynamics.start-time", "v is NaN at 1000000"),
        ("setup_rejects_negative", "dynamics.start-rejected", "fmi2SetupExperiment returns Error"),
    ];
    found(2, "dynamics", &faults);
}

#[test]
fn inputs_and_clocks() {
    let faults = [
        ("remainder_repeated", "dynamics.small-steps", "after 8 steps"),
        ("feedthrough_late", "dynamics.late-output", "changes y by"),
        ("input_unseen", "dynamics.stale", "after inputs were set"),
        ("event_input_lost", "dynamics.event-inputs", "y is"),
        ("indicator_constant", "dynamics.unannounced", "touches changes from 0 to 1"),
        ("clock_truncates", "dynamics.start-time", "10 steps apart across it"),
        ("event_counts_again", "dynamics.repeated-event", "count"),
    ];
    found(2, "dynamics", &faults);
}

#[test]
fn event_modes_and_outputs() {
    let faults = [
        ("output_late", "dynamics.late-output", "y is"),
        ("derivative_of_old_mode", "dynamics.stale", "state derivative 2"),
        ("event_mode_reads_old", "dynamics.event-mode", "state derivative 2"),
        ("event_input_lost_stepped", "dynamics.event-inputs", "der_x is"),
        ("negative_rejected", "dynamics.start-time", "started at -5"),
        ("state_single", "start_values.single", "state 1 was set to"),
    ];
    found(3, "dynamics,start_values", &faults);
}

#[test]
fn outputs_and_the_order_of_reading() {
    for fault in ["output_with_derivatives", "output_outdated"] {
        found(2, "dynamics", &[(fault, "dynamics.read-order", "y at ")]);
    }
}

#[test]
fn digits_and_partial_derivatives() {
    let faults = [
        ("parameter_single", "start_values.single", "k was set to"),
        ("output_single", "start_values.single-output", "all values of y"),
        ("partial_of_old_mode", "derivatives.directional", "with respect to x"),
        ("partial_without_input_initially", "derivatives.directional", "in Initialization Mode"),
    ];
    found(2, "start_values,derivatives", &faults);
}

/// Asserts that nothing is found in variants that the standard allows, except the note on a variable that counts entries. In FMI 2.0, the FMU converts units, counts how often Event
/// Mode is entered and has an input that acts from time zero on, and its solver carries the remainder of a step to the next one.
/// In a second variant of FMI 2.0, the error of the solver depends on its steps. In FMI 3.0, the solver takes one step of Euler's
/// method. All variants have an event indicator that never changes.
#[test]
fn sound() {
    for (fmi, variants, note) in [
        (2, "harmless_carry,harmless_entries,harmless_source,harmless_units", Some("dynamics.counted-entry")),
        (2, "harmless_noise", None),
        (3, "harmless_euler", None),
    ] {
        let directory = TempDir::new().expect("a directory");
        let (path, out) = (spring(directory.path(), fmi), directory.path().join("out"));
        let findings = findings(&path, variants, "dynamics,start_values,derivatives", &out);
        let names: Vec<_> = findings.iter().filter_map(|finding| finding["name"].as_str()).collect();
        assert_eq!(names, Vec::from_iter(note), "{variants}: {findings:#?}");
    }
}
