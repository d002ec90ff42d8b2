//! The commands of `cargo fmu`, from a new model to a checked FMU.
#![allow(missing_docs)]

use fmu_run::{Batch, Fmu, Integration, Interface, Start, Watch};
use serde_json::Value;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use tempfile::TempDir;

/// A temporary directory for models. They are compiled in `target/models`, as in the Makefile.
struct Directory(TempDir);

impl Directory {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn run(&self, directory: &str, program: &str, arguments: &[&str]) -> Output {
        Command::new(program)
            .args(arguments)
            .current_dir(self.0.path().join(directory))
            .env("CARGO_TARGET_DIR", Path::new(env!("CARGO_TARGET_TMPDIR")).with_file_name("models"))
            // These tests do not measure the speed of the libraries. With these settings, `build` has the dependencies of `run`, and a
            // model compiles in a third of the time.
            .env("CARGO_PROFILE_RELEASE_LTO", "off")
            .env("CARGO_PROFILE_RELEASE_OPT_LEVEL", "0")
            .env("CARGO_PROFILE_RELEASE_INCREMENTAL", "true")
            .env("WASM2C", "/nowhere/wasm2c")
            .output()
            .unwrap()
    }

    fn fmu(&self, directory: &str, arguments: &[&str]) -> Output {
        self.run(directory, env!("CARGO_BIN_EXE_cargo-fmu"), &[&["fmu"], arguments].concat())
    }

