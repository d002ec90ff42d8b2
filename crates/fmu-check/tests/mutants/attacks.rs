//! FMUs that start processes, send signals or change other processes, and checks that are interrupted: no process and no file may remain.

use super::wagon::{UNLIMITED, check, fmu, library};
use std::path::Path;
use std::process::Command;
use tempfile::TempDir;

/// Faults that start processes, send signals to other processes or change them, or pretend that all calls have returned: FMI version,
/// fault, name of the finding, and a part of its observation.
pub const ATTACKS: [(u32, &str, &str, &str); 16] = [
    (2, "forks", "resources.processes", ""),
    (3, "daemon_left", "resources.processes", ""),
    (2, "forks_without_end", "resources.processes", ""),
    (3, "duplicates_itself", "resources.processes", ""),
    (2, "kills_group", "life_cycle.crash", "SIGKILL"),
    (3, "kills_parent", "life_cycle.crash", "SIGSYS"),
    (2, "kills_all", "life_cycle.crash", "SIGSYS"),
    (3, "stops_parent", "life_cycle.crash", "SIGSYS"),
    (2, "limits_parent", "life_cycle.crash", "SIGSYS"),
    (3, "slows_parent", "life_cycle.crash", "SIGSYS"),
    (2, "moves_parent", "life_cycle.crash", "SIGSYS"),
    (3, "traces_parent", "life_cycle.crash", "SIGSYS"),
    (2, "owns_file_of_parent", "life_cycle.crash", "SIGSYS"),
    (3, "opens_parent", "life_cycle.crash", "SIGABRT"),
    (2, "kills_with_32_bits", "life_cycle.crash", "SIGSYS"),
    (3, "forges_results", "life_cycle.exit", "exit status 96"),
];

/// Returns the number of processes whose environment contains this mark.
#[cfg(target_os = "linux")]
fn marked(mark: &str) -> usize {
    let processes = std::fs::read_dir("/proc").expect("the processes").flatten();
    let environments = processes.filter_map(|entry| std::fs::read(entry.path().join("environ")).ok());
    environments.filter(|environment| String::from_utf8_lossy(environment).contains(mark)).count()
}

/// Returns the command that checks the wagon with a fault. Its temporary files are in `directory`, and the environment of its
/// processes contains the path of `directory` as a mark.
#[cfg(target_os = "linux")]
fn contained(directory: &Path, fmi: u32, fault: &str) -> Command {
    let path = fmu(directory, fmi, &library(&[]), |text| text);
    let scratch = directory.join("scratch");
    std::fs::create_dir_all(&scratch).expect("a directory");
    let mut command = check(&path);
    command.args(UNLIMITED).args(["--json", "--no-shrink", "--repeat", "0.02"]);
    command.env("FMU_TRAITS", fault).env("TMPDIR", scratch).env("WAGON_MARK", directory);
    command
}

/// Asserts that FMUs that start processes or send signals to other processes have a finding, that no process or file remains, and
/// that the caller of the check continues.
#[cfg(target_os = "linux")]
#[test]
fn attacks_are_contained() {
    for (fmi, fault, name, observed) in ATTACKS {
        let directory = TempDir::new().expect("a directory");
        let mut command = contained(directory.path(), fmi, fault);
        let output = command.args(["--only", "resources", "--limit", "0.5"]).output().expect("runs");
        let text = String::from_utf8_lossy(&output.stdout);
        assert!(text.contains(&format!("\"name\": \"{name}\"")), "{fault}: {text} {output:?}");
        assert!(text.contains(observed), "{fault}: {text}");
        assert_eq!(output.status.code(), Some(1), "{fault}");
        assert_eq!(marked(&directory.path().to_string_lossy()), 0, "{fault}");
        assert_eq!(
            std::fs::read_dir(directory.path().join("scratch")).expect("a directory").count(),
            0,
            "{fault}"
        );
    }
}

/// Asserts that no process and no file remains, regardless of the signal that ends the check. Unless the check was killed, the
/// report must list what was interrupted.
#[cfg(target_os = "linux")]
#[test]
fn interrupts_leave_nothing() {
    for signal in ["INT", "TERM", "KILL"] {
        let directory = TempDir::new().expect("a directory");
        let scratch = directory.path().join("scratch");
        let mut command = contained(directory.path(), 2, "make_hangs");
        let out = directory.path().join("out");
        let mut child = command
            .args(["--limit", "60"])
            .arg("--out")
            .arg(&out)
            .stdout(std::process::Stdio::null())
            .spawn()
            .expect("runs");
        let mark = directory.path().to_string_lossy().into_owned();
        // There are three: the checker, its server and the process that hangs.
        wait_until(|| marked(&mark) >= 3);
        let sent = Command::new("kill").args(["-s", signal, &child.id().to_string()]).status();
        assert!(sent.expect("kill").success());
        let status = child.wait().expect("it ends");
        if signal != "KILL" {
            assert_eq!(status.code(), Some(130), "{signal}");
            let report = std::fs::read(out.join("report.json")).expect("the report");
            let report: serde_json::Value = serde_json::from_slice(&report).expect("JSON");
            let unchecked = report["unreached"].as_array().expect("a list").iter();
            let interrupted = unchecked.filter(|of| of["why"] == "interrupted").count();
            assert!(interrupted >= 2 && report["status"] == 2, "{signal}: {report}");
            assert_eq!(marked(&mark), 0, "{signal}");
            assert_eq!(std::fs::read_dir(&scratch).expect("a directory").count(), 0, "{signal}");
        }
        wait_until(|| marked(&mark) == 0 && std::fs::read_dir(&scratch).is_ok_and(|of| of.count() == 0));
    }
}

/// Asserts that a check that is killed leaves no violation in its report, because its calls have not been repeated.
#[cfg(target_os = "linux")]
#[test]
fn an_interim_report_has_no_unproven_violation() {
    let directory = TempDir::new().expect("a directory");
    let out = directory.path().join("out");
    let mut command = contained(directory.path(), 2, "start_value");
    let mut child = command.arg("--out").arg(&out).stdout(std::process::Stdio::null()).spawn().expect("runs");
    let interim = || -> Option<serde_json::Value> {
        let report: serde_json::Value =
            serde_json::from_slice(&std::fs::read(out.join("report.json")).ok()?).expect("JSON");
        let findings = report["findings"].as_array().expect("a list");
        findings.iter().find(|finding| finding["name"] == "start_values.start").cloned()
    };
    wait_until(|| interim().is_some());
    let finding = interim().expect("a finding");
    child.kill().expect("it runs");
    child.wait().expect("it ends");
    assert_eq!(finding["severity"], "note", "{finding:#}");
    assert_eq!(finding["proof"]["notrun"], "the check had not ended", "{finding:#}");
}

/// Waits for a condition, without a limit because the machine may be busy. The test runner ends a test that waits forever.
#[cfg(target_os = "linux")]
fn wait_until(holds: impl Fn() -> bool) {
    while !holds() {
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
}
