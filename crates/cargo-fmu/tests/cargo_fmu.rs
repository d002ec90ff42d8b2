//! `cargo fmu` as someone uses it who begins a model.
#![allow(missing_docs)]

use serde_json::Value;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use tempfile::TempDir;

/// A folder for models. They share what cargo makes, here and in the Makefile.
struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn run(&self, folder: &str, program: &str, arguments: &[&str]) -> Output {
        Command::new(program)
            .args(arguments)
            .current_dir(self.0.path().join(folder))
            .env("CARGO_TARGET_DIR", Path::new(env!("CARGO_TARGET_TMPDIR")).with_file_name("models"))
            .env("WASM2C", "/nowhere/wasm2c")
            .env_remove("FMU_GUID")
            .output()
            .unwrap()
    }

    fn fmu(&self, folder: &str, arguments: &[&str]) -> Output {
        self.run(folder, env!("CARGO_BIN_EXE_cargo-fmu"), &[&["fmu"], arguments].concat())
    }

    /// What it says where it succeeds.
    #[track_caller]
    fn says(&self, folder: &str, arguments: &[&str]) -> String {
        let output = self.fmu(folder, arguments);
        assert!(output.status.success(), "{arguments:?}\n{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    }

    /// What it says where it fails.
    #[track_caller]
    fn rejects(&self, folder: &str, arguments: &[&str]) -> String {
        let output = self.fmu(folder, arguments);
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

/// Begun, tested and simulated as `new` proposes.
fn grows(from: &str, arguments: &[&str], columns: &str, trajectory: &str) -> Folder {
    let folder = Folder::new();
    let name = format!("my-{from}");
    let said = folder.says("", &["new", &name, "--from", from]);
    assert!(said.contains(&format!("cd {name}")) && said.contains("cargo fmu run"), "{said}");
    let output = folder.run(&name, env!("CARGO"), &["test", "--quiet"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let said = folder.says(&name, &[&["run"], arguments].concat());
    assert!(said.contains(trajectory), "{said}");
    let fmu = format!("my_{from}");
    let table = folder.read(&format!("{name}/target/fmu/{fmu}.csv"));
    assert_eq!(table.lines().next(), Some(columns));
    assert!(folder.read(&format!("{name}/target/fmu/{fmu}.svg")).starts_with("<svg width=\"840\""));
    for path in [format!("{fmu}.fmu"), format!("fmi3/{fmu}.fmu")] {
        let file = fs::File::open(folder.path(&format!("{name}/target/fmu/{path}"))).unwrap();
        let mut fmu = zip::ZipArchive::new(file).unwrap();
        let text = std::io::read_to_string(fmu.by_name("modelDescription.xml").unwrap()).unwrap();
        assert!(text.contains(&format!("modelIdentifier=\"my_{from}\"")), "{text}");
        assert_eq!(fmu.by_name("resources/winter.csv").is_ok(), from == "house");
    }
    for path in [format!("target/fmu/{fmu}.fmu"), format!("target/fmu/fmi3/{fmu}.fmu")] {
        let options = ["check", "--fmu", &path, "--json", "--no-shrink", "--repeat", "0.3"];
        let report: Value = serde_json::from_str(&folder.says(&name, &options)).unwrap();
        assert_eq!(
            (&report["interfaces"][0], &report["unreached"]),
            (&"Co-Simulation".into(), &Value::Array(vec![]))
        );
        assert_eq!(findings(&report), listed(from), "{path}");
    }
    folder
}

/// The observations of a report, without the names of functions, which depend on the FMI version. The version of glibc that
/// a library needs is that of the system.
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

/// The notes on a model that the documentation lists.
fn listed(model: &str) -> BTreeSet<String> {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/checking.md");
    let page = fs::read_to_string(page).unwrap();
    let rows = page.lines().map(|row| row.split(" | ").collect::<Vec<_>>());
    rows.filter(|row| row.get(1) == Some(&model))
        .map(|row| format!("note {} {}", row[0].trim_matches(['|', ' ', '`']), row[2]))
        .collect()
}

/// 1 - e^-1 after a second.
#[test]
fn lag() {
    let folder = grows("lag", &["--set", "u=1"], "time,x", "from 0.000000 to 0.632121 1");
    inputs_come_from_a_table(&folder);
    check_makes_the_fmus(&folder);
    options_reach_the_program_that_packs(&folder);
}

/// It ends when it has bounced five times.
#[test]
fn ball() {
    let folder = grows("ball", &[], "time,height,velocity,bounces", "ended by the FMU at t = 2.0527167766");
    // The last row is that of the end, between two communication points.
    let table = folder.read("my-ball/target/fmu/my_ball.csv");
    let last = table.lines().next_back().unwrap();
    assert!(last.starts_with("2.0527167766") && last.ends_with(",5"), "{last}");
    a_failed_run_fails(&folder);
    // The first FMU has a finding that fails; the second is checked all the same.
    let fmus = ["--fmu", "target/fmu/my_ball.fmu", "--fmu", "target/fmu/fmi3/my_ball.fmu"];
    let output =
        folder.fmu("my-ball", &[&["check", "--only", "refusals", "--fail-on", "note"], &fmus[..]].concat());
    let said = String::from_utf8(output.stdout).unwrap();
    assert!(!output.status.success() && said.contains("(FMI 2.0,") && said.contains("(FMI 3.0,"), "{said}");
}

#[test]
fn motor() {
    let folder = grows("motor", &["--set", "duty=1"], "time,current,speed,on", "rad/s");
    assert!(folder.read("my-motor/target/fmu/my_motor.csv").trim_end().ends_with(",true"));
}

#[test]
fn house() {
    let folder = grows("house", &[], "time,room,outside", "from -6.000000 to 2.500000 degC");
    let read = "logEvents: read 9 temperatures from winter.csv";
    assert!(folder.says("my-house", &["run", "--log"]).contains(read));
    assert!(!folder.says("my-house", &["run"]).contains(read));
    // A run needs no page. A build makes it, with the resources that the model reads.
    let page = || {
        let fmu = fs::File::open(folder.path("my-house/target/fmu/my_house.fmu")).unwrap();
        let mut fmu = zip::ZipArchive::new(fmu).unwrap();
        fmu.by_name("documentation/index.html").ok().map(|file| std::io::read_to_string(file).unwrap())
    };
    assert_eq!(page(), None);
    folder.says("my-house", &["build"]);
    let page = page().unwrap();
    assert!(page.contains("<h1>House</h1>") && page.contains(".catch(showFailure);"));
}

/// The reason comes first, and no file of values that are none.
fn a_failed_run_fails(folder: &Folder) {
    for fmi in ["2", "3"] {
        let output = folder.fmu("my-ball", &["run", "--fmi", fmi, "--set", "gravity=1e6"]);
        let [said, why] = [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap());
        assert_eq!(output.status.code(), Some(1));
        assert!(why.contains("error: ") && why.contains("gravity must not be above 1000"), "{why}");
        assert!(!said.contains("from"), "{said}");
        let files = if fmi == "2" { "" } else { "fmi3/" };
        assert!(folder.path(&format!("my-ball/target/fmu/{files}my_ball.fmu")).is_file());
        assert!(!folder.path("my-ball/target/fmu/my_ball.csv").exists());
    }
}

/// Without `--fmu` both FMUs are made first.
fn check_makes_the_fmus(folder: &Folder) {
    let said = folder.says("my-lag", &["check", "--only", "dependencies", "--out", "report"]);
    assert!(said.contains("fmu/my_lag.fmu (FMI 2.0") && said.contains("fmi3/my_lag.fmu (FMI 3.0"), "{said}");
    for report in ["fmu", "fmi3"] {
        assert!(folder.read(&format!("my-lag/report/{report}/junit.xml")).contains("no findings"));
    }
    assert!(folder.rejects("my-lag", &["check", "--fmu", "Cargo.toml"]).contains("Cargo.toml"));
}

fn inputs_come_from_a_table(folder: &Folder) {
    fs::write(folder.path("my-lag/step.csv"), "time, u\n0, 2\n4, 2\n").unwrap();
    let said = folder.says("my-lag", &["run", "--input", "step.csv", "--step", "0.5", "--show", "x,u"]);
    assert!(said.contains("0 to 4 s in 8 steps"), "{said}");
    let table = folder.read("my-lag/target/fmu/my_lag.csv");
    let last: Vec<f64> =
        table.lines().next_back().unwrap().split(',').map(|value| value.parse().unwrap()).collect();
    assert!((last[1] - 2.0 * (1.0 - (-4.0_f64).exp())).abs() < 1e-12 && last[2] == 2.0, "{last:?}");

    for (arguments, word) in [
        (&["run", "--set", "y=1"][..], "there is no variable y to set"),
        (&["run", "--set", "der(y)=1"], "there is no variable der(y) to set; did you mean der(x)?"),
        (&["run", "--show", "y"], "there is no variable y to show"),
        (&["run", "--step", "0"], "--step 0 positive"),
        (&["run", "--input", "nothing.csv"], "nothing.csv"),
    ] {
        let said = folder.rejects("my-lag", arguments);
        assert!(said.contains(word), "{said}");
    }
}

/// Options of `build_fmu`, with the package named from elsewhere.
fn options_reach_the_program_that_packs(folder: &Folder) {
    let manifest = "my-lag/Cargo.toml";
    let said =
        folder.says("", &["build", "--manifest-path", manifest, "--no-page", "--fmi", "3", "--out", "made"]);
    assert!(said.contains("made/fmi3/my_lag.fmu") && said.contains("guid {"), "{said}");
    assert!(folder.path("made/fmi3/my_lag.fmu").is_file());
    assert!(!folder.path("made/my_lag.fmu").exists());

    // As it would be kept with the sources: without what changes with each of them.
    folder.says("my-lag", &["build", "--describe", "--out", "described"]);
    let text = folder.read("my-lag/described/modelDescription.xml");
    assert!(text.contains("guid=\"{00000000-0000-0000-0000-000000000000}\""), "{text}");
    assert!(text.contains("<Unknown index=\"3\" dependencies=\"1 2\""), "{text}");

    for (arguments, words) in [
        (&["--binary", "linux64=a.so", "--any-processor"][..], "--any-processor goes with --fmi 2 only"),
        (&["--c-sources"], "wasm2c"),
        (&["--target", "x86_64-unknown-nonsense"], "no FMU platform is known for the target"),
        (&["--fmi", "2", "--binary", "win64=Cargo.toml"], "it is no shared library"),
    ] {
        let said = folder.rejects("my-lag", &[&["build"], arguments].concat());
        assert!(said.contains(words) && said.contains("error: "), "{said}");
    }
}

#[test]
fn what_is_no_model_is_named() {
    let folder = Folder::new();
    folder.says("", &["new", "odd"]);
    let [library, manifest] = ["odd/src/lib.rs", "odd/Cargo.toml"].map(|path| folder.read(path));
    let with = |path: &str, text: &str| fs::write(folder.path(path), text).unwrap();

    with("odd/src/lib.rs", &library.replace("export_fmu!", "offer!"));
    let said = folder.rejects("odd", &["build"]);
    assert!(said.contains("its crate needs `export_fmu!(...)` in src/lib.rs"), "{said}");
    with("odd/src/lib.rs", &library);

    with("odd/Cargo.toml", &manifest.replace("\"cdylib\", ", ""));
    let said = folder.rejects("odd", &["build"]);
    assert!(said.contains("crate-type = [\"cdylib\", \"rlib\"]"), "{said}");
    with(
        "odd/Cargo.toml",
        &manifest.replace("fmu-export =", "other = { package = \"fmu-run\", path = \"x\" } #"),
    );
    assert!(folder.rejects("odd", &["build"]).starts_with("error: "));

    let said = folder.rejects("", &["new", "odd"]);
    assert_eq!(said, "error: odd is there already; name a new folder\n");
    let said = folder.rejects("", &["new", "7-segments"]);
    assert!(said.starts_with("error: invalid character `7` in package name"), "{said}");
    assert!(!folder.path("7-segments").exists());
    let said = folder.rejects("", &["build"]);
    assert!(said.contains("could not find `Cargo.toml`"), "{said}");
}

/// In one tree, the model names a path from itself; with `--git`, a commit. Both are valid in another place.
#[test]
#[cfg(unix)]
fn a_model_is_built_at_another_place() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2).unwrap();
    let folder = Folder::new();
    let git = |arguments: &[&str]| {
        let output = Command::new("git").args(arguments).current_dir(folder.path("")).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    };
    if !root.join(".git").exists() {
        return;
    }
    let root = root.to_str().unwrap();
    git(&["clone", "--quiet", "--bare", root, "origin.git"]);
    git(&["clone", "--quiet", "origin.git", "second"]);
    let second = fs::canonicalize(folder.path("second")).unwrap();
    // A clone by cargo goes with the test; crates of the registry are those that are there.
    let home = std::env::var_os("CARGO_HOME").map(PathBuf::from);
    let home = home.unwrap_or_else(|| Path::new(&std::env::var_os("HOME").unwrap()).join(".cargo"));
    fs::create_dir(folder.path("home")).unwrap();
    std::os::unix::fs::symlink(home.join("registry"), folder.path("home/registry")).unwrap();
    // The source of fmu-export, as cargo resolves it there.
    let source = |place: &str| {
        let mut cargo = Command::new(env!("CARGO"));
        cargo.args(["metadata", "--format-version", "1"]).current_dir(folder.path(place));
        let output = cargo.env("CARGO_HOME", folder.path("home")).output().unwrap();
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
    // A package of its own, beside the workspace of the clone.
    fs::write(inside.path().join("Cargo.toml"), "[workspace]\nmembers = [\"shared\"]\nresolver = \"3\"\n")
        .unwrap();
    folder.says("", &["new", model.to_str().unwrap()]);
    let manifest = fs::read_to_string(model.join("Cargo.toml")).unwrap();
    assert!(
        manifest.contains("path = \"../../../crates/fmu-export\"") && !manifest.contains(root),
        "{manifest}"
    );
    // Its workspace decides on the profile; cargo would warn of another one.
    assert!(!manifest.contains("[profile"), "{manifest}");
    let copy = second.join("target").join(name);
    fs::create_dir_all(second.join("target")).unwrap();
    let copied = Command::new("cp").arg("-r").args([inside.path(), &copy]).status().unwrap();
    assert!(copied.success());
    let place = format!("second/target/{name}/shared");
    assert_eq!(source(&place), second.join("crates/fmu-export/Cargo.toml").to_str().unwrap());

    let url = format!("file://{}", folder.path("origin.git").display());
    let said = folder.says("", &["new", "from-git", "--git", &url]);
    assert!(!said.contains("only on this machine"), "{said}");
    assert!(!folder.read("from-git/Cargo.toml").contains(root));
    fs::rename(folder.path("from-git"), folder.path("elsewhere")).unwrap();
    assert!(source("elsewhere").contains("/git/checkouts/"));

    let said = folder.says("", &["new", "alone"]);
    assert!(said.contains("only on this machine; --git URL"), "{said}");
}

/// The READMEs show the least there is, word for word.
#[test]
fn the_readme_shows_a_whole_fmu() {
    let crates = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let source = fs::read_to_string(crates.join("cargo-fmu/models/lag/src/lib.rs")).unwrap();
    let (_, code) = source.split_once("\n\n").unwrap();
    let readme = fs::read_to_string(crates.join("fmu-export/README.md")).unwrap();
    assert!(readme.contains(&format!("```rust,ignore\n{code}```")), "{readme}");
}

/// The code of the guide for authors is a model with tests, which is packed, run and checked as it says.
#[test]
fn the_guide_leads_to_a_checked_fmu() {
    let guide = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/author-guide.md");
    let guide = fs::read_to_string(guide).unwrap();
    let folder = Folder::new();
    folder.says("", &["new", "tank"]);
    for path in ["src/lib.rs", "tests/tank.rs"] {
        // Each block of code is introduced by the name of its file.
        let begin = format!("<!-- {path} -->\n```rust\n");
        let blocks = guide.split(&begin).skip(1);
        let code: Vec<_> = blocks.map(|block| block.split("```").next().unwrap()).collect();
        assert!(!code.is_empty(), "{path}");
        fs::write(folder.path(&format!("tank/{path}")), code.join("\n")).unwrap();
    }
    let output = folder.run("tank", env!("CARGO"), &["test", "--quiet"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let output = folder.fmu("tank", &["build", "--no-page"]);
    let why = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{why}");
    if cfg!(all(target_os = "linux", target_env = "gnu")) {
        assert!(
            why.contains("note: the library needs glibc 2.") && why.contains("for glibc 2.17, add --target"),
            "{why}"
        );
    }

    // An array is set as a whole, in both versions; in between its values would not rise.
    for fmi in ["2", "3"] {
        let run = ["run", "--fmi", fmi, "--set", "levels=0,2,4,6", "--show", "level,pumping,switches,flows"];
        let said = folder.says("tank", &run);
        assert!(
            said.contains("pumping   false and true\n") && said.contains("switches  from 0 to"),
            "{said}"
        );
        let table = folder.read("tank/target/fmu/tank.csv");
        assert_eq!(
            table.lines().next(),
            Some("time,level,pumping,switches,flows[1],flows[2],flows[3],flows[4]")
        );
        assert!(table.lines().nth(1).unwrap().starts_with("0,1,false,0,0,"), "{table}");
        for (values, words) in
            [("0,1", "levels has 4 elements, --set gives 2 values"), ("3,2,1,0", "levels must rise")]
        {
            let said = folder.rejects("tank", &["run", "--fmi", fmi, "--set", &format!("levels={values}")]);
            assert!(said.contains(words), "{said}");
        }
    }
    let fmus = ["--fmu", "target/fmu/tank.fmu", "--fmu", "target/fmu/fmi3/tank.fmu"];
    let options = ["check", "--fail-on", "fragile", "--no-shrink", "--repeat", "0.3"];
    let said = folder.says("tank", &[&options[..], &fmus].concat());
    assert!(said.contains("(FMI 2.0,") && said.contains("(FMI 3.0,"), "{said}");
}
