//! Correct FMUs, in which nothing is found.

use super::wagon::{fmu, found, library};
use std::process::Command;
use tempfile::TempDir;

/// Asserts that the wagon without a fault has only these findings, which are notes.
fn clean(fmi: u32, variant: &str, notes: &[&str]) {
    let directory = TempDir::new().expect("a directory");
    let path = fmu(directory.path(), fmi, &library(fmi, ""), |text| text);
    // The manners concern these topics.
    let topics = ["--only", "life_cycle,states,start_values,results,reset"];
    let options = if variant == "none" { &[][..] } else { &topics };
    let (_, report) = found(&path, variant, &[&["--repeat", "0.3"][..], options].concat());
    let findings = report["findings"].as_array().expect("a list").iter();
    // The note on glibc depends on the system of the compiler.
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

/// Asserts that an FMU is not accused of what the standard allows: an event with several updates, local variables that cannot be read
/// in Initialization Mode, and a solver that takes other steps after a restart.
#[test]
fn manners_of_other_tools() {
    clean(2, "manners", &["states.digits"]);
    clean(3, "manners", &["states.digits"]);
}

/// Asserts that a library that this machine cannot load is not accused, but not checked.
#[cfg(target_os = "linux")]
#[test]
fn a_missing_library_of_the_machine_is_not_a_fault() {
    let directory = TempDir::new().expect("a directory");
    let [fortran, library] =
        ["libgfortran-of-another.so.5", "wagon.so"].map(|name| directory.path().join(name));
    let compile = |arguments: &[&str]| {
        let status = Command::new("cc").args(["-shared", "-fPIC", "-x", "c"]).args(arguments).status();
        assert!(status.expect("a C compiler").success());
    };
    let source = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/mutants/wagon.c");
    let [fortran, output] = [&fortran, &library].map(|path| path.to_str().expect("a path"));
    compile(&["-Wl,-soname,libgfortran-of-another.so.5", "/dev/null", "-o", fortran]);
    let link = ["-x", "none", "-Wl,--no-as-needed", fortran, "-lm", "-lpthread", "-o", output];
    compile(&[&[source][..], &link].concat());
    let path = fmu(directory.path(), 2, &library, |text| text);
    let (found, report) = found(&path, "none", &["--only", "functions,life_cycle"]);
    assert_eq!(found, [], "{report:#}");
    let unchecked = report["unreached"].as_array().expect("a list").iter();
    let why: Vec<_> = unchecked.filter(|of| of["allowed"] == false).map(|of| of["why"].to_string()).collect();
    assert_eq!(why.len(), 2);
    assert!(why.iter().all(|why| why.contains("this machine lacks libgfortran-of-another.so.5")), "{why:?}");
    assert_eq!(report["status"], 2);
}
