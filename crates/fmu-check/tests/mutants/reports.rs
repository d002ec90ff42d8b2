//! Reports, options and exit statuses of checks.

use super::wagon::{UNLIMITED, check, fmu, found, library, not_shown_without_fault, replay};
use std::path::Path;
use std::process::Command;
use tempfile::TempDir;

/// Asserts that the output and the reports as JSON, JUnit and HTML list the interface types that were not checked, and that the
/// check fails unless an option names them.
#[test]
fn nothing_passes_unchecked() {
    let both = "co-simulation,model-exchange";
    let tool = |text: String| text.replace("<CoSimulation", "<CoSimulation needsExecutionTool=\"true\"");
    let elsewhere = |text: String| {
        text.replace("<ModelExchange modelIdentifier=\"wagon", "<ModelExchange modelIdentifier=\"cart")
    };
    let scheduled = |text: String| text.replace("<CoSimulation", "<ScheduledExecution/><CoSimulation");
    let neither = |text: String| text.replace("modelIdentifier=\"wagon", "modelIdentifier=\"cart");
    type Change = Box<dyn Fn(String) -> String>;
    let cases: [(u32, Change, &str, &str); 4] = [
        (2, Box::new(tool), "co-simulation", "needsExecutionTool"),
        (2, Box::new(elsewhere), "model-exchange", "has no library for this platform"),
        (3, Box::new(scheduled), "scheduled-execution", "Scheduled Execution"),
        (3, Box::new(neither), both, "has no library for this platform"),
    ];
    for (fmi, change, names, why) in cases {
        let directory = TempDir::new().expect("a directory");
        let path = fmu(directory.path(), fmi, &library(&[]), change);
        let out = directory.path().join("out");
        let run = |options: &[&str]| {
            check(&path)
                .args(UNLIMITED)
                .args(["--only", "functions", "--out"])
                .arg(&out)
                .args(options)
                .output()
                .expect("runs")
        };
        let output = run(&[]);
        assert_eq!(output.status.code(), Some(2), "{names}: {output:?}");
        for name in names.split(',') {
            let printed = String::from_utf8_lossy(&output.stdout).into_owned();
            let all = [printed, "report.json".into(), "junit.xml".into(), "report.html".into()];
            for (index, text) in all.into_iter().enumerate() {
                let text = if index == 0 {
                    text
                } else {
                    std::fs::read_to_string(out.join(text)).expect("a report")
                };
                assert!(text.contains(name) && text.contains(why), "{name}: {text}");
            }
        }
        assert_eq!(run(&["--allow-unchecked", names]).status.code(), Some(0), "{names}");
    }
    // A hang is a violation, after which the interface type is not checked.
    let directory = TempDir::new().expect("a directory");
    let path = fmu(directory.path(), 2, &library(&[]), |text| text);
    let (found, report) = found(&path, "make_hangs", &["--only", "states", "--no-shrink", "--limit", "0.3"]);
    assert!(found.iter().any(|(name, _)| name == "life_cycle.hang"), "{found:?}");
    assert_eq!(report["findings"][0]["severity"], "violation");
    let unchecked = report["unreached"].as_array().expect("a list").iter();
    let names: Vec<_> = unchecked.filter(|of| of["allowed"] == false).map(|of| of["name"].clone()).collect();
    assert_eq!(names, ["co-simulation", "model-exchange"]);
}

