//! `cargo fmu build` rejects a model that contradicts itself, with a message that names the variable and the remedy.
//!
//! Each model contains all of its mistakes, and a file in the resources of the FMU selects one of them. So a model is compiled only once,
//! although each mistake is packed in an FMU of its own.
#![cfg(target_os = "linux")]

use fmu_test_kit::c_programs::library;
use std::fs;
use std::io::Write;
use std::path::Path;
use std::process::Command;
use tempfile::TempDir;

/// Builds a model with a mistake. Returns whether the build accepts it, and then checks that the FMU exists, and the output on the standard
/// error.
fn built(model: &str, mistake: &str, fmi: &str) -> (bool, String) {
    let directory = package(model);
    let (succeeds, errors) = build(directory.path(), model, mistake, fmi);
    let exists = ["out", "out/fmi3"].iter().any(|out| {
        fs::read_dir(directory.path().join(out))
            .into_iter()
            .flatten()
            .flatten()
            .any(|entry| entry.path().extension().is_some_and(|end| end == "fmu"))
    });
    assert_eq!(succeeds, exists, "{model} with {mistake:?}: {errors}");
    (exists, errors)
}

/// Makes a package with the name of a model.
fn package(model: &str) -> TempDir {
    let directory = tempfile::tempdir().unwrap();
    let path = |name: &str| directory.path().join(name);
    let export = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().join("fmu-export");
    let manifest = format!(
        "[package]\nname = \"{model}\"\nedition = \"2024\"\n[lib]\ncrate-type = [\"cdylib\"]\n[dependencies]\nfmu-export = {{ path = \"{}\"          }}\n[workspace]\n",
        export.display()
    );
    fs::write(path("Cargo.toml"), manifest).unwrap();
    fs::create_dir_all(path("src")).unwrap();
    fs::write(path("src/lib.rs"), "").unwrap();
    fs::create_dir_all(path("modelDescription/resources")).unwrap();
    directory
}

/// Builds an FMU with a mistake in the directory of a package. Returns whether the build succeeds, and its output on the standard error,
/// without the lines that only a slow build prints.
fn build(directory: &Path, model: &str, mistake: &str, fmi: &str) -> (bool, String) {
    fs::write(directory.join("modelDescription/resources/mistake"), mistake).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_cargo-fmu"));
    command.args(["fmu", "build", "--no-page", "--fmi", fmi, "--out", "out", "--binary"]);
    command.arg(format!("{}={}", platform(fmi), library(model).display())).current_dir(directory);
    let output = command.output().unwrap();
    let errors = String::from_utf8(output.stderr).unwrap();
    let progress = [format!("note: {model}: the build "), format!("note: {model}.fmu: ")];
    let is_kept = |line: &&str| !progress.iter().any(|start| line.starts_with(start));
    (output.status.success(), errors.split_inclusive('\n').filter(is_kept).collect())
}

fn platform(fmi: &str) -> &'static str {
    if fmi == "2" { "linux64" } else { "x86_64-linux" }
}

/// Asserts that a mistake is rejected with an error that contains these parts.
fn rejects(model: &str, mistake: &str, fmi: &str, parts: &[&str]) {
    let (is_accepted, errors) = built(model, mistake, fmi);
    let is_named = parts.iter().all(|part| errors.contains(part));
    assert!(!is_accepted && errors.contains("error: ") && is_named, "{model} with {mistake:?}: {errors}");
}

fn accepts(model: &str, difference: &str, fmi: &str) {
    let (is_accepted, errors) = built(model, difference, fmi);
    assert!(is_accepted, "{model} with {difference:?}: {errors}");
}

const LACKS_A_FIELD: &[&str] = &["y was ", "after `memory in` of variables!", "states."];
const COMPARE: &str = "compare `step` with `by` of the derivative";

#[test]
fn fields_that_saved_states_lack_are_found() {
    accepts("memory", "", "2");
    accepts("memory", "", "3");
    rejects("memory", "last", "2", LACKS_A_FIELD);
    rejects("memory", "size", "3", &["there is no step size", "after `memory in` of variables!"]);
    rejects("memory", "ticks", "2", &["n was ", "after `memory in` of variables!"]);
}

/// An FMU that has passed is not checked again, but the warnings of the check are repeated. An FMU that has not passed is.
#[test]
fn an_fmu_is_checked_once() {
    let directory = package("memory");
    let build = |mistake: &str| build(directory.path(), "memory", mistake, "2");
    let [first, second] = [build("random"), build("random")];
    let skipped = "memory.fmu has passed this check in an earlier build, so it is not checked again\n";
    assert!(
        first.0
            && first.1.contains(
                "the results of the model depend on its other instances, as through a counter in a `static`"
            )
            && !first.1.contains(skipped)
    );
    assert_eq!(second, (true, format!("{skipped}{}", first.1)));
    let [one, other] = [build("last"), build("last")];
    assert!(!one.0 && one == other && one.1.contains("after `memory in`"), "{one:?} {other:?}");
    assert_eq!(build("random"), second);
}

