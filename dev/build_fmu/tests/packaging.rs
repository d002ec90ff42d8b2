//! The output of `build_fmu`: the description, its variants, the FMU.

use fmi_abi::description::{ModelDescription, Unknown};
use fmi_abi::stamp::Stamp;
use fmi_abi::write::unzip;
use fmu_export::Variables;
use fmu_run::{Batch, Watch};
use prw_testbed::state_space::{StateSpace, state_space};
use prw_testbed::{BUILT_IN, TestbedFmu};
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

const COMMITTED_DESCRIPTION: &str =
    concat!(env!("CARGO_MANIFEST_DIR"), "/../../modelDescription/modelDescription.xml");
const PARAMETERS_JSON: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../modelDescription/parameters.json");

fn build_fmu(arguments: &[&str], out: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_build_fmu")).args(arguments).arg("--out").arg(out).output().unwrap()
}

fn errors(output: &Output) -> String {
    assert!(!output.status.success(), "{output:?}");
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Returns the description that `build_fmu` writes with these arguments.
fn description(arguments: &[&str]) -> String {
    let directory = tempfile::tempdir().unwrap();
    let output = build_fmu(&[&["--describe"], arguments].concat(), directory.path());
    assert!(output.status.success(), "{output:?}");
    fs::read_to_string(directory.path().join("modelDescription.xml")).unwrap()
}

/// Writes a copy of `parameters.json` in which `new` replaces `old`. Returns its path.
fn parameter_file(directory: &Path, old: &str, new: &str) -> String {
    let table = fs::read_to_string(PARAMETERS_JSON).unwrap();
    assert!(table.contains(old));
    let path = directory.join("mine.json");
    fs::write(&path, table.replace(old, new)).unwrap();
    path.to_str().unwrap().to_owned()
}

#[test]
fn the_committed_description_is_up_to_date() {
    assert!(
        fs::read_to_string(COMMITTED_DESCRIPTION).unwrap_or_default() == description(&[]),
        "modelDescription/modelDescription.xml is out of date; update it with\n    \
         cargo run --bin build_fmu -- --describe"
    );
}

#[test]
fn it_reads_back_as_the_model_that_was_compiled() {
    let read = ModelDescription::parse(&description(&[])).unwrap();
    // The description that is kept with the sources has no guid, because the guid changes whenever they do.
    assert_eq!(read.token, fmu_package::NO_GUID);
    assert_eq!(read.model_name, "PitchRollWristTestbed");
    assert_eq!(read.derivatives.len(), 6);
    let names: Vec<&str> = read.variables.iter().map(|variable| variable.name.as_str()).collect();
    let table: Vec<&str> = TestbedFmu::TABLE.iter().map(|variable| variable.name()).collect();
    assert_eq!(names, table);
}

/// Returns the names of the states and inputs whose coefficients are not zero in one row of A and B, or of C and D.
fn nonzero_names(names: [&[&'static str]; 2], rows: [Vec<f64>; 2]) -> BTreeSet<&'static str> {
    let pairs = names.into_iter().zip(rows).flat_map(|(names, row)| names.iter().zip(row));
    pairs.filter(|(_, factor)| *factor != 0.0).map(|(name, _)| *name).collect()
}

/// Expected dependencies of some of the initial unknowns. Each also depends on `start_at_rest`, which is left out here.
const INITIAL_DEPENDENCIES: [(&str, &[&str]); 11] = [
    ("theta3", &["theta1", "theta3_start"]),
    ("theta4", &["theta2", "theta4_start"]),
    ("theta5", &["theta1", "theta5_start"]),
    ("theta6", &["theta2", "theta6_start"]),
    ("omega5", &["omega5_start"]),
    ("omega6", &["omega6_start"]),
    (
        "tau1",
        &[
            "theta1",
            "omega1",
            "theta3_start",
            "theta5_start",
            "omega5_start",
            "k1",
            "k2",
            "c1",
            "c2",
            "use_omega",
        ],
    ),
    (
        "der(theta4)",
        &[
            "theta2",
            "omega2",
            "theta4_start",
            "theta6_start",
            "omega6_start",
            "k1",
            "k2",
            "c1",
            "c2",
            "use_omega",
        ],
    ),
    ("roll_rate", &["omega5_start", "omega6_start", "M", "N"]),
    ("pitch", &["theta1", "theta2", "theta5_start", "theta6_start"]),
    ("der(theta5)", &["omega5_start"]),
];

/// Compares the dependencies, which the build finds from the model's partial derivatives, with the matrices of eq. (11), which
/// independent code calculates.
#[test]
fn dependencies_are_the_sparsity_of_the_matrices() {
    let read = ModelDescription::parse(&description(&[])).unwrap();
    let name = |index: usize| read.variables[index].name.as_str();
    let listed = |list: &[Unknown], unknown: &str| -> BTreeSet<String> {
        let Some(entry) = list.iter().find(|entry| name(entry.variable) == unknown) else {
            panic!("{unknown} is not listed");
        };
        let dependencies = entry.dependencies.as_ref().unwrap();
        assert_eq!(dependencies.len(), entry.kinds.len());
        assert!(dependencies.is_sorted());
        dependencies.iter().map(|index| name(*index).to_owned()).collect()
    };
    let inputs = ["theta1", "theta2", "omega1", "omega2"];
    let states = ["theta3", "theta4", "theta5", "theta6", "omega5", "omega6"];
    let StateSpace { A, B, C, D } = state_space(&BUILT_IN);
    let owned = |set: BTreeSet<&str>| set.into_iter().map(str::to_owned).collect::<BTreeSet<_>>();

    for (row, state) in states.iter().enumerate() {
        let expected = nonzero_names(
            [&states, &inputs],
            [A.row(row).iter().copied().collect(), B.row(row).iter().copied().collect()],
        );
        assert_eq!(listed(&read.derivatives, &format!("der({state})")), owned(expected));
    }
    // y of eq. (11) is theta3, theta4, theta1, theta2, tau1, tau2.
    for (row, output) in [(0, "theta3"), (1, "theta4"), (4, "tau1"), (5, "tau2")] {
        let expected = nonzero_names(
            [&states, &inputs],
            [C.row(row).iter().copied().collect(), D.row(row).iter().copied().collect()],
        );
        assert_eq!(listed(&read.outputs, output), owned(expected));
    }
    for (output, expected) in [
        ("pitch", ["theta5", "theta6"]),
        ("roll", ["theta5", "theta6"]),
        ("pitch_rate", ["omega5", "omega6"]),
        ("roll_rate", ["omega5", "omega6"]),
    ] {
        assert_eq!(listed(&read.outputs, output), owned(expected.into()));
    }
    for (unknown, expected) in INITIAL_DEPENDENCIES {
        let expected: BTreeSet<&str> = expected.iter().copied().chain(["start_at_rest"]).collect();
        assert_eq!(listed(&read.initial_unknowns, unknown), owned(expected));
    }
    assert_eq!(read.initial_unknowns.len(), 18);
}

#[test]
fn tunable_parameters_make_another_fmu() {
    // `fixed` occurs in the description only as a value of `variability` and `dependenciesKind`.
    assert_eq!(description(&["--tunable"]), description(&[]).replace("fixed", "tunable"));
}

#[test]
fn other_parameters_are_other_start_values() {
    let directory = tempfile::tempdir().unwrap();
    let file = parameter_file(
        directory.path(),
        "\"value\": 2.11, \"unit\": \"N.m/deg\"",
        "\"value\": 99.5, \"unit\": \"N.m/rad\"",
    );
    let (before, after) = (description(&[]), description(&["--parameters", &file]));
    let changed: Vec<_> =
        before.lines().zip(after.lines()).filter(|(a, b)| a != b).map(|(_, b)| b.trim()).collect();
    assert_eq!(changed.len(), 1, "{changed:?}");
    assert!(
        changed[0].starts_with(r#"<Real declaredType="RotationalSpringConstant" start="99.5" "#),
        "{changed:?}"
    );
    // Importers that set every parameter as a Real cannot set these two.
    let file = parameter_file(
        directory.path(),
        "\"value\": 4, \"unit\": \"1\"",
        "\"value\": 2, \"unit\": \"1\" }, \"use_omega\": { \"value\": true",
    );
    let after = description(&["--parameters", &file]);
    let changed: Vec<_> =
        before.lines().zip(after.lines()).filter(|(a, b)| a != b).map(|(_, b)| b.trim()).collect();
    assert_eq!(
        changed,
        [r#"<Integer declaredType="Integer_from_1" start="2" min="1"/>"#, r#"<Boolean start="true"/>"#]
    );
    // The same values from another file give the same description.
    let copy = parameter_file(directory.path(), "meaning", "meaning");
    assert_eq!(description(&["--parameters", &copy]), before);
}

/// Builds the FMU for FMI 2.0 without its page. Returns the output of the program and the FMU.
fn fmu(arguments: &[&str]) -> (String, Vec<u8>) {
    let directory = tempfile::tempdir().unwrap();
    let output = build_fmu(&[&["--no-page", "--fmi", "2"], arguments].concat(), directory.path());
    assert!(output.status.success(), "{output:?}");
    (String::from_utf8(output.stdout).unwrap(), fs::read(directory.path().join("prw_testbed.fmu")).unwrap())
}

/// The guid depends on the options and on every digit of the parameters, but not on the format of their file. The library contains the
/// parameters, although it is not compiled again.
#[test]
fn every_variant_has_a_separate_guid() {
    let directory = tempfile::tempdir().unwrap();
    let with_k1 = |value: &str| {
        let file = parameter_file(
            directory.path(),
            "\"value\": 2.11, \"unit\": \"N.m/deg\"",
            &format!("\"value\": {value}"),
        );
        fmu(&["--parameters", &file])
    };
    let same = with_k1("2.110, \"unit\": \"N.m/deg\"").1;
    let default = fmu(&[]).1;
    assert!(same == default, "the values of Table 1 from another file must give the same FMU");
    let other = with_k1("99.5, \"unit\": \"N.m/rad\"");
    let near = with_k1("99.50000000000001, \"unit\": \"N.m/rad\"");
    let all = [(String::new(), default), other, near, fmu(&["--tunable"])];
    let guids: BTreeSet<_> = all.iter().map(|(_, fmu)| guid(fmu)).collect();
    assert_eq!(guids.len(), all.len());
    for ((printed, fmu), variant) in all.iter().skip(1).zip(["parameters from", "parameters from", "tunable"])
    {
        assert!(printed.contains(&guid(fmu)) && printed.contains(variant), "{printed}");
    }
    let k1 = |fmu: &[u8]| {
        let out = directory.path().join("k1.fmu");
        fs::write(&out, fmu).unwrap();
        // SAFETY: the FMU of this project.
        #[allow(unsafe_code)]
        let fmu = unsafe { fmu_run::Fmu::open(&out) }.unwrap();
        let batch = Batch { time: &[0.0, 1e-3], outputs: vec!["k1"], every: Some(1), ..Batch::default() };
        fmu.system().run(&batch, &Watch::default()).unwrap().trajectories[0]
    };
    assert_eq!(all.each_ref().map(|(_, fmu)| k1(fmu)), [BUILT_IN.k1, 99.5, 99.5_f64.next_up(), BUILT_IN.k1]);
}

fn guid(fmu: &[u8]) -> String {
    let description = String::from_utf8(unzip(fmu, "modelDescription.xml").unwrap()).unwrap();
    ModelDescription::parse(&description).unwrap().token
}

#[test]
fn wrong_requests_are_rejected_in_one_line() {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().join("out");
    let file = parameter_file(directory.path(), "\"value\": 2.11", "\"value\": -2.11");
    let extreme = tempfile::tempdir().unwrap();
    let extreme = parameter_file(extreme.path(), "\"value\": 2.11", "\"value\": 1e306");
    // Two universal libraries of macOS with a part for Intel: a header of a library without load commands alone, and followed by the name
    // of an FMI function.
    let part = [0xfeed_facf_u32, 0x0100_0007, 3, 6, 0, 0, 0, 0].map(u32::to_le_bytes).concat();
    let [empty, library] = [("empty", &b""[..]), ("a", b"fmi2Instantiate")].map(|(name, content)| {
        let size = (part.len() + content.len()) as u32;
        let header = [0xcafe_babe, 1, 0x0100_0007, 3, 28, size, 2].map(u32::to_be_bytes).concat();
        let library = directory.path().join(name).with_extension("dylib");
        fs::write(&library, [&header, &part, content].concat()).unwrap();
        library.to_str().unwrap().to_owned()
    });
    for (arguments, message) in [
        (&["--parameters", file.as_str()][..], "mine.json: in SI units: k1 must be > 0, it is -120.89"),
        (
            &["--parameters", extreme.as_str()],
            "mine.json: the model cannot be instantiated for Co-Simulation: the parameters are too far",
        ),
        (&["--parameters", "none.json"], "none.json: cannot be read"),
        (&["--binary", "linux65=a.so"], "'linux65' is not a platform of FMI 2.0"),
        (&["--binary", "linux64=none.so"], "cannot read none.so, the library for linux64"),
        (&["--binary", &format!("linux64={file}")], "it is not a shared library"),
        (&["--binary", &format!("win64={library}")], "it is for darwin64, not for win64"),
        (&["--binary", &format!("aarch64-darwin={library}")], "add --any-processor"),
        (&["--binary", &format!("darwin64={library}")], "it has no place for the guid"),
        (&["--binary", &format!("darwin64={empty}")], "has no functions of FMI"),
        (&["--target", "sparc"], "no FMU platform is known for the target 'sparc'"),
    ] {
        let text = errors(&build_fmu(arguments, &out));
        // Lines that report the progress of cargo may come before.
        let last = text.lines().last().unwrap_or_default();
        assert!(last.starts_with("error: ") && last.contains(message), "{text}");
    }
    assert!(!out.exists());
    let into_the_sources =
        Command::new(env!("CARGO_BIN_EXE_build_fmu")).args(["--describe", "--tunable"]).output();
    let text = errors(&into_the_sources.unwrap());
    assert!(text.contains("--out"), "{text}");
}

/// A library whose table of variables differs would read and set other variables than the description names.
#[test]
#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
fn libraries_of_other_sources_are_rejected() {
    let directory = tempfile::tempdir().unwrap();
    let own = unzip(&fmu(&[]).1, "binaries/linux64/prw_testbed.so").unwrap();
    let mut other = own.clone();
    let [position] = Stamp::positions(&own)[..] else { panic!("the library must have one stamp") };
    Stamp::new(1).write(&mut other, position);
    let [own, other] = [("own.so", own), ("other.so", other)].map(|(name, library)| {
        let path = directory.path().join(name);
        fs::write(&path, library).unwrap();
        path.display().to_string()
    });
    let arguments = ["--binary", &format!("linux64={own}"), "--binary", &format!("aarch64-linux={other}")];
    let out = directory.path().join("out");
    let text = errors(&build_fmu(&[&arguments[..], &["--fmi", "2", "--any-processor"]].concat(), &out));
    assert!(text.contains("the library for aarch64-linux has other variables than the model"), "{text}");
    assert!(!out.exists());
}

/// The program finds the project at run time, so in a copy of the clone it does not write into the original.
#[test]
#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
fn a_copied_clone_builds_in_its_own_place() {
    let directory = tempfile::tempdir().unwrap();
    let library = directory.path().join("prw_testbed.so");
    fs::write(&library, unzip(&fmu(&[]).1, "binaries/linux64/prw_testbed.so").unwrap()).unwrap();
    let copy = directory.path().join("copy");
    fs::create_dir(&copy).unwrap();
    let sources = ["Cargo.toml", "Cargo.lock", "build.rs", "build_fmu.rs", "LICENSE-APACHE", "LICENSE-MIT"];
    let directories = ["crates", "dev", "docs", "examples", "modelDescription", "src", "tests"];
    let copied = Command::new("cp")
        .args(["-r", "--no-dereference"])
        .args(sources.iter().chain(&directories))
        .arg(&copy)
        .current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
        .status();
    assert!(copied.unwrap().success());
    let output = Command::new(env!("CARGO_BIN_EXE_build_fmu"))
        .args(["--no-page", "--fmi", "2", "--binary", &format!("linux64={}", library.display())])
        .env_remove("CARGO_MANIFEST_DIR")
        .current_dir(copy.join("crates"))
        .output()
        .unwrap();
    assert!(output.status.success(), "{output:?}");
    assert!(copy.join("target/fmu/prw_testbed.fmu").is_file(), "{output:?}");
    let elsewhere = Command::new(env!("CARGO_BIN_EXE_build_fmu"))
        .env_remove("CARGO_MANIFEST_DIR")
        .current_dir(directory.path())
        .output();
    let text = errors(&elsewhere.unwrap());
    assert!(text.contains("is not in the project of prw_testbed; change to its directory"), "{text}");
}

#[test]
fn two_builds_give_the_same_fmu_with_the_committed_description() {
    let (one, other) = (fmu(&[]).1, fmu(&[]).1);
    assert!(one == other, "the same sources gave two different FMUs");

    let read = |name: &str| String::from_utf8(unzip(&one, name).unwrap()).unwrap();
    let described = description(&[]).replace(fmu_package::NO_GUID, &guid(&one));
    assert!(
        read("modelDescription.xml") == described,
        "the description in the FMU differs from the description of the sources"
    );
    for name in ["license.txt", "LICENSE-APACHE", "LICENSE-MIT"] {
        assert!(!read(&format!("documentation/licenses/{name}")).is_empty(), "{name}");
    }
}

/// The licences in the FMUs name exactly the packages that are compiled into their libraries.
#[test]
fn the_licenses_of_all_packages_are_listed() {
    let licenses = [
        ("prw_testbed", include_str!("../../../modelDescription/licenses/license.txt")),
        (
            "prw_controller",
            include_str!("../../../examples/controller/modelDescription/licenses/license.txt"),
        ),
    ];
    for (package, license) in licenses {
        let output = Command::new(env!("CARGO"))
            .args(["tree", "--locked", "--package", package, "--no-default-features", "--edges"])
            .args(["normal,no-proc-macro", "--prefix", "none", "--format", "{p}"])
            .current_dir(env!("CARGO_MANIFEST_DIR"))
            .output()
            .unwrap();
        assert!(output.status.success(), "{output:?}");
        let tree = String::from_utf8(output.stdout).unwrap();
        // Parentheses mark a package of this project, by its path, or a package that was listed before.
        let compiled: BTreeSet<&str> = tree
            .lines()
            .filter(|line| !line.contains('('))
            .filter_map(|line| line.split(' ').next())
            .collect();
        // A comma follows the names of code that is not a package of cargo.
        let items = license.lines().filter_map(|line| line.strip_prefix("  * "));
        let named: BTreeSet<&str> = items.filter(|name| !name.contains(',')).collect();
        assert_eq!(compiled, named, "modelDescription/licenses/license.txt of {package} is out of date");
    }
}
