//! Tests fmu-check with FMUs that have seeded faults: it must find each fault under the name of its rule, and nothing but notes
//! in an FMU without a fault.

#![cfg(unix)]

mod attacks;
mod correct;
mod dynamics;
mod reports;
mod valve;
mod wagon;

use attacks::ATTACKS;
use fmu_test_kit::c_models;
use std::collections::BTreeSet;
use tempfile::TempDir;
use wagon::{fmu, found, library, not_shown_without_fault};

/// Asserts that a fault of the library, of its linking or of the description is found under this name, and that the calls of the
/// finding show it again. They must not show it in the FMU without the fault, and the report must write repeated calls once.
fn caught(
    (fmi, fault, flags): (u32, &str, &[&str]),
    topic: &str,
    name: &str,
    change: impl Fn(String) -> String,
) {
    let directory = TempDir::new().expect("a directory");
    let path = fmu(directory.path(), fmi, &library(flags), change);
    let out = directory.path().join("out");
    // A hanging call sequence always runs until the limit, so a short limit saves time.
    let limit = if name.ends_with("hang") { "0.3" } else { "2" };
    // Repetitions end after 0.3 s, or after four times as long if they are fewer than the 50 that an evaluation needs.
    let options = ["--only", topic, "--no-shrink", "--limit", limit, "--repeat", "0.3"];
    let (found, report) = found(&path, fault, &[&options[..], &["--out", &out.to_string_lossy()]].concat());
    assert!(
        found.iter().any(|(other, _)| other == name),
        "{fault} {flags:?} is not found as {name}: {found:?} {}",
        report["unreached"]
    );
    let findings = report["findings"].as_array().expect("a list").iter();
    let proofs: Vec<_> = findings.filter(|finding| finding["name"] == name).map(|of| &of["proof"]).collect();
    assert!(proofs.iter().all(|proof| *proof == "shown" || *proof == "files"), "{fault}: {proofs:?}");
    let text = std::fs::read_to_string(out.join("report.json")).expect("the report");
    // A finding that is not shrunk has several hundred calls. A fault that depends on addresses has a different number of findings in
    // each run, so the limits apply to one finding.
    let (bytes, lines) = (text.len() / found.len(), text.lines().count() / found.len());
    assert!(lines < 4_000 && bytes < 1 << 18, "{fault}: {lines} lines and {bytes} bytes for each finding");
    if fault != "none" {
        not_shown_without_fault(&out, name, &path, fault);
    }
}

macro_rules! mutants {
    ($($fmi:literal $mutant:ident $topic:literal $name:literal;)+) => { $(
        #[test]
        fn $mutant() {
            caught(($fmi, stringify!($mutant), &[]), $topic, $name, |text| text);
        }
    )+
        /// Names of the faults in this table.
        const FAULTS: &[&str] = &[$(stringify!($mutant)),+];
    };
}

