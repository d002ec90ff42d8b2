//! FMUs with one seeded fault each: every fault is found under the name of its rule. Without a fault, nothing is found.

#![cfg(unix)]

mod dynamics;
mod packing;
mod valve;

use std::path::{Path, PathBuf};
use std::process::Command;
use tempfile::TempDir;

/// Returns the model description without a fault.
fn description(fmi: u32) -> String {
    if fmi == 2 { include_str!("wagon2.xml") } else { include_str!("wagon3.xml") }.to_owned()
}

/// Returns the path of the compiled library. The environment variable `WAGON_FAULT` chooses the fault.
fn library(fmi: u32, macro_name: &str) -> PathBuf {
    packing::library("wagon", fmi, macro_name)
}

/// Packs the FMU with a changed description.
fn fmu(directory: &Path, fmi: u32, library: &Path, change: impl Fn(String) -> String) -> PathBuf {
    packing::pack(directory, ("wagon", fmi), &change(description(fmi)), library, &[])
}

/// Maximum duration of a check, which no check reaches: the machine may be busy.
const UNLIMITED: [&str; 2] = ["--time", "3600"];

/// Returns the command that checks an FMU.
fn check(fmu: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_fmu-check"));
    command.arg(fmu);
    command
}

/// Unpacks an FMU.
fn unpack(fmu: &Path, directory: &Path) {
    let file = std::fs::File::open(fmu).expect("the FMU");
    zip::ZipArchive::new(file).expect("a ZIP").extract(directory).expect("a directory");
}

/// Returns the names and observations of the findings in an FMU with a fault, and the report.
fn found(fmu: &Path, fault: &str, options: &[&str]) -> (Vec<(String, String)>, serde_json::Value) {
    let unlimited = if options.contains(&"--quick") { &[][..] } else { &UNLIMITED };
    let mut command = check(fmu);
    let output = command.args(options).args(unlimited).arg("--json").env("WAGON_FAULT", fault);
    let output = output.output().expect("runs");
    let report: serde_json::Value = serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|error| panic!("{error}: {}", String::from_utf8_lossy(&output.stderr)));
    let text =
        |finding: &serde_json::Value, name: &str| finding[name].as_str().unwrap_or_default().to_owned();
    let findings = report["findings"].as_array().expect("a list");
    (findings.iter().map(|finding| (text(finding, "name"), text(finding, "observed"))).collect(), report)
}

/// Asserts that a fault of the library, of its linking or of the description is found under its name.
fn caught(
    (fmi, fault, macro_name): (u32, &str, &str),
    topic: &str,
    name: &str,
    change: impl Fn(String) -> String,
) {
    let directory = TempDir::new().expect("a directory");
    let path = fmu(directory.path(), fmi, &library(fmi, macro_name), change);
    let out = directory.path().join("out");
    // A check waits for a call that hangs until the limit.
    let limit = if name.ends_with("hang") { "0.3" } else { "2" };
    // The duration is enough for the 50 repetitions that are evaluated, four times over.
    let options = ["--only", topic, "--no-shrink", "--limit", limit, "--repeat", "0.3"];
    let (found, report) = found(&path, fault, &[&options[..], &["--out", &out.to_string_lossy()]].concat());
    assert!(
        found.iter().any(|(other, _)| other == name),
        "{fault}{macro_name} is not found as {name}: {found:?} {}",
        report["unreached"]
    );
    let findings = report["findings"].as_array().expect("a list").iter();
    let proofs: Vec<_> = findings.filter(|finding| finding["name"] == name).map(|of| &of["proof"]).collect();
    assert!(proofs.iter().all(|proof| *proof == "shown" || *proof == "files"), "{fault}: {proofs:?}");
    if fault != "none" {
        let unpacked = directory.path().join("unpacked");
        unpack(&path, &unpacked);
        reproduced(&out, name, &unpacked, fault);
    }
}

