//! FMUs without a fault, in which fmu-check must find nothing but notes.

use super::wagon::{fmu, found, library};
use fmu_test_kit::c_models;
use std::process::Command;
use tempfile::TempDir;

/// Asserts that fmu-check finds only these notes in a variant of the wagon, and checks both interface types.
fn clean(fmi: u32, variant: &str, notes: &[&str]) {
    let directory = TempDir::new().expect("a directory");
    let path = fmu(directory.path(), fmi, &library(&[]), |text| text);
    // The unusual behaviour concerns these topics.
    let topics = ["--only", "life_cycle,states,start_values,results,reset,dependencies"];
    let options = if variant == "none" { &[][..] } else { &topics };
    let (_, report) = found(&path, variant, &[&["--repeat", "0.3"][..], options].concat());
    let findings = report["findings"].as_array().expect("a list").iter();
    // Whether there is a note on glibc depends on the system on which the library was compiled.
    let found: Vec<_> = findings.filter(|finding| finding["name"] != "package.glibc").collect();
    let is_expected = |finding: &&serde_json::Value| {
        finding["severity"] == "note" && notes.iter().any(|name| finding["name"] == *name)
    };
    assert!(found.iter().all(is_expected) && found.len() == notes.len(), "{found:#?}");
    let unchecked = report["unreached"].as_array().expect("a list");
    assert!(unchecked.iter().all(|of| of["why"] == "left out (--only)"), "{unchecked:?}");
    assert_eq!(report["interfaces"].as_array().map(Vec::len), Some(2));
}

#[test]
fn none_in_fmi2() {
    clean(2, "none", &[]);
}

#[test]
fn none_in_fmi3() {
    clean(3, "none", &[]);
}

/// Asserts that unusual behaviour is not a violation if the standard allows it: an event needs several updates, a local variable
/// cannot be read in Initialization Mode, a solver takes other steps after a restart, and the last digits of a result depend on parameters.
#[test]
fn unusual_behaviour_is_accepted() {
    clean(2, "unusual", &["states.digits"]);
    clean(3, "unusual", &["states.digits"]);
}

/// Asserts that the steps that fmu-check makes are allowed, whatever the default experiment is: a step that is not longer than 0 fails
/// an assertion of unoptimized builds.
#[test]
fn any_default_experiment_is_checked() {
    let directory = TempDir::new().expect("a directory");
    for (stop, size) in [("1", "0.3"), ("1", "1"), ("1", "3"), ("0.07", "0.01"), ("1e-9", "1"), ("0", "1")] {
        let path = fmu(directory.path(), 2, &library(&[]), |text| {
            text.replace(
                r#"stopTime="1" stepSize="0.01""#,
                &format!(r#"stopTime="{stop}" stepSize="{size}""#),
            )
        });
        let (found, report) = found(&path, "none", &["--only", "life_cycle,dynamics,results", "--quick"]);
        let found: Vec<_> = found.iter().filter(|(name, _)| name != "results.interfaces").collect();
        assert!(found.is_empty(), "{stop}, {size}: {found:?} {}", report["unreached"]);
    }
}

/// Asserts that a start value that cannot be read, which is a finding of the description, does not make fmu-check pass arrays without it.
#[test]
fn arrays_have_a_value_for_each_variable() {
    let directory = TempDir::new().expect("a directory");
    let path = fmu(directory.path(), 2, &library(&[]), |text| {
        text.replace(r#"<Real start="0"/>"#, r#"<Real start="0,5"/>"#)
    });
    let (found, _) = found(&path, "none", &["--only", "dynamics,description", "--no-shrink"]);
    let mut names: Vec<_> = found.iter().map(|(name, _)| name.as_str()).collect();
    names.dedup();
    assert_eq!(names, ["description.schema", "description.start"], "{found:?}");
}

/// Asserts that there is no finding if this machine lacks a library that the FMU needs, but that the interface types are reported
/// as not checked.
#[cfg(target_os = "linux")]
#[test]
fn a_missing_library_of_the_machine_is_not_a_fault() {
    let directory = TempDir::new().expect("a directory");
    let fortran = directory.path().join("libgfortran-of-another.so.5");
    let fortran = fortran.to_str().expect("a path");
    let empty =
        ["-shared", "-fPIC", "-Wl,-soname,libgfortran-of-another.so.5", "-xc", "/dev/null", "-o", fortran];
    assert!(Command::new("cc").args(empty).status().expect("a C compiler").success());
    let library = directory.path().join("wagon.so");
    c_models::compile("wagon", &["-Wl,--no-as-needed", fortran], &library);
    let path = fmu(directory.path(), 2, &library, |text| text);
    let (found, report) = found(&path, "none", &["--only", "functions,life_cycle"]);
    assert_eq!(found, [], "{report:#}");
    let unchecked = report["unreached"].as_array().expect("a list").iter();
    let why: Vec<_> = unchecked.filter(|of| of["allowed"] == false).map(|of| of["why"].to_string()).collect();
    assert_eq!(why.len(), 2);
    assert!(why.iter().all(|why| why.contains("this machine lacks libgfortran-of-another.so.5")), "{why:?}");
    assert_eq!(report["status"], 2);
}