/// Asserts that a finding does not fail the check or its JUnit test if the baseline accepts it, but fails if the baseline accepts
/// only another observation.
#[test]
fn a_baseline_accepts_with_a_reason() {
    let directory = TempDir::new().expect("a directory");
    let path = fmu(directory.path(), 2, &library(&[]), |text| text);
    let (baseline, out) = (directory.path().join("baseline.txt"), directory.path().join("out"));
    for (line, status) in [("start_values.start: known", 0), ("start_values.start \"mass\": known", 1)] {
        std::fs::write(&baseline, line).expect("a file");
        let mut command = check(&path);
        command.args(UNLIMITED).args(["--only", "start_values", "--no-shrink", "--baseline"]).arg(&baseline);
        let output = command.arg("--out").arg(&out).env("FMU_TRAITS", "start_value").output().expect("runs");
        assert_eq!(output.status.code(), Some(status), "{line}: {output:?}");
        let read = |name: &str| std::fs::read_to_string(out.join(name)).expect(name);
        assert_eq!(read("junit.xml").contains("<failure"), status == 1, "{line}");
        let sarif: serde_json::Value = serde_json::from_str(&read("report.sarif")).expect("JSON");
        let result = &sarif["runs"][0]["results"][0];
        assert_eq!(
            (result["ruleId"].as_str(), result["level"].as_str()),
            (Some("start_values.start"), Some("error"))
        );
        assert_eq!(result["suppressions"].is_array(), status == 0, "{line}");
        let report: serde_json::Value = serde_json::from_str(&read("report.json")).expect("JSON");
        assert_eq!((&report["schema"], &report["status"]), (&2.into(), &status.into()));
        let text = String::from_utf8_lossy(&output.stdout);
        assert_eq!(text.contains("1 accepted"), status == 0);
        assert_eq!(text.contains("baseline: start_values.start matches no finding"), status == 1);
    }
}

/// Asserts that a quick check executes few enough call sequences for its 30 seconds, that it reports the topics that it leaves
/// out, and that it passes. On a busy machine, the time may be over before all topics are checked; then the report says so.
#[test]
fn a_quick_check_is_quick() {
    let directory = TempDir::new().expect("a directory");
    let path = fmu(directory.path(), 2, &library(&[]), |text| text);
    let (_, report) = found(&path, "none", &["--quick"]);
    let executed = report["sequences"].as_u64().expect("a number");
    assert!(executed <= 400, "{executed} call sequences");
    let unchecked = report["unreached"].as_array().expect("a list");
    let (late, left_out): (Vec<_>, Vec<_>) =
        unchecked.iter().partition(|of| of["why"] == "the time was over");
    let names: Vec<_> = left_out.iter().map(|of| (of["name"].clone(), of["allowed"].clone())).collect();
    assert_eq!(names, [("resources".into(), true.into()), ("malformed".into(), true.into())]);
    assert_eq!(report["status"], if late.is_empty() { 0 } else { 2 });
}

/// Asserts that a check of 100,000 variables needs at most 1 GB of memory, and that its processor time does not grow with the
/// square of their number. The limit is ten times the processor time that the check needs, while quadratic work would need a
/// thousand times that time.
#[cfg(target_os = "linux")]
#[test]
fn many_variables_take_little_time_and_memory() {
    let directory = TempDir::new().expect("a directory");
    let path = fmu(directory.path(), 2, &library(&[]), |text| {
        let alias = |index| {
            let name = format!("name=\"y{index}\" valueReference=\"9\" variability=\"continuous\"");
            format!("<ScalarVariable {name}><Real/></ScalarVariable>\n")
        };
        let aliases: String = (0..100_000).map(alias).collect();
        text.replace("</ModelVariables>", &(aliases + "</ModelVariables>"))
    });
    let mut command = Command::new("sh");
    // 1 GB of address space and 60 seconds of processor time for each process.
    command.args([
        "-c",
        "ulimit -v 1000000 && ulimit -t 60 && exec \"$0\" \"$@\"",
        env!("CARGO_BIN_EXE_fmu-check"),
    ]);
    let topics = "description,package,functions,states,derivatives,dependencies,reset,logs";
    let command = command.arg(&path).args(UNLIMITED).args(["--json", "--no-shrink", "--only", topics]);
    let output = command.output().expect("runs");
    let report: serde_json::Value = serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|error| panic!("{error}: {}", String::from_utf8_lossy(&output.stderr)));
    assert_eq!(report["variables"][0], 100_014);
    assert_eq!(report["interfaces"].as_array().map(Vec::len), Some(2));
    let names = report["findings"].as_array().expect("a list").iter().map(|finding| &finding["name"]);
    assert!(names.clone().all(|name| name == "package.glibc"), "{:?}", names.collect::<Vec<_>>());
}