/// Asserts that the program of a finding, which the check has run on the FMU with the fault, does not show it in the FMU without.
fn reproduced(out: &Path, name: &str, unpacked: &Path, fault: &str) {
    let program = out.join("repro");
    let source = out.join(format!("{name}.c"));
    // Only the program of a hang waits until its limit.
    let patience = if name.ends_with("hang") { "-DPATIENCE=5" } else { "-DPATIENCE=60" };
    let compiled = Command::new("cc")
        .args(["-w", patience, "-o"])
        .arg(&program)
        .arg(source)
        .args(["-ldl", "-lpthread", "-lm"])
        .status();
    assert!(compiled.expect("a C compiler").success(), "{name}.c");
    let output = Command::new(&program).arg(unpacked).env("WAGON_FAULT", "none").output().expect("runs");
    let text = String::from_utf8_lossy(&output.stdout) + String::from_utf8_lossy(&output.stderr);
    let text: String = text.chars().rev().take(2000).collect::<Vec<_>>().into_iter().rev().collect();
    assert_eq!(output.status.code(), Some(0), "{name} of {fault} in the FMU without it: {text}");
}

macro_rules! mutants {
    ($($fmi:literal $mutant:ident $topic:literal $name:literal;)+) => { $(
        #[test]
        fn $mutant() {
            caught(($fmi, stringify!($mutant), ""), $topic, $name, |text| text);
        }
    )+
        /// Names of the faults of this table.
        const FAULTS: &[&str] = &[$(stringify!($mutant)),+];
    };
}

