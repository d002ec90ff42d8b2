//! C programs that load shared libraries as importers do, compiled with the standards' own headers; and the types of the
//! functions of FMI 2.0, compared with those headers by the C compiler (of FMI 3.0: `tests/fmi3/headers.rs`).
#![cfg(unix)]
#![allow(missing_docs)]

mod toys;

use fmu_export::Interface::ModelExchange;
use fmu_export::Model;
use fmu_export::fmi2::types::*;
use fmu_test_kit::c_programs::{check_syntax, command, compile, headers, library, output, reload};
use fmu_test_kit::either::Either;
use fmu_test_kit::{FUNCTIONS, Importer, fmi3};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::mem::offset_of;
use std::path::{Path, PathBuf};
use std::process::Command;
use toys::{Oscillator, oscillator::Name};

/// The functions that work on no instance, of both standards.
const WITHOUT_INSTANCE: [&str; 9] = [
    "fmi2GetTypesPlatform",
    "fmi2GetVersion",
    "fmi2Instantiate",
    "fmi2FreeInstance",
    "fmi3GetVersion",
    "fmi3InstantiateModelExchange",
    "fmi3InstantiateCoSimulation",
    "fmi3InstantiateScheduledExecution",
    "fmi3FreeInstance",
];

fn program(name: &str) -> PathBuf {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/c").join(name).with_extension("c");
    compile(&source, Path::new(env!("CARGO_TARGET_TMPDIR")))
}

/// Compiles tests/c/NAME.c and runs it with the oscillator's library and its guid.
fn run(name: &str) -> String {
    let mut command = command(&program(name));
    output(command.arg(library("oscillator")).arg(Oscillator::INFO.guid), "the compiled program does not run")
}

const OUTPUTS: [Name; 4] = [Name::position, Name::velocity, Name::spring_force, Name::energy];

/// The lines `name value` that a program prints.
fn values(printed: &str) -> BTreeMap<&str, f64> {
    let pairs = printed.lines().map(|line| line.split_once(' ').unwrap());
    pairs.map(|(name, value)| (name, value.parse().unwrap())).collect()
}

/// What the FMU writes in C is what it writes in Rust, and the types have the same layout.
#[test]
fn drive() {
    let printed = run("drive");
    let mut values = values(&printed);
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
    same_runs::<Importer>(values);
}

/// The same of FMI 3.0, whose types `tests/fmi3/headers.rs` compares.
#[test]
fn drive3() {
    same_runs::<fmi3::Importer>(values(&run("drive3")));
}

/// Both runs of a program come to the same ends as in Rust.
fn same_runs<F: Either>(mut values: BTreeMap<&str, f64>) {
    assert_eq!(OUTPUTS.map(|name| name as u32), [1, 2, 5, 6], "as the C programs have them");
    for (prefix, expected) in [("cs", co_simulation::<F>()), ("me", model_exchange())] {
        for (i, expected) in expected.into_iter().enumerate() {
            assert_eq!(values.remove(format!("{prefix}{i}").as_str()), Some(expected), "{prefix}{i}");
        }
    }
    assert!(values.is_empty(), "{values:?}");
}

/// The Co-Simulation run of the programs.
fn co_simulation<F: Either>() -> [f64; 4] {
    let (fmu, mut values) = (F::initialized::<Oscillator>(), [f64::NAN; 4]);
    for i in (0..64).map(f64::from) {
        fmu.write(&[Name::force as u32], &[i / 64.0]);
        fmu.advance(i / 64.0, 1.0 / 64.0);
    }
    fmu.read(&OUTPUTS.map(|name| name as u32), &mut values);
    values
}

/// The Model Exchange run of the programs; FMI 3.0 has the same bits (`tests/fmi3/same.rs`).
fn model_exchange() -> [f64; 4] {
    let fmu = Importer::of::<Oscillator>(ModelExchange);
    fmu.initialize(0.0);
    fmu.ok(fmu.fmi2EnterContinuousTimeMode());
    let (mut x, mut rates) = ([0.0; 2], [0.0; 2]);
    for i in (0..1024).map(f64::from) {
        fmu.set(&[Name::force as u32], &[i / 1024.0]);
        fmu.ok(fmu.fmi2GetDerivatives(rates.as_mut_ptr(), 2));
        x = std::array::from_fn(|i| x[i] + rates[i] / 1024.0);
        fmu.ok(fmu.fmi2SetContinuousStates(x.as_ptr(), 2));
    }
    fmu.get(OUTPUTS.map(|name| name as u32))
}

