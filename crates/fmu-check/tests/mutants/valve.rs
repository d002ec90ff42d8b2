//! A second FMU with seeded faults, `valve.c` of the test kit. A check may test several faults, each of which must be found under the
//! name of its rule.

use super::wagon::{all_found, findings};
use fmu_test_kit::c_models;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Packs the FMU with the string `before` in its description replaced by `after`.
fn fmu(directory: &Path, fmi: u32, [before, after]: [&str; 2]) -> PathBuf {
    let text = c_models::read(&format!("valve{fmi}.xml"));
    assert!(text.contains(before), "{before}");
    let files: &[(&str, &[u8])] = &[("resources/curve.txt", b"7")];
    let library = c_models::library("valve", &[]);
    c_models::pack(directory, ("valve", fmi), &text.replacen(before, after, 1), &library, files)
}

/// Asserts that each of the faults is found, as [`all_found`] does.
fn caught(fmi: u32, topic: &str, expected: &[(&str, &str)]) {
    let directory = TempDir::new().expect("a directory");
    let expected: Vec<_> = expected.iter().map(|(fault, name)| (*fault, *name, "")).collect();
    all_found(&fmu(directory.path(), fmi, ["", ""]), topic, &expected);
}

#[test]
fn strings_are_part_of_saved_states() {
    caught(2, "states", &[("text_shared_with_states", "states.restore-values")]);
    caught(3, "states", &[("text_not_in_bytes", "states.fresh-process")]);
}

#[test]
fn instances_are_independent_in_any_directory() {
    let faults = [
        ("buffer_of_all", "results.threads"),
        ("uri_not_decoded", "results.location"),
        ("last_time_of_begin", "results.status"),
    ];
    caught(2, "results", &faults);
    let faults = [("buffer_of_both", "results.instances"), ("unload_after_two", "results.crash")];
    caught(3, "results", &faults);
}

#[test]
fn settings_of_the_process_stay() {
    caught(2, "resources", &[("seed_set", "resources.settings")]);
    caught(3, "resources", &[("stdout_buffered", "resources.crash")]);
}

#[test]
fn factors_are_of_the_declared_kind() {
    caught(2, "dependencies", &[("factor_varies", "dependencies.kind")]);
    caught(3, "dependencies", &[("late", "dependencies.missing")]);
}

/// Asserts that dependencies on Booleans, on integers and, in Initialization Mode, on parameters are found.
#[test]
fn dependencies_on_values_of_any_type() {
    for (fmi, before, after, name) in [
        (
            2,
            r#"dependencies="4 5 6" dependenciesKind="dependent dependent"#,
            r#"dependencies="5 6" dependenciesKind="dependent"#,
            "dependencies.missing",
        ),
        (
            3,
            r#"dependencies="4 5 6" dependenciesKind="dependent dependent"#,
            r#"dependencies="4 6" dependenciesKind="dependent"#,
            "dependencies.missing",
        ),
        (2, r#"dependencies="1 4 5 6""#, r#"dependencies="4 5 6""#, "dependencies.initial"),
    ] {
        let directory = TempDir::new().expect("a directory");
        let path = fmu(directory.path(), fmi, [before, after]);
        let findings = findings(&path, "none", "dependencies", &directory.path().join("out"));
        let names: Vec<_> = findings.iter().map(|finding| (&finding["name"], &finding["proof"])).collect();
        assert_eq!(names, [(&name.into(), &"shown".into())], "{after}");
    }
}

/// Asserts that nothing is found if the FMU does what the standard allows: strings in a buffer that the next call overwrites, the
/// use of random numbers, settings that are restored, a file that exists until the instance is freed, a factor that switches with
/// its input, and the end of the simulation by the model.
#[test]
fn unusual_behaviour_is_accepted() {
    for fmi in [2, 3] {
        let directory = TempDir::new().expect("a directory");
        let path = fmu(directory.path(), fmi, ["", ""]);
        let topics = "results,states,dependencies,resources";
        let found = findings(&path, "unusual", topics, &directory.path().join("out"));
        // The FMU counts its steps.
        assert!(found.iter().all(|finding| finding["name"] == "results.cut"), "{found:#?}");
    }
}
