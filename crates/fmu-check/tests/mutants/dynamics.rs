//! Faults in the behaviour in time. Each check tests several of them, because a check takes much longer than finding another
//! fault.

use super::wagon::{UNLIMITED, check};
use fmu_test_kit::c_models;
use serde_json::Value;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Packs the FMU of `spring.c`.
fn spring(directory: &Path, fmi: u32) -> PathBuf {
    let description = c_models::read(&format!("spring{fmi}.xml"));
    c_models::pack(directory, ("spring", fmi), &description, &c_models::library("spring", &[]), &[])
}

/// Checks the FMU with these faults; returns the findings, except the expected ones.
fn findings(fmi: u32, faults: &str, topics: &str) -> Vec<Value> {
    let directory = TempDir::new().expect("a directory");
    let mut command = check(&spring(directory.path(), fmi));
    command.args(UNLIMITED).args(["--only", topics, "--no-shrink", "--json"]).env("FMU_TRAITS", faults);
    let output = command.output().expect("runs");
    let report: Value = serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|error| panic!("{error}: {}", String::from_utf8_lossy(&output.stderr)));
    assert_eq!(report["interfaces"].as_array().map(Vec::len), Some(2));
    let mut findings = report["findings"].as_array().expect("a list").clone();
    // Depends on the system.
    findings.retain(|finding| finding["name"] != "package.glibc");
    // The calls are so many that failure messages would be unreadable.
    findings.iter_mut().for_each(|finding| finding["replay"] = Value::Null);
    findings
}

/// Asserts that each of the faults is found. `expected` has the fault, the name of the rule, and a part of an observation for
/// each. The calls of the finding must show it again.
fn found(fmi: u32, topics: &str, expected: &[(&str, &str, &str)]) {
    let faults: Vec<&str> = expected.iter().map(|(fault, ..)| *fault).collect();
    let findings = findings(fmi, &faults.join(","), topics);
    for (fault, name, what) in expected {
        let finding = findings.iter().find(|finding| finding["name"] == *name);
        let finding = finding.unwrap_or_else(|| panic!("{fault} is not found as {name}: {findings:#?}"));
        let others = finding["more"].as_array().into_iter().flatten().chain([&finding["observed"]]);
        let mut observed = others.filter_map(Value::as_str);
        assert!(observed.any(|observed| observed.contains(what)), "{fault}: {finding:#}");
        assert_eq!(finding["proof"], "shown", "{fault}: {finding:#}");
    }
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
fn digits_and_partial_derivatives() {
    let faults = [
        ("parameter_single", "start_values.single", "k was set to"),
        ("output_single", "start_values.single-output", "all values of y"),
        ("partial_of_old_mode", "derivatives.directional", "with respect to x"),
        ("partial_without_input_initially", "derivatives.directional", "in Initialization Mode"),
    ];
    found(2, "start_values,derivatives", &faults);
}

/// Asserts that nothing is found in variants that the standard allows. In FMI 2.0, the FMU converts units, counts how often Event
/// Mode is entered and has an input that acts from time zero on, and its solver carries the remainder of a step to the next one.
/// In a second variant of FMI 2.0, the error of the solver depends on its steps. In FMI 3.0, the solver takes one step of Euler's
/// method. All variants have an event indicator that never changes.
#[test]
fn sound() {
    for (fmi, variants) in [
        (2, "harmless_carry,harmless_entries,harmless_source,harmless_units"),
        (2, "harmless_noise"),
        (3, "harmless_euler"),
    ] {
        let findings = findings(fmi, variants, "dynamics,start_values,derivatives");
        assert!(findings.is_empty(), "{variants}: {findings:#?}");
    }
}