/// A variadic logger that formats and one that does not show the same texts.
#[test]
fn loggers() {
    let printed = run("loggers");
    assert!(printed.contains("[toy] fmi2Instantiate: the guid {_n_s_d} _r0_ 100_ is not"), "{printed}");
    assert!(printed.contains("[a#b] instantiated"), "{printed}");
    assert!(printed.contains("there is no log category '_s_s_n'"), "{printed}");
}

/// Alone and side by side.
#[cfg(target_os = "linux")]
#[test]
fn loading_and_unloading_leaves_nothing_behind() {
    let program = program("reload");
    reload(&program, &["oscillator"]);
    reload(&program, &["oscillator", "talker"]);
}

/// The library exports the 44 functions of FMI 2.0, the 75 of FMI 3.0 and nothing else.
#[test]
fn exported_symbols() {
    let flags: &[&str] = if cfg!(target_os = "macos") { &["-gU"] } else { &["-D", "--defined-only"] };
    let printed =
        output(Command::new("nm").args(flags).arg(library("oscillator")), "this test needs nm (binutils)");
    let symbol = |line: &str| line.rsplit(' ').next().unwrap().trim_start_matches('_').to_owned();
    let exported: BTreeSet<_> = printed.lines().map(symbol).collect();
    let expected = FUNCTIONS.iter().chain(fmi3::FUNCTIONS).chain(&WITHOUT_INSTANCE);
    let expected: BTreeSet<_> = expected.map(|name| (*name).to_owned()).collect();
    assert_eq!(expected.len(), 44 + 75);
    assert_eq!(exported, expected);
    // And the standards' headers declare just these.
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
    assert_eq!(declared, expected);
}

/// A type of C as Rust's declaration has it.
fn c_type(rust: &str) -> String {
    let rust: String = rust.chars().filter(|c| *c != ' ').collect();
    match rust.strip_prefix("*mut").or_else(|| rust.strip_prefix("*const")) {
        Some(to) => format!("{} {}*", c_type(to), if rust.starts_with("*const") { "const" } else { "" }),
        None => match rust.as_str() {
            "usize" => "size_t".into(),
            "Status" => "fmi2Status".into(),
            name => name.into(),
        },
    }
}

/// Declarations of C, made from the list that all of Rust's come from.
macro_rules! declarations {
    (
        $standard:ident $handle:ident
        without an instance { $($free:ident($($free_argument:ident: $free_type:ty),*) -> $result:ty;)+ }
        with an instance {
            $($function:ident $cs:literal $me:literal $tolerated:literal ($($argument:ident: $type:ty),*);)+
        }
    ) => {
        fn declarations() -> Vec<(&'static str, Vec<String>)> {
            vec![$((stringify!($function), vec![$(c_type(stringify!($type))),*])),+]
        }
    };
}

fmu_export::fmi2_functions!(declarations);

/// The C compiler compares: each function, declared with the types that Rust has, is assigned to a pointer of the type in
/// the standard's header.
#[test]
fn signatures() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let source = folder.join("signatures.c");
    let mut text = String::from("#include <stddef.h>\n#include \"fmi2FunctionTypes.h\"\n");
    let mut all = declarations();
    assert_eq!(all.len(), 40);
    all.iter_mut().for_each(|(_, arguments)| arguments.insert(0, "fmi2Component".into()));
    for (name, arguments) in all {
        let arguments = arguments.join(", ");
        writeln!(text, "fmi2Status rust_{name}({arguments});\n{name}TYPE *{name} = rust_{name};").unwrap();
    }
    text += "int main(void) { return 0; }\n";
    let headers = headers(Path::new(env!("CARGO_MANIFEST_DIR")));
    let compile = |text: &str| {
        std::fs::write(&source, text).unwrap();
        check_syntax(&source, &headers)
    };
    assert_eq!(compile(&text), Ok(()));
    // A type that differs is seen.
    let [right, wrong] =
        ["rust_fmi2SetTime(fmi2Component, fmi2Real)", "rust_fmi2SetTime(fmi2Component, float)"];
    assert!(text.contains(right));
    assert!(compile(&text.replace(right, wrong)).is_err_and(|error| error.contains("fmi2SetTime")));
}
