//! Builds the wagon FMU, and runs fmu-check.

use fmu_test_kit::c_models;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Returns the path of the compiled library. The environment variable `FMU_TRAITS` selects the fault.
pub fn library(flags: &[&str]) -> PathBuf {
    c_models::library("wagon", flags)
}

/// Packs the FMU with a changed description.
pub fn fmu(directory: &Path, fmi: u32, library: &Path, change: impl Fn(String) -> String) -> PathBuf {
    let description = change(c_models::read(&format!("wagon{fmi}.xml")));
    c_models::pack(directory, ("wagon", fmi), &description, library, &[])
}

/// Options for a maximum duration that no check reaches, because the machine may be busy.
pub const UNLIMITED: [&str; 2] = ["--time", "3600"];

/// Returns the command that checks an FMU.
pub fn check(fmu: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_fmu-check"));
    command.arg(fmu);
    command
}

/// Checks an FMU with a fault; returns the names and observations of the findings, and the report.
pub fn found(fmu: &Path, fault: &str, options: &[&str]) -> (Vec<(String, String)>, serde_json::Value) {
    let unlimited = if options.contains(&"--quick") { &[][..] } else { &UNLIMITED };
    let mut command = check(fmu);
    let output = command.args(options).args(unlimited).arg("--json").env("FMU_TRAITS", fault);
    let output = output.output().expect("runs");
    let report: serde_json::Value = serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|error| panic!("{error}: {}", String::from_utf8_lossy(&output.stderr)));
    let text =
        |finding: &serde_json::Value, name: &str| finding[name].as_str().unwrap_or_default().to_owned();
    let findings = report["findings"].as_array().expect("a list");
    (findings.iter().map(|finding| (text(finding, "name"), text(finding, "observed"))).collect(), report)
}

/// Checks topics of an FMU with faults; returns the findings, except the ones that depend on the system. The reports are in `out`.
pub fn findings(fmu: &Path, faults: &str, topics: &str, out: &Path) -> Vec<serde_json::Value> {
    let options = ["--only", topics, "--no-shrink", "--repeat", "0.1", "--out", &out.to_string_lossy()];
    let (_, report) = found(fmu, faults, &options);
    let unchecked = report["unreached"].as_array().expect("a list");
    assert!(unchecked.iter().all(|of| of["allowed"] == true), "{unchecked:?}");
    let mut findings = report["findings"].as_array().expect("a list").clone();
    findings.retain(|finding| finding["name"] != "package.glibc");
    // The calls are so many that failure messages would be unreadable.
    findings.iter_mut().for_each(|finding| finding["replay"] = serde_json::Value::Null);
    findings
}

/// Asserts that each of the faults of an FMU is found, although it has all of them. `expected` has the fault, the name of the rule, and a
/// part of an observation for each. The calls of each finding must show it again, but not in the FMU without faults.
pub fn all_found(fmu: &Path, topics: &str, expected: &[(&str, &str, &str)]) {
    let out = fmu.with_extension("out");
    let faults = expected.iter().map(|(fault, ..)| *fault).collect::<Vec<_>>().join(",");
    let findings = findings(fmu, &faults, topics, &out);
    for (fault, name, what) in expected {
        let finding = findings.iter().find(|finding| finding["name"] == *name);
        let finding = finding.unwrap_or_else(|| panic!("{fault} is not found as {name}: {findings:#?}"));
        let others = finding["more"].as_array().into_iter().flatten().chain([&finding["observed"]]);
        let mut observed = others.filter_map(serde_json::Value::as_str);
        assert!(observed.any(|observed| observed.contains(what)), "{fault}: {finding:#}");
        assert_eq!(finding["proof"], "shown", "{fault}: {finding:#}");
        not_shown_without_fault(&out, name, fmu, fault);
    }
}

/// Asserts that a replay does not show a finding in the FMU without the fault. With the fault, the check has already repeated the
/// calls.
pub fn not_shown_without_fault(out: &Path, name: &str, fmu: &Path, fault: &str) {
    let output = replay(out, name, &["--fmu", &fmu.to_string_lossy()])
        .env("FMU_TRAITS", "none")
        .output()
        .expect("runs");
    let text = String::from_utf8_lossy(&output.stdout) + String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{name} is shown in the FMU without {fault}: {text}");
}

/// Returns the command that executes the calls of a finding of the report in a directory again.
pub fn replay(out: &Path, name: &str, options: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_fmu-check"));
    command.arg("replay").arg(out.join("report.json")).arg(name).args(options);
    command
}