mutants! {
    2 half_set "rejections" "rejections.changed";
    3 discard_changes "rejections" "rejections.discarded";
    2 step_rejected_halfway "rejections" "rejections.changed";
    2 getter_changes "results" "results.reading";
    3 reading_once "results" "results.reading";
    2 lossy_state "states" "states.restore-values";
    3 state_without_event "states" "states.restore";
    2 bytes_with_address "states" "states.fresh-process.crash";
    3 bytes_without_input "states" "states.serialized";
    2 restore_consumes "states" "states.twice";
    3 save_changes "states" "states.changed-by-saving";
    2 handle_not_reused "states" "states.several";
    3 freed_handle_stays "states" "states.free";
    3 adjoint_off "derivatives" "derivatives.adjoint-digits";
    2 directional_sign "derivatives" "derivatives.directional";
    3 directional_not_linear "derivatives" "derivatives.linear";
    2 derivative_changes "derivatives" "derivatives.changed";
    3 vector_swapped "derivatives" "derivatives.vectors";
    2 nominal_zero "derivatives" "derivatives.nominals";
    2 write_past "start_values" "arrays.written-beyond";
    3 write_before "start_values" "arrays.written-beyond";
    2 read_past "start_values" "arrays.read-beyond";
    3 write_const "start_values" "arrays.const";
    2 name_kept "results" "arrays.read-beyond";
    2 shared_static "results" "results.instances";
    3 racing_static "results" "results.threads";
    2 address_in_result "results" "results.process";
    3 unwritten_memory "results" "results.process";
    2 time_lags "results" "results.time";
    3 last_time_wrong "results" "results.time";
    2 leak_instance "resources" "resources.memory";
    3 leak_state "resources" "resources.memory";
    2 leak_step "resources" "resources.memory";
    3 file_left "resources" "resources.files";
    2 thread_left "resources" "resources.threads";
    3 rounding_changed "resources" "resources.settings";
    2 locale_changed "resources" "resources.settings";
    3 second_run_rejected "resources" "resources.cycles";
    2 reset_without_count "reset" "reset.incomplete";
    3 reset_keeps_parameter "reset" "reset.values";
    2 event_in_the_past "life_cycle" "life_cycle.next-event-time";
    3 events_without_end "life_cycle" "life_cycle.event-iteration";
    2 start_value "start_values" "start_values.start";
    3 set_ignored "start_values" "start_values.set";
    2 boolean_two "start_values" "start_values.boolean";
    3 output_unwritten "start_values" "start_values.unwritten";
    2 integer_out_of_range "start_values" "start_values.range";
    3 parameter_drifts "start_values" "start_values.fixed";
    2 string_latin1 "start_values" "start_values.utf8";
    2 version_wrong "functions" "functions.version";
    3 state_not_supported "functions" "functions.capability";
    2 status_unknown "results" "functions.status";
    3 free_null_crashes "life_cycle" "life_cycle.free-null.crash";
    2 terminate_rejected "life_cycle" "life_cycle.rejected";
    3 reset_rejected "reset" "reset.incomplete";
    2 get_after_end_rejected "life_cycle" "life_cycle.rejected";
    3 crash_amid "results" "results.crash";
    3 token_ignored "life_cycle" "life_cycle.token";
    2 category_unknown "rejections" "logs.category";
    3 log_latin1 "rejections" "logs.utf8";
    3 silent "rejections" "logs.silent";
    3 log_when_off "logs" "logs.off";
    2 endless_step "malformed" "malformed.times.hang";
    3 null_crashes "malformed" "malformed.null.crash";
    2 bytes_crash "malformed" "malformed.bytes.crash";
    3 reference_crashes "malformed" "malformed.references.crash";
    2 reference_exits "malformed" "malformed.references.exit";
    2 string_cut "start_values" "start_values.set";
    2 event_loses_input "start_values" "start_values.inputs";
    3 start_in_mode_ignored "start_values" "start_values.when";
    2 string_leaks "resources" "resources.memory";
    2 step_prints "resources" "logs.printed";
    3 reset_keeps_string "reset" "reset.values";
    2 directional_imprecise "derivatives" "derivatives.precision";
    3 directional_added "derivatives" "derivatives.directional";
    3 event_again_now "life_cycle" "life_cycle.next-event-time";
    2 event_moves_silently "life_cycle" "life_cycle.states-changed";
    2 last_step_rejected "life_cycle" "life_cycle.rejected";
    3 early_time_wrong "results" "results.early-return";
    3 early_unreported "results" "results.early-unreported";
    2 name_in_result "results" "results.name";
    3 reference_once "results" "results.repeated";
    3 start_time_ignored "results" "results.time";
    2 step_overshoots "results" "results.time";
    2 step_adds "results" "results.cut";
    3 lossy_when_late "states" "states.restore-values";
    2 name_gone "life_cycle" "arrays.read-beyond";
    3 stop_ignored "life_cycle" "life_cycle.stop-time";
    2 order_ignored "derivatives" "derivatives.order";
    3 pool_of_eight "life_cycle" "life_cycle.rejected";
    2 output_stale "results" "results.reading";
    2 unload_crashes "life_cycle" "life_cycle.unload.crash";
    3 exit_hangs "life_cycle" "life_cycle.unload.hang";
    3 early_read_wrong "start_values" "start_values.start";
    2 set_after_end "rejections" "rejections.tolerated";
    3 set_after_end_crashes "rejections" "rejections.crash";
    2 long_step_hangs "malformed" "malformed.times.hang";
    2 environment_lost "rejections" "logs.environment";
    2 environment_changed "resources" "resources.settings";
    3 mask_changed "resources" "resources.settings";
    2 limit_changed "resources" "resources.settings";
    3 log_file_left "resources" "resources.settings";
    2 slope_off "results" "results.interfaces";
    3 counts_twice "results" "results.interfaces";
}

#[test]
fn function_missing() {
    caught((2, "none", "WITHOUT_NOMINALS"), "functions", "functions.missing", |text| text);
}

/// The linkers of other platforms reject the library.
#[cfg(target_os = "linux")]
#[test]
fn symbol_missing() {
    caught((2, "none", "SYMBOL_MISSING"), "functions", "package.symbols", |text| text);
}