#[test]
fn states_follow_their_derivatives() {
    // The other tests build the differences "", "stiff" and "jumps".
    for difference in ["at rest", "friction"] {
        accepts("cart", difference, "3");
    }
    for (mistake, text) in [
        ("swapped", "x changes by "),
        ("inner steps", "x changes by "),
        ("still", "v changes by 0.000000e0 per second in a step, but its derivative der(v) is "),
    ] {
        rejects("cart", mistake, "2", &[text, COMPARE]);
    }
}

/// Mistakes of which another test builds one of the same kind.
#[test]
#[ignore = "make test-long runs it"]
fn further_mistakes_of_the_same_kinds() {
    for field in ["sum", "shown"] {
        rejects("memory", field, "2", LACKS_A_FIELD);
    }
    for mistake in ["sign", "factor", "forgotten"] {
        rejects("cart", mistake, "2", &["v changes by ", COMPARE]);
    }
}

/// The cart jumps only in Co-Simulation.
#[test]
fn different_interface_types_are_a_warning() {
    let (is_accepted, warnings) = built("cart", "jumps", "3");
    let parts = ["warning: ", " in Co-Simulation at ", "integrated in Model Exchange", "results.interfaces"];
    assert!(is_accepted && parts.iter().all(|part| warnings.contains(part)), "{warnings}");
}

#[test]
fn reading_changes_nothing() {
    for (mistake, name) in [("calculate", "x "), ("clamped", "sets x to "), ("counted", "hits is ")] {
        rejects("cart", mistake, "2", &[name, "`calculate` must not change states"]);
    }
}

#[test]
fn events_declare_that_they_change_states() {
    accepts("cart", "jump and reported", "2");
    rejects("cart", "jump", "3", &[" x was ", "`states_changed: true`"]);
    rejects("cart", "hit and reported", "2", &[" v was ", "`.reinit()`"]);
}

/// What is probably a mistake, although the standard allows it, is a warning: with such strong friction, the damping does not act.
#[test]
fn probable_mistakes_are_warnings() {
    let directory = package("cart");
    let warnings = |difference: &str| {
        let (succeeds, errors) = build(directory.path(), "cart", difference, "3");
        assert!(succeeds, "{errors}");
        errors
    };
    let stiff = warnings("stiff");
    for warning in [
        "warning: in the simulations of this check, d changes no value, no derivative and no event; use it or remove it",
        "warning: omega is 1.0 for all values of the parameters that were tried; calculate it from parameters",
    ] {
        assert!(stiff.contains(warning), "{stiff}");
    }
    let reported = warnings("jump and reported");
    assert!(
        reported.contains("warning: each update reports changed states")
            && reported.contains("; `event` must check")
    );
    let usual = warnings("");
    let rules = ["no-effect", "calculated-parameter", "counted-entry"];
    assert!(!rules.iter().any(|rule| usual.contains(rule)), "{usual}");
}

/// The parameters of a sampled controller act, although its inputs are equal in the simulations of the check. A name of a unit that means
/// something else is found, and what happens only at the limit of a range or near the stop time.
#[test]
fn parameters_without_effect_are_warnings() {
    let directory = package("regulator");
    let unit =
        "warning: the unit mH is declared as 1 kg.m2.s-2.A-2, but its name means 0.001 kg.m2.s-2.A-2\n";
    let warnings = |difference: &str| {
        let (succeeds, errors) = build(directory.path(), "regulator", difference, "2");
        assert!(succeeds && errors.contains(unit), "{errors}");
        errors.replace(unit, "")
    };
    assert_eq!(warnings(""), "");
    assert!(warnings("enumeration").contains("hold changes no value, no derivative and no event"));
    assert!(warnings("calculated").contains("share is 0.5 for all values of the parameters that were tried"));
    assert!(
        warnings("talkative")
            .contains("steps logs a message; the first is \"a step from 0 s\"; log what happens once")
    );
    assert!(warnings("initial").contains(
        "gain is tunable, but acts only if it is set before the initialization; use it in `step`, `event` or `by`"
    ));
    let limit = warnings("limit");
    assert!(
        limit.contains("if reset is 0.1, its min, ") && limit.contains("share is not a finite number"),
        "{limit}"
    );
    let counted = warnings("counted");
    assert!(
        counted.contains(" returns Fatal: ")
            && counted.contains("add with overflow")
            && counted.contains("dynamics.stop-time")
    );
}

#[test]
fn derivatives_equal_differences_of_the_values() {
    // The check reads the derivatives of each FMI version with the same code, so each mistake is in one of them.
    for fmi in ["2", "3"] {
        accepts("square", "", fmi);
    }
    for (mistake, fmi, text) in [
        ("partial", "2", "y with respect to u is "),
        ("no number", "3", "y with respect to u: "),
        ("initial_partial", "3", "y in Initialization Mode with respect to u is "),
    ] {
        rejects("square", mistake, fmi, &[text, "the functions of `Partials`"]);
    }
    // Time is not a variable of the model, so only FMI 3.0 has derivatives with respect to it.
    rejects("square", "partial_by_time", "3", &["y with respect to time is ", "the functions of `Partials`"]);
}