/// Asserts that an FMU is not unpacked if it exceeds the maximum size.
#[test]
fn unpacking_has_a_limit() {
    let directory = TempDir::new().expect("a directory");
    let path = fmu(directory.path(), 2, &library(&[]), |text| text + &" ".repeat(3 << 20));
    let run = |megabytes: &str| {
        check(&path).args(["--only", "description", "--unpacked", megabytes]).output().expect("runs")
    };
    let output = run("2");
    let text = String::from_utf8_lossy(&output.stderr);
    assert!(text.contains("has more than 2 MB when it is unpacked"), "{text}");
    assert!(text.contains("raise the limit with --unpacked MB"), "{text}");
    assert_eq!(output.status.code(), Some(2));
    assert_eq!(run("4").status.code(), Some(0));
}

/// Asserts that an FMU of a draft of FMI 3.0 is rejected instead of being checked by the rules of FMI 3.0.
#[test]
fn drafts_are_not_checked() {
    let directory = TempDir::new().expect("a directory");
    let beta = |text: String| text.replace("fmiVersion=\"3.0\"", "fmiVersion=\"3.0-beta.3\"");
    let path = fmu(directory.path(), 3, &library(&[]), beta);
    let output = check(&path).output().expect("runs");
    let text = String::from_utf8_lossy(&output.stderr);
    assert!(text.contains("3.0-beta.3") && text.contains("a draft of FMI 3.0"), "{text}");
    assert_eq!(output.status.code(), Some(2));
}

/// Asserts that the README shows the beginning of the output of this check, in which the wagon rejects the step to the stop time, and
/// the output of a replay.
#[test]
fn the_readme_shows_real_output() {
    let directory = TempDir::new().expect("a directory");
    let path = fmu(directory.path(), 2, &library(&[]), |text| text);
    let mut command = check(Path::new(path.file_name().expect("a name")));
    command.args(UNLIMITED).args(["--only", "life_cycle", "--out", "report"]);
    command.current_dir(&directory).env("FMU_TRAITS", "last_step_rejected");
    let output = command.output().expect("runs");
    let output = String::from_utf8_lossy(&output.stdout).into_owned();
    let lines = output.lines().take_while(|line| !line.starts_with("not checked"));
    let printed: String = lines.map(|line| format!("{}\n", line.trim_end())).collect();
    let readme = include_str!("../../README.md");
    assert!(printed.lines().count() == 3 && readme.contains(&printed), "{printed}");
    let mut command = replay(Path::new("report"), "1", &[]);
    let output = command.current_dir(&directory).env("FMU_TRAITS", "last_step_rejected").output();
    let printed = String::from_utf8_lossy(&output.expect("runs").stdout).into_owned();
    assert!(printed.contains("The finding shows.") && readme.contains(&printed), "{printed}");
}