mutants! {
    2 step_rejected_halfway "rejections" "rejections.changed";
    2 lossy_state "states" "states.restore-values";
    2 bytes_with_address "states" "states.fresh-process.crash";
    3 bytes_without_input "states" "states.serialized";
    2 restore_consumes "states" "states.twice";
    2 handle_not_reused "states" "states.several";
    3 adjoint_off "derivatives" "derivatives.adjoint-digits";
    2 directional_sign "derivatives" "derivatives.directional";
    3 directional_not_linear "derivatives" "derivatives.linear";
    2 nominal_zero "derivatives" "derivatives.nominals";
    2 write_past "start_values" "arrays.written-beyond";
    3 write_before "start_values" "arrays.written-beyond";
    2 read_past "start_values" "arrays.read-beyond";
    3 write_const "start_values" "arrays.const";
    2 name_kept "results" "arrays.read-beyond";
    2 shared_static "results" "results.instances";
    3 racing_static "results" "results.threads";
    2 leak_instance "resources" "resources.memory";
    2 reset_without_count "reset" "reset.incomplete";
    2 start_value "start_values" "start_values.start";
    2 boolean_two "start_values" "start_values.boolean";
    2 integer_out_of_range "start_values" "start_values.range";
    2 string_latin1 "start_values" "start_values.utf8";
    2 version_wrong "functions" "functions.version";
    3 state_not_supported "functions" "functions.capability";
    2 status_unknown "results" "functions.status";
    3 free_null_crashes "life_cycle" "life_cycle.free-null.crash";
    2 get_after_end_rejected "life_cycle" "life_cycle.rejected";
    3 crash_amid "results" "results.crash";
    3 log_latin1 "rejections" "logs.utf8";
    3 log_when_off "logs" "logs.off";
    2 endless_step "malformed" "malformed.times.hang";
    3 null_crashes "malformed" "malformed.null.crash";
    2 bytes_crash "malformed" "malformed.bytes.crash";
    3 reference_crashes "malformed" "malformed.references.crash";
    2 reference_exits "malformed" "malformed.references.exit";
    2 string_cut "start_values" "start_values.set";
    2 event_loses_input "start_values" "start_values.inputs";
    3 reset_keeps_string "reset" "reset.values";
    2 directional_imprecise "derivatives" "derivatives.precision";
    3 event_again_now "life_cycle" "life_cycle.next-event-time";
    2 last_step_rejected "life_cycle" "life_cycle.rejected";
    3 early_time_wrong "results" "results.early-return";
    3 early_unreported "results" "results.early-unreported";
    2 address_in_result "results" "results.process";
    2 name_in_result "results" "results.name";
    2 visible_in_result "results" "results.visible";
    2 name_gone "life_cycle" "arrays.read-beyond";
    2 unload_crashes "life_cycle" "life_cycle.unload.crash";
    3 exit_hangs "life_cycle" "life_cycle.unload.hang";
    3 set_after_end_crashes "rejections" "rejections.crash";
    2 long_step_hangs "malformed" "malformed.times.hang";
    2 environment_lost "rejections" "logs.environment";
    3 mask_changed "resources" "resources.settings";
    3 log_file_left "resources" "resources.settings";
    2 slope_off "results" "results.interfaces";
    2 home_in_result "results" "results.environment";
    2 values_end "results" "results.terminated";
    3 logging_switched "results" "results.logging";
    2 announcement_counts "results" "results.no-earlier-state";
    3 set_changes_other "start_values" "start_values.set";
}

/// Faults of which each test finds several in one check. `make test-long` also finds each of them alone. In these groups, a finding
/// disappears with its fault, so a rule that no longer finds it fails the test.
macro_rules! together {
    ($($group:ident $fmi:literal $topic:literal { $($mutant:ident $name:literal;)+ })+) => {
        $(
            #[test]
            fn $group() {
                let directory = TempDir::new().expect("a directory");
                let path = fmu(directory.path(), $fmi, &library(&[]), |text| text);
                wagon::all_found(&path, $topic, &[$((stringify!($mutant), $name, "")),+]);
            }
            $(
                #[test]
                #[ignore = "make test-long runs it"]
                fn $mutant() {
                    caught(($fmi, stringify!($mutant), &[]), $topic, $name, |text| text);
                }
            )+
        )+
        const TOGETHER: &[&str] = &[$($(stringify!($mutant)),+),+];
    };
}

