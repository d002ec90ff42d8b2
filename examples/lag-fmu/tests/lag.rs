//! The model steps exactly, and becomes an FMU.

use fmu_export::*;
use lag_fmu::{Lag, Name};
use std::process::Command;

#[test]
fn steps_are_exact() {
    let mut lag = Lag::new(&Setup::new(Interface::CoSimulation)).unwrap();
    Lag::TABLE[Name::u as usize].set(&mut lag, &Value::Real(2.0));
    for k in 0..10 {
        let step = Step::new(f64::from(k) * 0.3, 0.3);
        assert_eq!(lag.step(step).unwrap(), Stepped::Done);
    }
    let Some(Value::Real(x)) = Lag::TABLE[Name::x as usize].value(&lag) else { panic!("x is a Real") };
    assert!((x - 2.0 * (1.0 - (-3.0_f64).exp())).abs() < 1e-15);
}

#[test]
fn build_fmu_makes_an_fmu() {
    let folder = tempfile::tempdir().unwrap();
    let output =
        Command::new(env!("CARGO_BIN_EXE_build_fmu_lag")).arg("--out").arg(folder.path()).output().unwrap();
    assert!(output.status.success(), "{output:?}");
    for name in ["lag.fmu", "fmi3/lag.fmu"] {
        assert!(folder.path().join(name).is_file(), "{name}");
    }
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(text.contains("lag.fmu") && text.contains("fmi3") && text.contains("guid {"), "{text}");
}

#[test]
fn build_fmu_makes_one_version_if_told_so() {
    let folder = tempfile::tempdir().unwrap();
    let mut build_fmu = Command::new(env!("CARGO_BIN_EXE_build_fmu_lag"));
    let output = build_fmu.args(["--fmi", "3", "--out"]).arg(folder.path()).output().unwrap();
    assert!(output.status.success(), "{output:?}");
    assert!(folder.path().join("fmi3/lag.fmu").is_file());
    assert!(!folder.path().join("lag.fmu").exists());

    let mut build_fmu = Command::new(env!("CARGO_BIN_EXE_build_fmu_lag"));
    let output = build_fmu.args(["--binary", "linux64=a.so", "--any-processor"]).output().unwrap();
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(
        text,
        "error: FMI 3.0 has a folder for every processor; --any-processor goes with --fmi 2 only\n"
    );
}

/// As it would be kept with the sources: without what changes with each of them.
#[test]
fn build_fmu_describes_the_model() {
    let folder = tempfile::tempdir().unwrap();
    let mut build_fmu = Command::new(env!("CARGO_BIN_EXE_build_fmu_lag"));
    let output = build_fmu.arg("--describe").arg("--out").arg(folder.path()).output().unwrap();
    assert!(output.status.success(), "{output:?}");
    let text = std::fs::read_to_string(folder.path().join("modelDescription.xml")).unwrap();
    assert!(text.contains("guid=\"{00000000-0000-0000-0000-000000000000}\""), "{text}");
    assert!(text.contains("<Unknown index=\"3\" dependencies=\"1 2\""), "{text}");

    let mut build_fmu = Command::new(env!("CARGO_BIN_EXE_build_fmu_lag"));
    let output = build_fmu.args(["--describe", "--fmi", "3", "--out"]).arg(folder.path()).output().unwrap();
    assert!(output.status.success(), "{output:?}");
    let text = std::fs::read_to_string(folder.path().join("modelDescription.xml")).unwrap();
    assert!(text.contains("instantiationToken=\"{00000000-0000-0000-0000-000000000000}\""), "{text}");
    assert!(text.contains("<ContinuousStateDerivative valueReference=\"3\" dependencies=\"1 2\""), "{text}");
}

#[test]
fn without_its_tools_no_c_sources_are_begun() {
    let folder = tempfile::tempdir().unwrap();
    let mut build_fmu = Command::new(env!("CARGO_BIN_EXE_build_fmu_lag"));
    let build_fmu = build_fmu.arg("--c-sources").arg("--out").arg(folder.path());
    let output = build_fmu.env("WASM2C", "/nowhere/wasm2c").output().unwrap();
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!output.status.success() && output.stdout.is_empty(), "{output:?}");
    assert!(text.starts_with("error: wasm2c ") && text.contains(" is missing (/nowhere/wasm2c)"), "{text}");
    assert_eq!(text.lines().count(), 1, "{text}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}
