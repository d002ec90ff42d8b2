//! C programs that load shared libraries as importers do, compiled with the headers of the FMI standards. The C compiler
//! also checks that the types of all functions agree with these headers.
#![cfg(unix)]
#![allow(missing_docs)]

use fmu_test_kit::models;

use fmu_export::Interface::ModelExchange;
use fmu_export::Mode::ContinuousTime;
use fmu_export::Standard;
use fmu_export::fmi2::types::*;
use fmu_test_kit::c_programs::{check_syntax, command, compile, headers, library, output, reload};
use fmu_test_kit::calls;
use fmu_test_kit::{Either, Importer};
use models::{Oscillator, oscillator::Name};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::mem::offset_of;
use std::path::{Path, PathBuf};
use std::process::Command;

fn program(name: &str) -> PathBuf {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/c").join(name).with_extension("c");
    compile(&source, Path::new(env!("CARGO_TARGET_TMPDIR")))
}

/// Compiles tests/c/NAME.c and runs it with the oscillator's library and its guid.
fn run(name: &str) -> String {
    let mut command = command(&program(name));
    output(
        command.arg(library("oscillator")).arg(fmu_export::guid::<Oscillator>()),
        "the compiled program does not run",
    )
}

const OUTPUTS: [u32; 4] =
    [Name::position as u32, Name::velocity as u32, Name::spring_force as u32, Name::energy as u32];

/// Checks that an importer in C gets the same values from the FMU as one in Rust, and that types have the same sizes and
/// offsets in both languages. This program uses FMI 2.0; `reload` also uses FMI 3.0.
#[test]
fn drive() {
    let printed = run("drive");
    let pairs = printed.lines().map(|line| line.split_once(' ').unwrap());
    let mut values: BTreeMap<&str, f64> = pairs.map(|(name, value)| (name, value.parse().unwrap())).collect();
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
    assert_eq!(OUTPUTS, [1, 2, 5, 6], "must be the indices in the C program");
    for (prefix, expected) in [("cs", co_simulation()), ("me", model_exchange())] {
        for (i, expected) in expected.into_iter().enumerate() {
            assert_eq!(values.remove(format!("{prefix}{i}").as_str()), Some(expected), "{prefix}{i}");
        }
    }
    assert!(values.is_empty(), "{values:?}");
}

/// Performs the same Co-Simulation run as the C program; returns the outputs at its end.
fn co_simulation() -> [f64; 4] {
    let fmu = Importer::initialized_at::<Oscillator>(0.0);
    for i in (0..64).map(f64::from) {
        fmu.set(&[Name::force as u32], &[i / 64.0]);
        fmu.step(i / 64.0, 1.0 / 64.0);
    }
    fmu.get(OUTPUTS)
}

/// Performs the same Model Exchange run as the C program; returns the outputs at its end.
fn model_exchange() -> [f64; 4] {
    let fmu = Importer::in_mode::<Oscillator>(ModelExchange, ContinuousTime);
    let mut x = [0.0; 2];
    for i in (0..1024).map(f64::from) {
        fmu.set(&[Name::force as u32], &[i / 1024.0]);
        let rates = fmu.derivatives::<2>();
        x = std::array::from_fn(|i| x[i] + rates[i] / 1024.0);
        fmu.ok(fmu.set_states(x.as_ptr(), 2));
    }
    fmu.get(OUTPUTS)
}

/// Checks that a logger that formats a message with `printf` shows the same text as one that uses the message unchanged.
#[test]
fn loggers() {
    let printed = run("loggers");
    assert!(printed.contains("[model] fmi2Instantiate: the guid {_n_s_d} _r0_ 100_ is not"), "{printed}");
    assert!(printed.contains("[a#b] instantiated"), "{printed}");
    assert!(printed.contains("there is no log category '_s_s_n'"), "{printed}");
}

/// Checks that loading and unloading leaks no memory, with one library and with two libraries at the same time.
#[cfg(target_os = "linux")]
#[test]
fn loading_and_unloading_leaks_nothing() {
    let program = program("reload");
    reload(&program, &["oscillator"]);
    reload(&program, &["oscillator", "talker"]);
}