together! {
    rejections_of_fmi2 2 "rejections" {
        half_set "rejections.changed";
        category_unknown "logs.category";
        set_after_end "rejections.tolerated";
    }
    results_of_fmi2_1 2 "results" {
        getter_changes "results.reading";
        time_lags "results.time";
    }
    results_of_fmi2_2 2 "results" {
        step_overshoots "results.time";
        step_adds "results.cut";
        output_stale "results.reading";
    }
    derivatives_of_fmi2 2 "derivatives" {
        derivative_changes "derivatives.changed";
        order_ignored "derivatives.order";
    }
    resources_of_fmi2_1 2 "resources" {
        thread_left "resources.threads";
        locale_changed "resources.settings";
    }
    resources_of_fmi2_2 2 "resources" {
        leak_step "resources.memory";
        environment_changed "resources.settings";
        step_prints "logs.printed";
    }
    resources_of_fmi2_3 2 "resources" {
        string_leaks "resources.memory";
        limit_changed "resources.settings";
    }
    life_cycle_of_fmi2 2 "life_cycle" {
        event_in_the_past "life_cycle.next-event-time";
        terminate_rejected "life_cycle.rejected";
        event_moves_silently "life_cycle.states-changed";
    }
    start_values_of_fmi3 3 "start_values" {
        set_ignored "start_values.set";
        output_unwritten "start_values.unwritten";
        parameter_drifts "start_values.fixed";
        start_in_mode_ignored "start_values.when";
        early_read_wrong "start_values.start";
    }
    rejections_of_fmi3 3 "rejections" {
        discard_changes "rejections.discarded";
        silent "logs.silent";
    }
    results_of_fmi3_1 3 "results" {
        reading_once "results.reading";
        unwritten_memory "results.process";
        last_time_wrong "results.time";
    }
    results_of_fmi3_2 3 "results" {
        logging_in_result "results.logging";
        reference_once "results.repeated";
        start_time_ignored "results.time";
        counts_twice "results.interfaces";
        directory_in_result "results.environment";
        thread_in_result "results.other-thread";
    }
    states_of_fmi3 3 "states" {
        state_without_event "states.restore";
        save_changes "states.changed-by-saving";
        freed_handle_stays "states.free";
        lossy_when_late "states.restore-values";
    }
    resources_of_fmi3 3 "resources" {
        leak_state "resources.memory";
        file_left "resources.files";
        rounding_changed "resources.settings";
        second_run_rejected "resources.cycles";
    }
    life_cycle_of_fmi3 3 "life_cycle" {
        events_without_end "life_cycle.event-iteration";
        token_ignored "life_cycle.token";
        stop_ignored "life_cycle.stop-time";
        pool_of_eight "life_cycle.rejected";
    }
    derivatives_of_fmi3 3 "derivatives" {
        vector_swapped "derivatives.vectors";
        directional_added "derivatives.directional";
    }
    reset_of_fmi3 3 "reset" {
        reset_keeps_parameter "reset.values";
        reset_rejected "reset.incomplete";
    }
}

#[test]
fn function_missing() {
    caught((2, "none", &["-DWITHOUT_NOMINALS"]), "functions", "functions.missing", |text| text);
}

/// The linkers of other platforms reject the library.
#[cfg(target_os = "linux")]
#[test]
fn symbol_missing() {
    caught((2, "none", &["-DSYMBOL_MISSING"]), "functions", "package.symbols", |text| text);
}

