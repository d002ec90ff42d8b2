//! A second FMU with seeded faults, `valve.c` of the test kit. A check may test several faults, each of which must be found under the
//! name of its rule.

use super::wagon::{UNLIMITED, check, not_shown_without_fault};
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

/// Checks topics of the FMU with faults. Returns the findings except the one that is expected because the FMU counts its steps.
fn found(directory: &Path, path: &Path, faults: &str, topics: &str) -> Vec<serde_json::Value> {
    let out = directory.join("out");
    let mut command = check(path);
    command.args(["--only", topics, "--no-shrink", "--repeat", "0.1", "--json", "--out"]).arg(out);
    let output = command.args(UNLIMITED).env("FMU_TRAITS", faults).output().expect("runs");
    let report: serde_json::Value = serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|error| panic!("{error}: {}", String::from_utf8_lossy(&output.stderr)));
    let mut findings = report["findings"].as_array().expect("a list").clone();
    findings.retain(|finding| finding["name"] != "results.cut");
    findings
}

/// Asserts that the faults are found under these names, and that the calls of each finding show it again, but not in the FMU
/// without faults.
fn caught(fmi: u32, faults: &str, topic: &str, names: &[&str]) {
    let directory = TempDir::new().expect("a directory");
    let path = fmu(directory.path(), fmi, ["", ""]);
    let findings = found(directory.path(), &path, faults, topic);
    for name in names {
        let finding = findings.iter().find(|finding| finding["name"] == *name);
        let finding = finding.unwrap_or_else(|| panic!("{faults}: no {name} in {findings:#?}"));
        assert_eq!(finding["proof"], "shown", "{faults}: {name}");
        not_shown_without_fault(&directory.path().join("out"), name, &path, faults);
    }
}

#[test]
fn strings_are_part_of_saved_states() {
    caught(2, "text_shared_with_states", "states", &["states.restore-values"]);
    caught(3, "text_not_in_bytes", "states", &["states.fresh-process"]);
}

#[test]
fn instances_are_independent_in_any_directory() {
    caught(
        2,
        "buffer_of_all,uri_not_decoded,last_time_of_begin",
        "results",
        &["results.threads", "results.location", "results.status"],
    );
    caught(3, "buffer_of_both,unload_after_two", "results", &["results.instances", "results.crash"]);
}

#[test]
fn settings_of_the_process_stay() {
    caught(2, "seed_set", "resources", &["resources.settings"]);
    caught(3, "stdout_buffered", "resources", &["resources.crash"]);
}

#[test]
fn factors_are_of_the_declared_kind() {
    caught(2, "factor_varies", "dependencies", &["dependencies.kind"]);
    caught(3, "late", "dependencies", &["dependencies.missing"]);
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
        let findings = found(directory.path(), &path, "none", "dependencies");
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
        assert_eq!(found(directory.path(), &path, "unusual", topics), Vec::<serde_json::Value>::new());
    }
}
