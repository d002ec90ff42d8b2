//! The model steps exactly, and becomes an FMU.

use fmi2_export::{Interface, Model};
use lag_fmu::{Lag, vr};
use std::process::Command;

#[test]
fn steps_are_exact() {
    let mut lag = Lag::new(Interface::CoSimulation);
    lag.set_real(vr::u, 2.0);
    for k in 0..10 {
        lag.do_step(f64::from(k) * 0.3, 0.3).unwrap();
    }
    assert!((lag.real(vr::x) - 2.0 * (1.0 - (-3.0_f64).exp())).abs() < 1e-15);
}

#[test]
fn build_fmu_makes_an_fmu() {
    let folder = tempfile::tempdir().unwrap();
    let output =
        Command::new(env!("CARGO_BIN_EXE_build_fmu_lag")).arg("--out").arg(folder.path()).output().unwrap();
    assert!(output.status.success(), "{output:?}");
    assert!(folder.path().join("lag.fmu").is_file());
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(text.contains("lag.fmu") && text.contains("guid {"), "{text}");
}