/// Faults of the description: FMI version, name of the finding, the string that is replaced, and the replacement.
#[rustfmt::skip]
const DESCRIPTIONS: [(u32, &str, &str, &str); 24] = [
    (2, "description.combination", r#""parameter" variability="fixed""#, r#""parameter" variability="discrete""#),
    (3, "description.combination", r#""input" variability"#, r#""input" initial="calculated" variability"#),
    (2, "description.combination", r#""input" variability"#, r#""input" initial="exact" variability"#),
    (3, "description.combination", r#""output" variability="discrete""#, r#""output" variability="continuous""#),
    (2, "description.encoding", r#"encoding="UTF-8""#, r#"encoding="ISO-8859-1""#),
    (2, "dependencies.missing", r#"index="9" dependencies="4 5""#, r#"index="9" dependencies="5""#),
    (3, "dependencies.missing", r#"dependencies="4 5 6""#, r#"dependencies="4 6""#),
    (3, "dependencies.initial", r#""9" dependencies="4""#, r#""9" dependencies="""#),
    (2, "description.units", r#"<Real start="2""#, r#"<Real unit="stone" start="2""#),
    (2, "description.structure", r#"<Unknown index="9" dependencies="4 5"/>"#, ""),
    (2, "description.start", r#"<Real start="2"/>"#, "<Real/>"),
    (2, "description.start", r#"<Real start="2"/>"#, r#"<Real start="1,5"/>"#),
    (2, "description.start", r#"<Boolean/>"#, r#"<Boolean start="True"/>"#),
    (2, "description.schema", r#"canGetAndSetFMUstate="true""#, r#"canGetAndSetFMUstate="yes""#),
    (3, "description.schema", "<ModelStructure>", r#"<ModelStructure colour="red">"#),
    (3, "description.independent", r#"causality="independent""#, r#"causality="local""#),
    (2, "description.references", r#""spring" valueReference="2""#, r#""spring" valueReference="1""#),
    (2, "description.units", r#"<Real start="2""#, r#"<Real displayUnit="kg" start="2""#),
    (3, "description.token", r#" instantiationToken="wagon""#, ""),
    (2, "description.empty-token", r#"guid="wagon""#, r#"guid="""#),
    (2, "description.range", r#"<Real start="2""#, r#"<Real min="3" start="2""#),
    (2, "description.experiment", r#"stopTime="1""#, r#"stopTime="-1""#),
    (2, "description.types", r#"<Real start="2""#, r#"<Real declaredType="Weight" start="2""#),
    (2, "description.names", r#"name="spring""#, r#"name="mass""#),
];

#[test]
fn descriptions() {
    for (fmi, name, before, after) in DESCRIPTIONS {
        let (topic, _) = name.split_once('.').expect("a topic");
        caught((fmi, "none", &[]), topic, name, |text| {
            assert!(text.contains(before), "{before}");
            text.replacen(before, after, 1)
        });
    }
}

/// Asserts that every fault in the sources is tested, and that the pages state the numbers of faults.
#[test]
fn no_fault_is_forgotten() {
    // Traits of FMUs that only the tests of fmu-run use.
    const OF_RUNNERS: [&str; 8] = [
        "free_state_fails",
        "freed_environment",
        "memory",
        "null_environment",
        "other_environment",
        "other_thread",
        "unchecked_memory",
        "warning",
    ];
    let sources = ["frame.h", "wagon.c", "valve.c", "spring.c"].map(c_models::read).concat();
    let faults = sources.split("IS(").skip(1).filter_map(|rest| rest.split_once(')')).map(|(name, _)| name);
    let mut faults: BTreeSet<&str> = faults.filter(|name| !OF_RUNNERS.contains(name)).collect();
    assert!(faults.remove("name") && faults.remove("unusual"));
    let mut of_wagon: Vec<_> =
        FAULTS.iter().chain(TOGETHER).chain(ATTACKS.iter().map(|(_, name, ..)| name)).collect();
    of_wagon.push(&"make_hangs");
    for name in &of_wagon {
        assert!(faults.remove(**name), "there is no {name}");
    }
    faults.retain(|name| !include_str!("valve.rs").contains(name));
    let (variants, of_spring): (Vec<&str>, Vec<&str>) =
        faults.into_iter().partition(|name| name.starts_with("harmless_"));
    for name in variants.iter().chain(&of_spring) {
        assert!(include_str!("dynamics.rs").contains(name), "{name}");
    }
    let of_library = of_wagon.len() + ["SYMBOL_MISSING", "WITHOUT_NOMINALS"].len();
    let stated = format!(
        "{of_library} faults into the library of a correct FMU, one at a time, and {} more into its description",
        DESCRIPTIONS.len()
    );
    let readme = include_str!("../../README.md").split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(readme.contains(&stated), "{stated}");
}