    /// Returns the output of a command that succeeds.
    #[track_caller]
    fn prints(&self, directory: &str, arguments: &[&str]) -> String {
        let output = self.fmu(directory, arguments);
        assert!(output.status.success(), "{arguments:?}\n{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    }

    /// Returns the errors of a command that fails.
    #[track_caller]
    fn rejects(&self, directory: &str, arguments: &[&str]) -> String {
        let output = self.fmu(directory, arguments);
        assert!(!output.status.success(), "{arguments:?}");
        String::from_utf8(output.stderr).unwrap()
    }

    fn path(&self, path: &str) -> PathBuf {
        self.0.path().join(path)
    }

    fn read(&self, path: &str) -> String {
        fs::read_to_string(self.path(path)).unwrap()
    }
}

/// The templates of `cargo fmu new`.
const TEMPLATES: [&str; 5] = ["lag", "ball", "motor", "house", "tank"];

/// Templates pass their tests. They are in one workspace, so fmu-export is compiled once.
fn pass_their_tests(templates: &[&str]) {
    let directory = Directory::new();
    // `cargo new` adds the members.
    fs::write(directory.path("Cargo.toml"), "[workspace]\nresolver = \"3\"\n").unwrap();
    let lock = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../Cargo.lock");
    fs::copy(lock, directory.path("Cargo.lock")).unwrap();
    for name in templates {
        let output = directory.prints("", &["new", &format!("my-{name}"), "--from", name]);
        assert!(output.contains(&format!("cd my-{name}")) && output.contains("cargo fmu run"), "{output}");
    }
    let output = directory.run("", env!("CARGO"), &["test", "--quiet", "--workspace"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

/// The first template is also packed and checked below. `make test-long` does so with the others.
#[test]
fn the_first_template_passes_its_tests() {
    pass_their_tests(&TEMPLATES[..1]);
}

#[test]
#[ignore = "make test-long runs it"]
fn templates_pass_their_tests() {
    pass_their_tests(&TEMPLATES);
}

/// Creates, simulates and checks a model.
fn develop(from: &str, arguments: &[&str], columns: &str, trajectory: &str) -> Directory {
    let directory = Directory::new();
    let name = format!("my-{from}");
    directory.prints("", &["new", &name, "--from", from]);
    let output = directory.prints(&name, &[&["run"], arguments].concat());
    assert!(output.contains(trajectory), "{output}");
    let fmu = format!("my_{from}");
    let table = directory.read(&format!("{name}/target/fmu/{fmu}.csv"));
    assert_eq!(table.lines().next(), Some(columns));
    assert!(directory.read(&format!("{name}/target/fmu/{fmu}.svg")).starts_with("<svg width=\"840\""));
    for path in [format!("{fmu}.fmu"), format!("fmi3/{fmu}.fmu")] {
        let file = fs::File::open(directory.path(&format!("{name}/target/fmu/{path}"))).unwrap();
        let mut fmu = zip::ZipArchive::new(file).unwrap();
        let text = std::io::read_to_string(fmu.by_name("modelDescription.xml").unwrap()).unwrap();
        assert!(text.contains(&format!("modelIdentifier=\"my_{from}\"")), "{text}");
        assert_eq!(fmu.by_name("resources/winter.csv").is_ok(), from == "house");
    }
    for path in [format!("target/fmu/{fmu}.fmu"), format!("target/fmu/fmi3/{fmu}.fmu")] {
        let options = ["check", "--fmu", &path, "--json", "--no-shrink", "--repeat", "0.3"];
        let report: Value = serde_json::from_str(&directory.prints(&name, &options)).unwrap();
        assert_eq!(
            (&report["interfaces"][0], &report["unreached"]),
            (&"Co-Simulation".into(), &Value::Array(vec![]))
        );
        assert_eq!(findings(&report), listed(from), "{path}");
        compare_interfaces(&directory.path(&format!("{name}/{path}")), from);
    }
    directory
}

/// Asserts that Model Exchange has the same results as Co-Simulation, whose steps are separate code. Tolerances are relative to the
/// peak of an output. They are larger for the motor, the house and the tank, whose steps are approximations.
fn compare_interfaces(fmu: &Path, from: &str) {
    let (outputs, end, tolerance) = match from {
        "ball" => (vec!["height", "velocity"], 3.0, 1e-8),
        "motor" => (vec!["current", "speed"], 0.05, 1e-5),
        "house" => (vec!["room"], 86_400.0, 1e-3),
        "tank" => (vec!["level"], 100.0, 1e-6),
        _ => (vec!["x"], 1.0, 1e-8),
    };
    // SAFETY: the FMU of these tests.
    #[allow(unsafe_code)]
    let fmu = unsafe { Fmu::open(fmu) }.unwrap().system().clone();
    let time: Vec<_> = (0..=500).map(|k| end * f64::from(k) / 500.0).collect();
    let run = |interface| {
        let integration = match interface {
            Interface::ModelExchange => Integration { rtol: Some(1e-9), ..Integration::default() },
            Interface::CoSimulation => Integration::default(),
        };
        let start = if from == "lag" { vec![("u", Start::Same(1.0))] } else { vec![] };
        let (outputs, interface) = (outputs.clone(), Some(interface));
        let batch =
            Batch { time: &time, start, outputs, every: Some(1), interface, integration, ..Batch::default() };
        let watch = Watch::default();
        let runs = fmu.run(&batch, &watch).unwrap();
        (runs.trajectories, watch.ended().first().map(|(_, time, _)| *time))
    };
    let [(exchanged, end), (stepped, expected)] =
        [Interface::ModelExchange, Interface::CoSimulation].map(run);
    assert_eq!(end.is_some(), expected.is_some());
    assert!((end.unwrap_or_default() - expected.unwrap_or_default()).abs() < 1e-9, "{end:?} {expected:?}");
    for (name, (one, other)) in outputs.iter().zip(exchanged.chunks(501).zip(stepped.chunks(501))) {
        let peak = other
            .iter()
            .copied()
            .filter(|value| value.is_finite())
            .fold(0.0, |peak: f64, x| peak.max(x.abs()));
        for (k, (one, other)) in one.iter().zip(other).enumerate() {
            let same = (one - other).abs() <= tolerance * peak || one.is_nan() && other.is_nan();
            assert!(same, "{name} is {one} at {} s, in Co-Simulation {other}", time[k]);
        }
    }
}

/// Returns the observations of a report, without the names of functions, which depend on the FMI version, and without the finding about
/// glibc, which depends on the system.
fn findings(report: &Value) -> BTreeSet<String> {
    let all = report["findings"].as_array().unwrap().iter();
    let all = all.filter(|finding| finding["name"] != "package.glibc");
    let observed = all.flat_map(|finding| {
        let one = std::iter::once(&finding["observed"]).chain(finding["more"].as_array().unwrap());
        one.map(|text| [&finding["severity"], &finding["name"], text].map(|text| text.as_str().unwrap()))
    });
    observed
        .map(|[severity, name, text]| format!("{severity} {name} {}", text.split(" with ").last().unwrap()))
        .collect()
}

/// Returns the notes on a model that docs/checking.md lists.
fn listed(model: &str) -> BTreeSet<String> {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/checking.md");
    let page = fs::read_to_string(page).unwrap();
    let rows = page.lines().map(|row| row.split(" | ").collect::<Vec<_>>());
    rows.filter(|row| row.get(1).is_some_and(|fmus| fmus.split(", ").any(|fmu| fmu == model)))
        .map(|row| format!("note {} {}", row[0].trim_matches(['|', ' ', '`']), row[2]))
        .collect()
}

/// The state is 1 - e^-1 after a second.
#[test]
fn lag() {
    let directory = develop("lag", &["--set", "u=1"], "time,x", "x  from 0 to 0.632121\n");
    let printed = directory.prints("my-lag", &["run", "--set", "u=1"]);
    let is_result = |line: &&str| line.starts_with("x  ") || line.ends_with(" steps");
    let shown: Vec<&str> = include_str!("../README.md").lines().filter(is_result).collect();
    assert!(
        shown.len() == 2 && printed.contains(&shown.join("\n")),
        "{shown:?} in README.md, printed is\n{printed}"
    );
    assert!(include_str!("../../fmu-export/README.md").contains(shown[0]));
    inputs_come_from_a_table(&directory);
    check_makes_the_fmus(&directory);
    options_reach_the_program_that_packs(&directory);
}

/// The ball ends the simulation after five bounces.
#[test]
#[ignore = "make test-long runs it"]
fn ball() {
    let directory =
        develop("ball", &[], "time,height,velocity,bounces", "ended by the FMU at t = 2.0527167766");
    // The last row is at the end, which is between two communication points.
    let table = directory.read("my-ball/target/fmu/my_ball.csv");
    let last = table.lines().next_back().unwrap();
    assert!(last.starts_with("2.0527167766") && last.ends_with(",5"), "{last}");
    a_failed_run_fails(&directory);
    // The second FMU is checked although the first one has findings.
    let fmus = ["--fmu", "target/fmu/my_ball.fmu", "--fmu", "target/fmu/fmi3/my_ball.fmu"];
    let output = directory
        .fmu("my-ball", &[&["check", "--only", "rejections", "--fail-on", "note"], &fmus[..]].concat());
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(!output.status.success() && text.contains("(FMI 2.0,") && text.contains("(FMI 3.0,"), "{text}");
}

#[test]
#[ignore = "make test-long runs it"]
fn motor() {
    let directory = develop("motor", &["--set", "duty=1"], "time,current,speed,on", "rad/s");
    assert!(directory.read("my-motor/target/fmu/my_motor.csv").trim_end().ends_with(",true"));
}

#[test]
#[ignore = "make test-long runs it"]
fn house() {
    let directory = develop(
        "house",
        &[],
        "time,room,outside,comfort",
        "from -6 to 2.5 degC\ncomfort  \"comfortable\" and \"cold\"\n",
    );
    let read = "logEvents: read 9 temperatures from winter.csv";
    assert!(directory.prints("my-house", &["run", "--log"]).contains(read));
    assert!(!directory.prints("my-house", &["run"]).contains(read));
    // A run leaves out the page, and a build adds it.
    let page = || {
        let fmu = fs::File::open(directory.path("my-house/target/fmu/my_house.fmu")).unwrap();
        let mut fmu = zip::ZipArchive::new(fmu).unwrap();
        fmu.by_name("documentation/index.html").ok().map(|file| std::io::read_to_string(file).unwrap())
    };
    assert_eq!(page(), None);
    directory.prints("my-house", &["build"]);
    let page = page().unwrap();
    assert!(page.contains("<h1>House</h1>") && page.contains(".catch(showFailure);"));
}

/// A run whose start values the FMU rejects prints the reason, and writes no table.
fn a_failed_run_fails(directory: &Directory) {
    for fmi in ["2", "3"] {
        let output = directory.fmu("my-ball", &["run", "--fmi", fmi, "--set", "gravity=1e6"]);
        let [text, errors] = [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap());
        assert_eq!(output.status.code(), Some(1));
        assert!(errors.contains("error: ") && errors.contains("gravity must not be above 1000"), "{errors}");
        assert!(!text.contains("from"), "{text}");
        let files = if fmi == "2" { "" } else { "fmi3/" };
        assert!(directory.path(&format!("my-ball/target/fmu/{files}my_ball.fmu")).is_file());
        assert!(!directory.path("my-ball/target/fmu/my_ball.csv").exists());
    }
}

/// Without `--fmu`, the check builds both FMUs.
fn check_makes_the_fmus(directory: &Directory) {
    let output = directory.prints("my-lag", &["check", "--only", "dependencies", "--out", "report"]);
    assert!(
        output.contains("fmu/my_lag.fmu (FMI 2.0") && output.contains("fmi3/my_lag.fmu (FMI 3.0"),
        "{output}"
    );
    for report in ["fmu", "fmi3"] {
        assert!(directory.read(&format!("my-lag/report/{report}/junit.xml")).contains("no findings"));
    }
    assert!(directory.rejects("my-lag", &["check", "--fmu", "Cargo.toml"]).contains("Cargo.toml"));
}

fn inputs_come_from_a_table(directory: &Directory) {
    fs::write(directory.path("my-lag/step.csv"), "time, u\n0, 2\n4, 2\n").unwrap();
    let output =
        directory.prints("my-lag", &["run", "--input", "step.csv", "--step", "0.5", "--show", "x,u"]);
    assert!(output.contains("0 to 4 s in 8 steps"), "{output}");
    assert!(output.contains("Co-Simulation and Model Exchange agree"), "{output}");
    let table = directory.read("my-lag/target/fmu/my_lag.csv");
    let last: Vec<f64> =
        table.lines().next_back().unwrap().split(',').map(|value| value.parse().unwrap()).collect();
    assert!((last[1] - 2.0 * (1.0 - (-4.0_f64).exp())).abs() < 1e-12 && last[2] == 2.0, "{last:?}");

    for (arguments, message) in [
        (&["run", "--set", "y=1"][..], "there is no variable y to set"),
        (&["run", "--set", "der(y)=1"], "there is no variable der(y) to set; did you mean der(x)?"),
        (&["run", "--show", "y"], "there is no variable y to show"),
        (&["run", "--step", "0"], "--step 0 positive"),
        (&["run", "--stop", "1", "--step", "0.3"], "not a whole number; change --stop or --step"),
        (&["run", "--show", "x,u,x"], "x is twice among the variables of --show"),
        (&["run", "--set", "u=1", "--input", "step.csv"], "so --set u has no effect"),
        (&["build", "--", "--tunable"], "has no program build_fmu"),
        (&["check", "--fmu", "target/fmu/my_lag.fmu", "--package", "my-lag"], "cannot be used with"),
        (&["check", "--explain", "logs.silent", "--quick"], "cannot be used with"),
        (&["run", "--input", "nothing.csv"], "nothing.csv"),
    ] {
        let output = directory.rejects("my-lag", arguments);
        assert!(output.contains(message), "{output}");
    }
}

/// Builds from another directory than the package's.
fn options_reach_the_program_that_packs(directory: &Directory) {
    let manifest = "my-lag/Cargo.toml";
    let output = directory
        .prints("", &["build", "--manifest-path", manifest, "--no-page", "--fmi", "3", "--out", "made"]);
    assert!(output.contains("made/fmi3/my_lag.fmu") && output.contains("guid {"), "{output}");
    assert!(directory.path("made/fmi3/my_lag.fmu").is_file());
    assert!(!directory.path("made/my_lag.fmu").exists());

    // The description that is kept with the sources has no guid.
    directory.prints("my-lag", &["build", "--describe", "--out", "described"]);
    let text = directory.read("my-lag/described/modelDescription.xml");
    assert!(text.contains("guid=\"{00000000-0000-0000-0000-000000000000}\""), "{text}");
    assert!(text.contains("<Unknown index=\"3\" dependencies=\"1 2\""), "{text}");

    for (arguments, message) in [
        (&["--binary", "linux64=a.so", "--any-processor"][..], "--any-processor goes with --fmi 2 only"),
        (&["--c-sources"], "wasm2c"),
        (&["--target", "x86_64-unknown-nonsense"], "no FMU platform is known for the target"),
        (&["--fmi", "2", "--binary", "win64=Cargo.toml"], "it is not a shared library"),
    ] {
        let output = directory.rejects("my-lag", &[&["build"], arguments].concat());
        assert!(output.contains(message) && output.contains("error: "), "{output}");
    }
}

#[test]
fn other_packages_are_rejected() {
    let directory = Directory::new();
    directory.prints("", &["new", "odd"]);
    let [library, manifest] = ["odd/src/lib.rs", "odd/Cargo.toml"].map(|path| directory.read(path));
    let with = |path: &str, text: &str| fs::write(directory.path(path), text).unwrap();

    with("odd/src/lib.rs", &library.replace("export_fmu!", "offer!"));
    let output = directory.rejects("odd", &["build"]);
    assert!(output.contains("its crate needs `export_fmu!(...)` in src/lib.rs"), "{output}");
    with("odd/src/lib.rs", &library);

    with("odd/Cargo.toml", &manifest.replace("\"cdylib\", ", ""));
    let output = directory.rejects("odd", &["build"]);
    assert!(output.contains("crate-type = [\"cdylib\", \"rlib\"]"), "{output}");
    with(
        "odd/Cargo.toml",
        &manifest.replace("fmu-export =", "other = { package = \"fmu-run\", path = \"x\" } #"),
    );
    assert!(directory.rejects("odd", &["build"]).starts_with("error: "));

    let output = directory.rejects("", &["new", "odd"]);
    assert_eq!(output, "error: odd exists already; name a new directory\n");
    let output = directory.rejects("", &["new", "7-segments"]);
    assert!(output.starts_with("error: invalid character `7` in package name"), "{output}");
    assert!(!directory.path("7-segments").exists());
    let output = directory.rejects("", &["new", "fmu-export"]);
    assert!(
        output.starts_with("error: fmu-export is the name of the library that the model uses"),
        "{output}"
    );
    let output = directory.rejects("", &["new", "größe"]);
    assert!(output.starts_with("error: größe has letters other than a to z"), "{output}");
    assert!(!directory.path("größe").exists());
    let output = directory.rejects("", &["build"]);
    assert!(output.contains("could not find `Cargo.toml`"), "{output}");
}

/// If cargo or this program cannot write a file, the message states the reason, and no part of a model remains.
#[test]
#[cfg(unix)]
fn a_new_model_is_complete_or_absent() {
    let directory = Directory::new();
    let program = env!("CARGO_BIN_EXE_cargo-fmu");
    for (limit, reason) in [("0", "SIGXFSZ"), ("1", "SIGXFSZ")] {
        let command = format!("trap - XFSZ; ulimit -f {limit}; exec {program} fmu new lag");
        let output = directory.run("", "sh", &["-c", &command]);
        let errors = String::from_utf8(output.stderr).unwrap();
        assert!(
            errors.starts_with("error: ") && errors.contains(reason) && errors.lines().count() == 1,
            "{errors}"
        );
        assert!(!directory.path("lag").exists());
    }
    directory.prints("", &["new", "lag"]);
}

/// The linker is missing before anything is compiled, if neither MinGW nor cargo-zigbuild is in `PATH`.
#[test]
#[cfg(unix)]
fn a_missing_linker_is_reported_first() {
    let directory = Directory::new();
    directory.prints("", &["new", "lag"]);
    let tools = directory.path("tools");
    fs::create_dir(&tools).unwrap();
    for tool in ["cargo", "rustc"] {
        let output = directory.run("", "sh", &["-c", &format!("command -v {tool}")]);
        let found = String::from_utf8(output.stdout).unwrap();
        std::os::unix::fs::symlink(found.trim(), tools.join(tool)).unwrap();
    }
    let target = "x86_64-pc-windows-gnu";
    let build = format!(
        "PATH={} exec {} fmu build --target {target}",
        tools.display(),
        env!("CARGO_BIN_EXE_cargo-fmu")
    );
    let output = directory.run("lag", "sh", &["-c", &build]);
    let errors = String::from_utf8(output.stderr).unwrap();
    assert!(
        !output.status.success() && errors.contains(&format!("a linker for {target}: pip install")),
        "{errors}"
    );
    assert!(!errors.contains("Compiling"), "{errors}");
}

/// A clone may be copied together with the compiled program, which must then not name the original.
#[test]
#[cfg(unix)]
fn a_copied_program_names_its_own_clone() {
    let directory = Directory::new();
    let root = fs::canonicalize(directory.path("")).unwrap();
    for (from, to) in [
        (Path::new(env!("CARGO_BIN_EXE_cargo-fmu")), "copy/target/debug/cargo-fmu"),
        (
            &Path::new(env!("CARGO_MANIFEST_DIR")).join("../fmu-export/Cargo.toml"),
            "copy/crates/fmu-export/Cargo.toml",
        ),
    ] {
        fs::create_dir_all(directory.path(to).parent().unwrap()).unwrap();
        fs::copy(from, directory.path(to)).unwrap();
    }
    let program = directory.path("copy/target/debug/cargo-fmu");
    let output = directory.run("", program.to_str().unwrap(), &["fmu", "new", "model"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let named = format!("path = {:?}", root.join("copy/crates/fmu-export"));
    assert!(directory.read("model/Cargo.toml").contains(&named), "{}", directory.read("model/Cargo.toml"));
}

/// Within one repository, the model names fmu-export by a relative path; with `--git`, by a commit. Both are still valid after the
/// repository or the model was moved to another directory.
#[test]
#[cfg(unix)]
fn a_model_is_built_in_another_directory() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2).unwrap();
    let directory = Directory::new();
    let git = |arguments: &[&str]| {
        let output = Command::new("git").args(arguments).current_dir(directory.path("")).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    };
    if !root.join(".git").exists() {
        return;
    }
    let root = root.to_str().unwrap();
    git(&["clone", "--quiet", "--bare", root, "origin.git"]);
    git(&["clone", "--quiet", "origin.git", "second"]);
    let second = fs::canonicalize(directory.path("second")).unwrap();
    // Cargo gets a temporary home, so that its clones are temporary, too. Crates of the registry are shared.
    let home = std::env::var_os("CARGO_HOME").map(PathBuf::from);
    let home = home.unwrap_or_else(|| Path::new(&std::env::var_os("HOME").unwrap()).join(".cargo"));
    fs::create_dir(directory.path("home")).unwrap();
    std::os::unix::fs::symlink(home.join("registry"), directory.path("home/registry")).unwrap();
    // Returns the manifest of fmu-export that cargo resolves in a directory.
    let source = |path: &str| {
        let mut cargo = Command::new(env!("CARGO"));
        cargo.args(["metadata", "--format-version", "1"]).current_dir(directory.path(path));
        let output = cargo.env("CARGO_HOME", directory.path("home")).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let metadata: Value = serde_json::from_slice(&output.stdout).unwrap();
        let packages = metadata["packages"].as_array().unwrap();
        let export = packages.iter().find(|package| package["name"] == "fmu-export").unwrap();
        export["manifest_path"].as_str().unwrap().to_owned()
    };

    fs::create_dir_all(Path::new(root).join("target")).unwrap();
    let inside = tempfile::tempdir_in(Path::new(root).join("target")).unwrap();
    let name = inside.path().file_name().unwrap().to_str().unwrap();
    let model = inside.path().join("shared");
    // A separate workspace within the clone.
    fs::write(inside.path().join("Cargo.toml"), "[workspace]\nmembers = [\"shared\"]\nresolver = \"3\"\n")
        .unwrap();
    let output = directory.prints("", &["new", model.to_str().unwrap()]);
    let root_of_workspace = fs::canonicalize(inside.path()).unwrap();
    let stated = format!(
        "workspace in {0}, whose Cargo.toml lists it, so its FMUs go to {0}/",
        root_of_workspace.display()
    );
    assert!(output.contains(&stated), "{output}");
    let manifest = fs::read_to_string(model.join("Cargo.toml")).unwrap();
    assert!(
        manifest.contains("path = \"../../../crates/fmu-export\"") && !manifest.contains(root),
        "{manifest}"
    );
    // The member has no profile, because cargo ignores it and prints a warning.
    assert!(!manifest.contains("[profile"), "{manifest}");
    let copy = second.join("target").join(name);
    fs::create_dir_all(second.join("target")).unwrap();
    let copied = Command::new("cp").arg("-r").args([inside.path(), &copy]).status().unwrap();
    assert!(copied.success());
    let model = format!("second/target/{name}/shared");
    assert_eq!(source(&model), second.join("crates/fmu-export/Cargo.toml").to_str().unwrap());

    let url = format!("file://{}", directory.path("origin.git").display());
    let output = directory.prints("", &["new", "from-git", "--git", &url]);
    assert!(!output.contains("only on this machine") && !output.contains("workspace"), "{output}");
    assert!(!directory.read("from-git/Cargo.toml").contains(root));
    fs::rename(directory.path("from-git"), directory.path("elsewhere")).unwrap();
    assert!(source("elsewhere").contains("/git/checkouts/"));

    let output = directory.prints("", &["new", "outside"]);
    assert!(output.contains("only on this machine; --git URL"), "{output}");
    let manifest = directory.read("outside/Cargo.toml").replace(root, "/home/someone");
    fs::write(directory.path("outside/Cargo.toml"), manifest).unwrap();
    let error = directory.rejects("outside", &["build"]);
    assert!(
        error.contains("names /home/someone/crates/fmu-export for fmu-export, which is not on this machine")
            && error.contains("fmu-export = { path = \"...\" }")
            && error.lines().count() == 1,
        "{error}"
    );

    // In a repository that has the crates as a submodule, the path is relative, too.
    fs::create_dir(directory.path("plant")).unwrap();
    let git_in = |arguments: &[&str]| {
        git(&[&["-C", "plant", "-c", "protocol.file.allow=always"], arguments].concat());
    };
    git_in(&["init", "--quiet"]);
    git_in(&["submodule", "--quiet", "add", "../origin.git", "libraries/wrist"]);
    let output = directory.prints("plant", &["new", "models/crane"]);
    assert!(!output.contains("only on this machine"), "{output}");
    let manifest = directory.read("plant/models/crane/Cargo.toml");
    assert!(
        manifest.contains("fmu-export = { path = \"../../libraries/wrist/crates/fmu-export\" }"),
        "{manifest}"
    );
}

/// The README of fmu-export contains the smallest model, which is about 35 lines, as the README of this crate states.
#[test]
fn the_readme_shows_a_complete_fmu() {
    let crates = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let source = fs::read_to_string(crates.join("fmu-package/models/lag/src/lib.rs")).unwrap();
    let (_, code) = source.split_once("\n\n").unwrap();
    let lines = code.lines().count();
    assert!((30..=40).contains(&lines) && include_str!("../README.md").contains("about 35 lines"), "{lines}");
    let readme = fs::read_to_string(crates.join("fmu-export/README.md")).unwrap();
    assert!(readme.contains(&format!("```rust,ignore\n{code}```")), "{readme}");
}

/// Returns the fenced blocks of a page in their order: the comment in the line before, the language, and the content.
fn blocks(page: &str) -> Vec<(&str, &str, &str)> {
    let mut found = Vec::new();
    let mut rest = page;
    while let Some((before, after)) = rest.split_once("\n```") {
        let (language, after) = after.split_once('\n').unwrap();
        let end = if after.starts_with("```") { 0 } else { after.find("\n```").unwrap() + 1 };
        let note = before.lines().next_back().unwrap_or_default();
        let note = note.strip_prefix("<!-- ").and_then(|note| note.strip_suffix(" -->")).unwrap_or_default();
        found.push((note, language, &after[..end]));
        rest = &after[end + 3..];
    }
    found
}

/// Compares a file with the content that it should have, or writes it if `UPDATE_EXPECTED` is set.
fn is_up_to_date(path: &Path, content: &str) {
    if std::env::var_os("UPDATE_EXPECTED").is_some() {
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, content).unwrap();
    }
    let found = fs::read_to_string(path).unwrap_or_default();
    let mut lines = found.lines().zip(content.lines());
    let difference = lines.find(|(found, expected)| found != expected);
    assert!(found == content, "{}: {difference:?} (UPDATE_EXPECTED=1 writes it)", path.display());
}

/// Writes the code in the guide for authors into packages, stage by stage, and runs the guide's commands. Their output must be as in
/// the guide. The stages with numbers are those of the tank, and the last one must equal the model of `cargo fmu new --from tank`. The other
/// stages have the names of their packages.
fn follow_the_guide(directory: &Directory, guide: &Path) {
    let page = fs::read_to_string(guide).unwrap().replace("\r\n", "\n");
    let all = blocks(&page);
    let mut updated = page.clone();
    let mut stage = "1";
    for &(note, language, content) in &all {
        if let Some((number, path)) = note.split_once(": ") {
            stage = number;
            if number == "1" {
                let written = directory.read(&format!("tank/{path}"));
                updated =
                    updated.replacen(&format!("```rust\n{content}```"), &format!("```rust\n{written}```"), 1);
            }
        }
        let package = if stage.parse::<u32>().is_ok() { "tank" } else { stage };
        let Some(command) = content.lines().next().and_then(|line| line.strip_prefix("$ cargo fmu ")) else {
            continue;
        };
        for (note, ..) in &all {
            let Some(path) = note.strip_prefix(stage).and_then(|note| note.strip_prefix(": ")) else {
                continue;
            };
            let parts: Vec<_> = all.iter().filter(|(of, ..)| of == note).map(|(_, _, part)| *part).collect();
            if stage != "1" {
                fs::write(directory.path(&format!("{package}/{path}")), parts.join("\n")).unwrap();
            }
        }
        let output = directory.prints(package, &command.split(' ').collect::<Vec<_>>());
        // The sizes of the files and the guid differ between machines.
        let is_kept = |line: &&str| !line.contains(".fmu: ") && !line.starts_with("guid ");
        let output: String = output.lines().filter(is_kept).map(|line| format!("{line}\n")).collect();
        updated = updated.replacen(
            &format!("```{language}\n{content}```"),
            &format!("```{language}\n$ cargo fmu {command}\n{output}```"),
            1,
        );
        if stage == "1" {
            is_up_to_date(&guide.with_extension("svg"), &directory.read("tank/target/fmu/tank.svg"));
        }
    }
    is_up_to_date(guide, &updated);
    for path in ["src/lib.rs", "tests/tank.rs"] {
        let model = Path::new(env!("CARGO_MANIFEST_DIR")).join("models/tank").join(path);
        is_up_to_date(&model, &directory.read(&format!("tank/{path}")));
    }
}

/// The code in the guide for authors is a model with tests, which is packed, run and checked. The test of the template `lag` runs the same
/// commands for a model that compiles faster.
#[test]
#[ignore = "make test-long runs it"]
fn the_guide_leads_to_a_checked_fmu() {
    let directory = Directory::new();
    directory.prints("", &["new", "tank"]);
    directory.prints("", &["new", "regulator"]);
    follow_the_guide(&directory, &Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/author-guide.md"));
    let output = directory.run("tank", env!("CARGO"), &["test", "--quiet"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let output = directory.fmu("tank", &["build", "--no-page"]);
    let errors = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{errors}");
    if cfg!(all(target_os = "linux", target_env = "gnu")) {
        assert!(
            errors.contains("note: the library needs glibc 2.")
                && errors.contains("for glibc 2.17, add --target"),
            "{errors}"
        );
    }

    // An array is set as a whole in both FMI versions, because `levels` would not always rise if its elements were set one by one.
    for fmi in ["2", "3"] {
        let run = ["run", "--fmi", fmi, "--set", "levels=0,2,4,6", "--show", "level,pumping,switches,flows"];
        let output = directory.prints("tank", &run);
        assert!(
            output.contains("pumping   false and true\n") && output.contains("switches  from 0 to"),
            "{output}"
        );
        let table = directory.read("tank/target/fmu/tank.csv");
        assert_eq!(
            table.lines().next(),
            Some("time,level,pumping,switches,flows[1],flows[2],flows[3],flows[4]")
        );
        assert!(table.lines().nth(1).unwrap().starts_with("0,1,false,0,0,"), "{table}");
        for (values, message) in
            [("0,1", "levels has 4 elements, --set gives 2 values"), ("3,2,1,0", "levels must rise")]
        {
            let output =
                directory.rejects("tank", &["run", "--fmi", fmi, "--set", &format!("levels={values}")]);
            assert!(output.contains(message), "{output}");
        }
    }
    let fmus = ["--fmu", "target/fmu/tank.fmu", "--fmu", "target/fmu/fmi3/tank.fmu"];
    let options =
        ["check", "--fail-on", "fragile", "--no-shrink", "--repeat", "0.3", "--input", "inflow.csv"];
    let output = directory.prints("tank", &[&options[..], &fmus].concat());
    for fmu in [fmus[1], fmus[3]] {
        compare_interfaces(&directory.path(&format!("tank/{fmu}")), "tank");
        assert!(output.contains(&format!("{fmu}: Co-Simulation and Model Exchange agree")), "{output}");
    }
    mistakes_in_events_show(&directory);
    assert!(output.contains("(FMI 2.0,") && output.contains("(FMI 3.0,"), "{output}");
}

/// For the inputs in a table, the interface types differ from the event on that one of them misses.
fn mistakes_in_events_show(directory: &Directory) {
    let source = directory.read("tank/src/lib.rs");
    for (old, new, reason) in [
        ("Crossing::Falling", "Crossing::Rising", "Model Exchange has an event at 69.3147"),
        (
            "= self.distance(self.level);",
            "= 1.0;",
            "Co-Simulation jumps there, and Model Exchange has no event",
        ),
    ] {
        assert_eq!(source.matches(old).count(), 1, "{old}");
        fs::write(directory.path("tank/src/lib.rs"), source.replace(old, new)).unwrap();
        let output = directory.prints("tank", &["run", "--input", "inflow.csv"]);
        let warning = "warning: Co-Simulation and Model Exchange differ from 70 s on: pumping is ";
        assert!(output.contains(warning) && output.contains(reason), "{output}");
        let check = ["check", "--only", "logs", "--fmu", "target/fmu/tank.fmu", "--input", "inflow.csv"];
        assert!(!directory.fmu("tank", &check).status.success());
    }
    fs::write(directory.path("tank/src/lib.rs"), source).unwrap();
}

/// Checks that the build fails with the source location of the first panic, or with the name of a call that does not return, and
/// that it does not write an FMU. After 5 s, the build prints what it does.
#[test]
fn models_that_panic_or_do_not_return_are_rejected() {
    let directory = Directory::new();
    directory.prints("", &["new", "ball", "--from", "ball"]);
    let source = directory.read("ball/src/ball.rs");
    let rejects = |old: &str, new: &str| {
        assert_eq!(source.matches(old).count(), 1, "{old}");
        fs::write(directory.path("ball/src/ball.rs"), source.replace(old, new)).unwrap();
        let errors = directory.rejects("ball", &["build", "--no-page", "--time-limit", "6"]);
        assert!(!directory.path("ball/target/fmu/ball.fmu").exists(), "{errors}");
        errors
    };
    let line = 1 + source.lines().position(|line| line.contains("indicators[0] = ")).unwrap();
    let error = rejects("indicators[0] = self.height;", "indicators[1] = self.height;");
    assert!(
        error.contains("the model panics in its description (new, start values, indicators): "),
        "{error}"
    );
    assert!(
        error.contains(&format!("src/ball.rs:{line}:")) && error.contains("index out of bounds"),
        "{error}"
    );
    let error = rejects(
        "        let terminate = self.bounce();",
        "        let terminate = self.bounce();\n        assert!(self.height > 0.0);",
    );
    assert!(error.contains("DiscreteStates returns Fatal: ") && error.contains("height > 0.0"), "{error}");
    let error = rejects(
        "        let terminate = self.bounce();",
        "        let terminate = self.bounce();\n        while self.height <= 0.0 {}",
    );
    assert!(
        error.contains("DiscreteStates does not return within ") && error.contains("--time-limit"),
        "{error}"
    );
    assert!(error.contains("note: ball.fmu: simulates the model"), "{error}");
}