/// Asserts that a shortened call sequence has few calls, that the reports contain the finding, and that every replay of its calls shows
/// it, also one that waits for a debugger. A replay on the FMU without the fault must not show it.
#[test]
fn calls_show_it() {
    let directory = TempDir::new().expect("a directory");
    for (mutant, topic, name, most) in [
        ("lossy_state", "states", "states.restore-values", 14),
        ("write_past", "start_values", "arrays.written-beyond", 6),
        ("bytes_with_address", "states", "states.fresh-process.crash", 14),
    ] {
        let path = fmu(directory.path(), 2, &library(&[]), |text| text);
        let out = directory.path().join("out");
        let (_, report) = found(&path, mutant, &["--only", topic, "--out", &out.to_string_lossy()]);
        let finding =
            report["findings"].as_array().and_then(|all| all.iter().find(|finding| finding["name"] == name));
        let finding = finding.unwrap_or_else(|| panic!("{mutant}: {report:#}"));
        let steps = finding["steps"][1].as_u64().expect("a number");
        assert!(steps <= most, "{mutant}: {steps} calls");
        for file in ["report.html", "report.json", "junit.xml"] {
            assert!(std::fs::read_to_string(out.join(file)).expect(file).contains(name), "{file}");
        }
        not_shown_without_fault(&out, name, &path, mutant);
        let shown = |options: &[&str]| {
            let output = replay(&out, name, options).env("FMU_TRAITS", mutant).output().expect("runs");
            assert_eq!(output.status.code(), Some(1), "{mutant}: {output:?}");
            [output.stdout, output.stderr].map(|text| String::from_utf8_lossy(&text).into_owned())
        };
        let [printed, _] = shown(&["--times", "2"]);
        assert!(
            printed.contains("Repetition 2: shown") && printed.contains(" c = fmi2Instantiate("),
            "{printed}"
        );
        let last = report["findings"][0]["calls"].as_array().and_then(|calls| calls.last()?.as_str());
        assert!(last.is_some_and(|last| printed.contains(last)), "{printed}");
        let [_, waits] = shown(&["--break"]);
        assert!(waits.contains(" waits before ") && waits.contains(" -p "), "{waits}");
    }
    // An FMU without these calls must not seem to have no fault.
    let elsewhere = |text: String| {
        text.replace("<CoSimulation modelIdentifier=\"wagon", "<CoSimulation modelIdentifier=\"cart")
    };
    for (fmi, why) in [(2, "has no library for this platform"), (3, "is not a call of FMI 3.0")] {
        let other = TempDir::new().expect("a directory");
        let path = fmu(other.path(), fmi, &library(&[]), elsewhere);
        let options = ["--fmu", &path.to_string_lossy()];
        let output = replay(&directory.path().join("out"), "1", &options).output().expect("runs");
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(2) && text.contains(why), "{text}");
    }
    // Calls that were cut off, or have no time at all, do not show that the fault is repaired.
    let file = directory.path().join("out/report.json");
    let report = std::fs::read_to_string(&file).expect("the report");
    let mut report: serde_json::Value = serde_json::from_str(&report).expect("JSON");
    let limit = report["findings"][0]["replay"]["limit"].as_f64().expect("a number");
    for (limit, option, why) in
        [(limit, "1e-6", "have not ended in 0.000001 s"), (-1.0, "9", "the report is damaged: limit is -1 s")]
    {
        report["findings"][0]["replay"]["limit"] = limit.into();
        std::fs::write(&file, report.to_string()).expect("a file");
        let output = replay(&directory.path().join("out"), "1", &["--limit", option]).output().expect("runs");
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(2) && text.contains(why), "{text}");
    }
}

/// Asserts that parameters are read after Initialization Mode, because FMI 2.0 does not let importers read them in it.
#[test]
fn parameters_of_fmi2_are_read_after_the_initialization() {
    let directory = TempDir::new().expect("a directory");
    let path = fmu(directory.path(), 2, &library(&[]), |text| text);
    let (_, report) = found(&path, "set_ignored", &["--only", "start_values", "--no-shrink"]);
    let finding =
        report["findings"].as_array().and_then(|all| all.iter().find(|of| of["name"] == "start_values.set"));
    let calls = finding.expect("a finding")["calls"].as_array().expect("a list");
    let at = |name: &str| calls.iter().position(|call| call.as_str().is_some_and(|call| call.contains(name)));
    assert!(at("fmi2ExitInitializationMode") < at("fmi2GetReal"), "{calls:#?}");
}

/// Asserts that a replay fails with a message if the report has no such finding, if it has no calls, or if it is from another
/// version.
#[test]
fn a_replay_states_why_it_is_not_possible() {
    let directory = TempDir::new().expect("a directory");
    let path = fmu(directory.path(), 2, &library(&[]), |text| text.replace("UTF-8", "ISO-8859-1"));
    let out = directory.path().join("out");
    found(&path, "none", &["--only", "description", "--out", &out.to_string_lossy()]);
    let report = std::fs::read_to_string(out.join("report.json")).expect("the report");
    let fails = |finding: &str, why: &str| {
        let output = replay(&out, finding, &[]).output().expect("runs");
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(2) && text.contains(why), "{text}");
    };
    fails("7", "its findings are description.encoding");
    fails("1", "concerns the files of the FMU");
    std::fs::write(out.join("report.json"), report.replace("\"schema\": 2", "\"schema\": 1"))
        .expect("a file");
    fails("1", "its schema is 1");
}