/// Faults of the description: FMI version, name of the finding, the string that is replaced, and the replacement.
#[rustfmt::skip]
const DESCRIPTIONS: [(u32, &str, &str, &str); 13] = [
    (2, "description.combination", r#""parameter" variability="fixed""#, r#""parameter" variability="discrete""#),
    (3, "description.combination", r#""input" variability"#, r#""input" initial="calculated" variability"#),
    (3, "description.combination", r#""output" variability="discrete""#, r#""output" variability="continuous""#),
    (2, "description.encoding", r#"encoding="UTF-8""#, r#"encoding="ISO-8859-1""#),
    (2, "dependencies.missing", r#"index="9" dependencies="4 5""#, r#"index="9" dependencies="5""#),
    (3, "dependencies.missing", r#"dependencies="4 5 6""#, r#"dependencies="4 6""#),
    (3, "dependencies.initial", r#""9" dependencies="4""#, r#""9" dependencies="""#),
    (2, "description.units", r#"<Real start="2""#, r#"<Real unit="stone" start="2""#),
    (2, "description.structure", r#"<Unknown index="9" dependencies="4 5"/>"#, ""),
    (2, "description.start", r#"<Real start="2"/>"#, "<Real/>"),
    (2, "description.range", r#"<Real start="2""#, r#"<Real min="3" start="2""#),
    (2, "description.types", r#"<Real start="2""#, r#"<Real declaredType="Weight" start="2""#),
    (2, "description.names", r#"name="spring""#, r#"name="mass""#),
];

#[test]
fn descriptions() {
    for (fmi, name, before, after) in DESCRIPTIONS {
        let (topic, _) = name.split_once('.').expect("a topic");
        caught((fmi, "none", ""), topic, name, |text| {
            assert!(text.contains(before), "{before}");
            text.replacen(before, after, 1)
        });
    }
}

/// Faults that attack the processes around the FMU, with the name of the finding.
const ATTACKS: [(u32, &str, &str); 8] = [
    (2, "forks", "resources.processes"),
    (3, "daemon_left", "resources.processes"),
    (2, "forks_without_end", "resources.processes"),
    (3, "duplicates_itself", "resources.processes"),
    (2, "kills_group", "life_cycle.crash"),
    (3, "kills_parent", "life_cycle.crash"),
    (2, "kills_all", "life_cycle.crash"),
    (3, "stops_parent", "life_cycle.crash"),
];

/// Returns the processes whose environment contains this mark.
#[cfg(target_os = "linux")]
fn marked(mark: &str) -> usize {
    let processes = std::fs::read_dir("/proc").expect("the processes").flatten();
    let environments = processes.filter_map(|entry| std::fs::read(entry.path().join("environ")).ok());
    environments.filter(|environment| String::from_utf8_lossy(environment).contains(mark)).count()
}

/// Returns the command of a check with its temporary files in a directory and a mark in the environment of its processes.
#[cfg(target_os = "linux")]
fn contained(directory: &Path, fmi: u32, fault: &str) -> Command {
    let path = fmu(directory, fmi, &library(fmi, ""), |text| text);
    let scratch = directory.join("scratch");
    std::fs::create_dir_all(&scratch).expect("a directory");
    let mut command = check(&path);
    command.args(UNLIMITED).args(["--json", "--no-shrink", "--repeat", "0.02"]);
    command.env("WAGON_FAULT", fault).env("TMPDIR", scratch).env("WAGON_MARK", directory);
    command
}

/// Asserts that FMUs that start processes or send signals to other processes have a finding, that no process or file remains, and
/// that the caller of the check continues.
#[cfg(target_os = "linux")]
#[test]
fn attacks_are_contained() {
    for (fmi, fault, name) in ATTACKS {
        let directory = TempDir::new().expect("a directory");
        let mut command = contained(directory.path(), fmi, fault);
        let output = command.args(["--only", "resources", "--limit", "0.5"]).output().expect("runs");
        let text = String::from_utf8_lossy(&output.stdout);
        assert!(text.contains(&format!("\"name\": \"{name}\"")), "{fault}: {text} {output:?}");
        assert_eq!(output.status.code(), Some(1), "{fault}");
        assert_eq!(marked(&directory.path().to_string_lossy()), 0, "{fault}");
        assert_eq!(
            std::fs::read_dir(directory.path().join("scratch")).expect("a directory").count(),
            0,
            "{fault}"
        );
    }
}

/// Asserts that no process and no file remains, regardless of the signal that ends the check, and that the report is complete as far as
/// the check got.
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
        // The checker, its server and the process that hangs.
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

/// Waits for a condition, without a limit because the machine may be busy. A test that waits forever is ended by its runner.
#[cfg(target_os = "linux")]
fn wait_until(holds: impl Fn() -> bool) {
    while !holds() {
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
}

/// Asserts that every report lists the parts that were not checked, which fail the check unless an option allows them by name.
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
        (2, Box::new(elsewhere), "model-exchange", "there is no cart"),
        (3, Box::new(scheduled), "scheduled-execution", "Scheduled Execution"),
        (3, Box::new(neither), both, "there is no cart"),
    ];
    for (fmi, change, names, why) in cases {
        let directory = TempDir::new().expect("a directory");
        let path = fmu(directory.path(), fmi, &library(fmi, ""), change);
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
                let text =
                    if index == 0 { text } else { std::fs::read_to_string(out.join(text)).expect("it") };
                assert!(text.contains(name) && text.contains(why), "{name}: {text}");
            }
        }
        assert_eq!(run(&["--allow-unchecked", names]).status.code(), Some(0), "{names}");
    }
    // A hang is a violation, after which the interface type is not checked.
    let directory = TempDir::new().expect("a directory");
    let path = fmu(directory.path(), 2, &library(2, ""), |text| text);
    let (found, report) = found(&path, "make_hangs", &["--only", "states", "--no-shrink", "--limit", "0.3"]);
    assert!(found.iter().any(|(name, _)| name == "life_cycle.hang"), "{found:?}");
    assert_eq!(report["findings"][0]["severity"], "violation");
    let unchecked = report["unreached"].as_array().expect("a list").iter();
    let names: Vec<_> = unchecked.filter(|of| of["allowed"] == false).map(|of| of["name"].clone()).collect();
    assert_eq!(names, ["co-simulation", "model-exchange"]);
}

/// Asserts that a finding that a baseline accepts does not fail in any report, and that one with another observation does.
#[test]
fn a_baseline_accepts_with_a_reason() {
    let directory = TempDir::new().expect("a directory");
    let path = fmu(directory.path(), 2, &library(2, ""), |text| text);
    let (baseline, out) = (directory.path().join("baseline.txt"), directory.path().join("out"));
    for (line, status) in [("start_values.start: known", 0), ("start_values.start \"mass\": known", 1)] {
        std::fs::write(&baseline, line).expect("a file");
        let mut command = check(&path);
        command.args(UNLIMITED).args(["--only", "start_values", "--no-shrink", "--baseline"]).arg(&baseline);
        let output = command.arg("--out").arg(&out).env("WAGON_FAULT", "start_value").output().expect("runs");
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
        assert_eq!((&report["schema"], &report["status"]), (&1.into(), &status.into()));
        assert_eq!(String::from_utf8_lossy(&output.stdout).contains("1 accepted"), status == 0);
    }
}

/// Asserts that a quick check executes few call sequences, so that its 30 seconds are enough, that it names the topics that it does
/// not check, and that it passes. On a busy machine, the time may be over before all topics are checked, which the report states.
#[test]
fn a_quick_check_is_quick() {
    let directory = TempDir::new().expect("a directory");
    let path = fmu(directory.path(), 2, &library(2, ""), |text| text);
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

/// Asserts that a check of 100,000 variables needs at most 1 GB, and processor time that is proportional to their number. The limit
/// of processor time is ten times what the check needs; work that grows with the square of the number needs a thousand times as
/// much.
#[cfg(target_os = "linux")]
#[test]
fn many_variables_take_little_time_and_memory() {
    let directory = TempDir::new().expect("a directory");
    let path = fmu(directory.path(), 2, &library(2, ""), |text| {
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

/// Asserts that an FMU above the maximum size is not unpacked.
#[test]
fn unpacking_has_a_limit() {
    let directory = TempDir::new().expect("a directory");
    let path = fmu(directory.path(), 2, &library(2, ""), |text| text + &" ".repeat(3 << 20));
    let run = |megabytes: &str| {
        check(&path).args(["--only", "description", "--unpacked", megabytes]).output().expect("runs")
    };
    let output = run("2");
    let text = String::from_utf8_lossy(&output.stderr);
    assert!(text.contains("has more than 2 MB when it is unpacked"), "{text}");
    assert_eq!(output.status.code(), Some(2));
    assert_eq!(run("4").status.code(), Some(0));
}

/// Asserts that every fault of the source is tested, and that the documentation has the number of faults.
#[test]
fn no_fault_is_forgotten() {
    let read = |path: &str| {
        std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(path)).expect("a file")
    };
    let source = read("tests/mutants/wagon.c");
    let faults = source.split("IS(").skip(1).filter_map(|rest| rest.split_once(')')).map(|(name, _)| name);
    let mut faults: Vec<&str> = faults.filter(|name| !["name", "manners"].contains(name)).collect();
    let mut tested = FAULTS.to_vec();
    tested.extend(ATTACKS.iter().map(|(_, name, _)| *name));
    tested.push("make_hangs");
    faults.sort_unstable();
    faults.dedup();
    tested.sort_unstable();
    assert_eq!(faults, tested);
    let page = read("../../docs/checking.md").split_whitespace().collect::<Vec<_>>().join(" ");
    let count = format!(
        "{} faults into its library, one at a time, and {} more into its description",
        tested.len() + ["SYMBOL_MISSING", "WITHOUT_NOMINALS"].len(),
        DESCRIPTIONS.len()
    );
    assert!(page.contains(&count), "{count}");
}

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

/// Asserts that an FMU of a draft of FMI 3.0 is not checked by the rules of FMI 3.0.
#[test]
fn drafts_are_not_checked() {
    let directory = TempDir::new().expect("a directory");
    let beta = |text: String| text.replace("fmiVersion=\"3.0\"", "fmiVersion=\"3.0-beta.3\"");
    let path = fmu(directory.path(), 3, &library(3, ""), beta);
    let output = check(&path).output().expect("runs");
    let text = String::from_utf8_lossy(&output.stderr);
    assert!(text.contains("3.0-beta.3") && text.contains("a draft of FMI 3.0"), "{text}");
    assert_eq!(output.status.code(), Some(2));
}

/// Asserts that the README has the output of a check: a wagon that rejects the step to the stop time.
#[test]
fn the_readme_shows_real_output() {
    let directory = TempDir::new().expect("a directory");
    let path = fmu(directory.path(), 2, &library(2, ""), |text| text);
    let mut command = check(&path);
    command.args(UNLIMITED).args(["--only", "life_cycle"]).env("WAGON_FAULT", "last_step_rejected");
    let output = command.output().expect("runs");
    let output = String::from_utf8_lossy(&output.stdout).replace(&*directory.path().to_string_lossy(), "");
    let printed: String = output
        .lines()
        .take_while(|line| !line.starts_with("not checked"))
        .map(|line| format!("{}\n", line.trim_start_matches('/').trim_end()))
        .collect();
    let readme = include_str!("../../README.md");
    assert!(printed.lines().count() == 3 && readme.contains(&printed), "{printed}");
}

/// Asserts that a shortened call sequence has few calls and that its program reproduces the fault.
#[test]
fn programs_show_it() {
    let directory = TempDir::new().expect("a directory");
    for (mutant, topic, name, most) in [
        ("lossy_state", "states", "states.restore-values", 14),
        ("write_past", "start_values", "arrays.written-beyond", 6),
        ("bytes_with_address", "states", "states.fresh-process.crash", 14),
    ] {
        let path = fmu(directory.path(), 2, &library(2, ""), |text| text);
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
        let unpacked = directory.path().join("unpacked");
        unpack(&path, &unpacked);
        reproduced(&out, name, &unpacked, mutant);
    }
}
