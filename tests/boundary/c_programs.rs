//! C programs that load the shared library as importers do.
#![cfg(unix)]

use crate::c::{command, library, output, program};
use crate::exact::INPUTS;
use crate::modes::{enter_continuous_time, in_mode};
use crate::support::FUNCTIONS_OF_COMPONENTS;
use fmi2_export::Interface::{CoSimulation, ModelExchange};
use fmi2_export::call_table::Mode::*;
use fmi2_export::types::*;
use prw_testbed::variables::vr;
use std::collections::{BTreeMap, BTreeSet};
use std::mem::offset_of;
use std::process::Command;

/// Compiles tests/c/NAME.c and runs it with the library and its guid.
fn run(name: &str) -> String {
    let mut command = command(&program(name));
    output(command.arg(library("prw_testbed")).arg(crate::GUID_TEXT), "the compiled program does not run")
}

/// What the FMU writes in C is what it writes in Rust, and the types have the same layout.
#[test]
fn drive() {
    let printed = run("drive");
    let mut values: BTreeMap<&str, f64> = printed
        .lines()
        .map(|line| line.split_once(' ').unwrap())
        .map(|(k, v)| (k, v.parse().unwrap()))
        .collect();
    for (name, expected) in [
        ("sizeof_callbacks", size_of::<fmi2CallbackFunctions>()),
        ("offset_environment", offset_of!(fmi2CallbackFunctions, component_environment)),
        ("sizeof_event_info", size_of::<fmi2EventInfo>()),
        ("offset_next_event_time_defined", offset_of!(fmi2EventInfo, next_event_time_defined)),
        ("offset_next_event_time", offset_of!(fmi2EventInfo, next_event_time)),
        ("sizeof_status", size_of::<Status>()),
        ("sizeof_type", size_of::<fmi2Type>()),
        ("sizeof_status_kind", size_of::<fmi2StatusKind>()),
        ("sizeof_value_reference", size_of::<fmi2ValueReference>()),
        ("sizeof_boolean", size_of::<fmi2Boolean>()),
        ("pending", Status::Fatal as usize + 1),
    ] {
        assert_eq!(values.remove(name), Some(expected as f64), "{name}");
    }
    let outputs = [vr::tau1, vr::tau2, vr::pitch, vr::roll];
    assert_eq!(outputs, [4, 5, 6, 7], "as the C program has them");
    assert_eq!((&INPUTS[..], vr::use_omega), (&[0, 1, 2, 3][..], 32));
    for (prefix, expected) in [("cs", co_simulation(outputs)), ("me", model_exchange(outputs))] {
        for (i, expected) in expected.into_iter().enumerate() {
            assert_eq!(values.remove(format!("{prefix}{i}").as_str()), Some(expected), "{prefix}{i}");
        }
    }
    assert!(values.is_empty(), "{values:?}");
}

/// The Co-Simulation run of drive.c.
fn co_simulation(outputs: [u32; 4]) -> [f64; 4] {
    let fmu = in_mode(CoSimulation, StepComplete);
    for i in (0..64).map(f64::from) {
        fmu.set(&[vr::theta1, vr::theta2], &[i / 64.0, -i / 128.0]);
        fmu.step(i / 64.0, 1.0 / 64.0);
    }
    fmu.get(outputs)
}

/// The Model Exchange run of drive.c.
fn model_exchange(outputs: [u32; 4]) -> [f64; 4] {
    let fmu = in_mode(ModelExchange, Event);
    enter_continuous_time(&fmu);
    let (mut x, mut rates) = ([0.0; 6], [0.0; 6]);
    for i in (0..1024).map(f64::from) {
        fmu.set(&[vr::theta1, vr::omega1], &[i / 1024.0, 1.0]);
        fmu.ok(fmu.fmi2GetDerivatives(rates.as_mut_ptr(), 6));
        x = std::array::from_fn(|i| x[i] + rates[i] / 1024.0);
        fmu.ok(fmu.fmi2SetContinuousStates(x.as_ptr(), 6));
    }
    fmu.get(outputs)
}

/// A variadic logger that formats and one that does not show the same texts.
#[test]
fn loggers() {
    let printed = run("loggers");
    assert!(printed.contains("[wrist] fmi2Instantiate: the guid {_n_s_d} _r0_ 100_ is not"), "{printed}");
    assert!(printed.contains("[a#b] instantiated"), "{printed}");
    assert!(printed.contains("there is no log category '_s_s_n'"), "{printed}");
}

/// The library exports the 44 functions of FMI 2.0 and nothing else.
#[test]
fn exported_symbols() {
    let flags: &[&str] = if cfg!(target_os = "macos") { &["-gU"] } else { &["-D", "--defined-only"] };
    let printed =
        output(Command::new("nm").args(flags).arg(library("prw_testbed")), "this test needs nm (binutils)");
    let symbol = |line: &str| line.rsplit(' ').next().unwrap().trim_start_matches('_').to_owned();
    let exported: BTreeSet<_> = printed.lines().map(symbol).collect();
    let without_component = ["fmi2GetTypesPlatform", "fmi2GetVersion", "fmi2Instantiate", "fmi2FreeInstance"];
    let expected: BTreeSet<_> =
        FUNCTIONS_OF_COMPONENTS.iter().chain(&without_component).map(|name| (*name).to_owned()).collect();
    assert_eq!(expected.len(), 44);
    assert_eq!(exported, expected);
}