/// Checks that the library exports only the 44 functions of FMI 2.0, the 75 of FMI 3.0, and two functions that
/// fmu-package calls.
#[test]
fn exported_symbols() {
    let flags: &[&str] = if cfg!(target_os = "macos") { &["-gU"] } else { &["-D", "--defined-only"] };
    let printed =
        output(Command::new("nm").args(flags).arg(library("oscillator")), "this test needs nm (binutils)");
    let symbol = |line: &str| line.rsplit(' ').next().unwrap().trim_start_matches('_').to_owned();
    let mut exported: BTreeSet<_> = printed.lines().map(symbol).collect();
    for of_build in ["fmu_export_describe", "fmu_export_report_panics"] {
        assert!(exported.remove(of_build), "{exported:?}");
    }
    assert_eq!(exported.len(), 44 + 75);
    // The headers of the standards declare the same functions.
    let headers = headers(Path::new(env!("CARGO_MANIFEST_DIR")));
    let mut declared = BTreeSet::new();
    for version in ["2", "3"] {
        let header = std::fs::read_to_string(headers.join(format!("fmi{version}Functions.h"))).unwrap();
        let lines = header
            .lines()
            .map(str::trim)
            .filter(|line| line.starts_with(&format!("FMI{version}_Export fmi")));
        declared.extend(lines.map(|line| line.trim_end_matches(';').rsplit_once(' ').unwrap().1.to_owned()));
    }
    assert_eq!(declared, exported);
}

/// Returns the type of C for a type in a Rust declaration.
fn c_type(rust: &str) -> String {
    let rust: String = rust.chars().filter(|c| *c != ' ').collect();
    match rust.strip_prefix("*mut").or_else(|| rust.strip_prefix("*const")) {
        Some(to) => format!("{} {}*", c_type(to), if rust.starts_with("*const") { "const" } else { "" }),
        None => {
            if rust == "usize" {
                "size_t".into()
            } else {
                rust
            }
        }
    }
}

/// Checks the types of all functions with the C compiler. In a C file, each function is declared with the types that it has
/// in Rust and assigned to a pointer of the type in the standard's header. The sizes of the types of FMI 3.0 are asserted.
#[test]
fn signatures() {
    use fmu_export::fmi3::types::*;
    #[allow(non_camel_case_types, reason = "as in C")]
    type fmi3Status = Status;
    macro_rules! sizes {
        ($($name:ident)+) => { [$((stringify!($name), size_of::<$name>())),+] };
    }
    // Both declarations use the same names of types, so the sizes of these types are compared separately.
    let sizes = sizes! {
        fmi3Status fmi3Boolean fmi3Clock fmi3DependencyKind fmi3IntervalQualifier
        fmi3Instance fmi3InstanceEnvironment fmi3FMUState fmi3ValueReference
        fmi3Float32 fmi3Float64 fmi3Int8 fmi3UInt8 fmi3Int16 fmi3UInt16 fmi3Int32 fmi3UInt32 fmi3Int64 fmi3UInt64
        fmi3Char fmi3String fmi3Byte fmi3Binary
        fmi3LogMessageCallback fmi3ClockUpdateCallback fmi3IntermediateUpdateCallback
        fmi3LockPreemptionCallback fmi3UnlockPreemptionCallback
    };
    let mut of_fmi3 =
        String::from("_Static_assert(fmi3Fatal == 4 && fmi3Dependent == 5, \"enumerations\");\n");
    for (name, size) in sizes {
        writeln!(of_fmi3, "_Static_assert(sizeof({name}) == {size}, \"{name}\");").unwrap();
    }
    check_signatures(Standard::Fmi2, "fmi2", "fmi2Component", 40, "");
    check_signatures(Standard::Fmi3, "fmi3", "fmi3Instance", 70, &of_fmi3);
}

fn check_signatures(version: Standard, standard: &str, handle: &str, count: usize, more: &str) {
    let source = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("signatures_{standard}.c"));
    let mut text = format!("#include <stddef.h>\n#include \"{standard}FunctionTypes.h\"\n{more}");
    assert_eq!(calls::signatures(version).len(), count);
    for signature in calls::signatures(version) {
        let arguments: Vec<_> = signature.arguments.iter().map(|argument| c_type(argument.of)).collect();
        let (name, arguments) = (signature.rule.name, [vec![handle.into()], arguments].concat().join(", "));
        writeln!(text, "{standard}Status rust_{name}({arguments});\n{name}TYPE *{name} = rust_{name};")
            .unwrap();
    }
    text += "int main(void) { return 0; }\n";
    let headers = headers(Path::new(env!("CARGO_MANIFEST_DIR")));
    let compile = |text: &str| {
        std::fs::write(&source, text).unwrap();
        check_syntax(&source, &headers)
    };
    assert_eq!(compile(&text), Ok(()));
    // The compiler detects a type that differs.
    let right = text.lines().find(|line| line.contains("SetTime(")).unwrap();
    let wrong = format!("{standard}Status rust_{standard}SetTime({handle}, float);");
    let error = compile(&text.replace(right, &wrong)).unwrap_err();
    assert!(error.contains(&format!("{standard}SetTime")), "{error}");
}