#[test]
fn values_follow_from_the_variables_that_they_name() {
    rejects("square", "hidden", "2", &["y ", " v changes", "name it in the `depends_on`"]);
    rejects("square", "not finite", "3", &["y is not a finite number"]);
}

/// A motion in which the fuse trips, beside an FMU of it, which the build has accepted.
struct Motion(TempDir, &'static str);

impl Motion {
    fn new(fmi: &'static str) -> Self {
        let directory = package("fuse");
        let (is_built, errors) = build(directory.path(), "fuse", "", fmi);
        assert!(is_built, "{errors}");
        fs::write(directory.path().join("current.csv"), "time,u\n0,0\n1,0\n1,1\n20,1\n").unwrap();
        fs::write(directory.path().join("low.csv"), "time,u\n0,0\n1,0\n1,0.4\n9,0.4\n").unwrap();
        Self(directory, if fmi == "2" { "out/fuse.fmu" } else { "out/fmi3/fuse.fmu" })
    }

    /// Examines the FMU with a mistake and these inputs. Returns whether the check accepts it, and what it prints.
    fn examined(&self, mistake: &str, inputs: &str) -> (bool, String) {
        let path = |name: &str| self.0.path().join(name);
        let mut fmu = zip::ZipArchive::new(fs::File::open(path(self.1)).unwrap()).unwrap();
        let mut with_mistake = zip::ZipWriter::new(fs::File::create(path("fuse.fmu")).unwrap());
        for index in 0..fmu.len() {
            let file = fmu.by_index_raw(index).unwrap();
            if file.name().unwrap() != "resources/mistake" {
                with_mistake.raw_copy_file(file).unwrap();
            }
        }
        with_mistake.start_file("resources/mistake", zip::write::SimpleFileOptions::default()).unwrap();
        with_mistake.write_all(mistake.as_bytes()).unwrap();
        with_mistake.finish().unwrap();
        let mut command = Command::new(env!("CARGO_BIN_EXE_cargo-fmu"));
        command.args(["fmu", "check", "--only", "description", "--input", inputs, "--fmu", "fuse.fmu"]);
        let output = command.current_dir(self.0.path()).output().unwrap();
        (output.status.success(), String::from_utf8(output.stdout).unwrap())
    }

    #[track_caller]
    fn shows(&self, mistake: &str, parts: &[&str]) {
        let (is_accepted, output) = self.examined(mistake, "current.csv");
        assert!(!is_accepted && parts.iter().all(|part| output.contains(part)), "{mistake:?}: {output}");
    }

    #[track_caller]
    fn shows_nothing(&self) {
        let (is_accepted, output) = self.examined("", "current.csv");
        let found: Vec<&str> = output.lines().filter(|line| line.starts_with("fuse.fmu: ")).collect();
        assert!(is_accepted && matches!(found[..], [only] if only.contains(AGREE)), "{output}");
    }
}

const AGREE: &str = "Co-Simulation and Model Exchange agree";

#[test]
fn the_motion_of_the_author_shows_mistakes_in_events() {
    let motion = Motion::new("2");
    motion.shows_nothing();
    motion.shows("unreported", &["changes the state x, but does not report it", "`states_changed: true`"]);
    motion.shows("wear", &["changes the state wear; add `.reinit()`"]);
    motion.shows("warm", &["warm changes from false to true before ", ", without an event", AGREE]);
    motion.shows(
        "next",
        &["a run that continues from the state saved at ", "sample is ", "`memory in`", AGREE],
    );
    motion.shows("clone", &["a run that continues from the state saved at ", "tripped is ", "`Clone`"]);
}

#[test]
#[ignore = "make test-long runs it"]
fn the_motion_of_the_author_shows_further_mistakes() {
    let motion = Motion::new("3");
    motion.shows_nothing();
    motion.shows("tripped", &["tripped is ", "`memory in`"]);
    motion.shows(
        "static",
        &[
            "two runs with the same inputs differ: noise is ",
            "`static`",
            "two runs of Co-Simulation differ as well",
        ],
    );
    motion.shows(
        "unannounced",
        &["differ from 10.501 s on: sample is ", "Model Exchange has no event", "`next`"],
    );
    motion.shows("erratic", &["differ from ", " s on: noise is "]);
    // With the current that trips no fuse, the steps are only less exact.
    let (is_accepted, output) = motion.examined("coarse", "low.csv");
    assert!(
        is_accepted
            && output.contains(
                " of its range, and by less with half the step size; choose shorter steps to compare"
            ),
        "{output}"
    );
}
