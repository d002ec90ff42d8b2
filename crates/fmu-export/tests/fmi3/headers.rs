//! The functions have the types of the standard's headers: a C program says so when it is compiled.

use fmu_test_kit::fmi3::FUNCTIONS;
use std::fmt::Write;
use std::process::Command;

/// The types as C sees those of this crate. `bool` and bytes are one type to it in all but name.
#[test]
fn types() {
    use fmu_export::fmi3::types::*;
    #[allow(non_camel_case_types, reason = "as in C")]
    type fmi3Status = Status;
    macro_rules! sizes {
        ($($name:ident)+) => { [$((stringify!($name), size_of::<$name>())),+] };
    }
    let sizes = sizes! {
        fmi3Status fmi3Boolean fmi3Clock fmi3DependencyKind fmi3IntervalQualifier
        fmi3Instance fmi3InstanceEnvironment fmi3FMUState fmi3ValueReference
        fmi3Float32 fmi3Float64 fmi3Int8 fmi3UInt8 fmi3Int16 fmi3UInt16 fmi3Int32 fmi3UInt32 fmi3Int64 fmi3UInt64
        fmi3Char fmi3String fmi3Byte fmi3Binary
        fmi3LogMessageCallback fmi3ClockUpdateCallback fmi3IntermediateUpdateCallback
        fmi3LockPreemptionCallback fmi3UnlockPreemptionCallback
    };
    let mut program = String::from("#include \"fmi3Functions.h\"\n");
    for (name, size) in sizes {
        writeln!(program, "_Static_assert(sizeof({name}) == {size}, \"{name}\");").unwrap();
    }
    program += "_Static_assert(fmi3Fatal == 4 && fmi3Dependent == 5, \"enumerations\");\n";
    // Another declaration than the header's is an error.
    for (function, arguments) in SIGNATURES {
        let arguments = arguments.iter().map(|argument| format!(", {}", in_c(argument)));
        writeln!(program, "fmi3Status {function}(fmi3Instance{});", arguments.collect::<String>()).unwrap();
    }
    compile(&program);
    let instance_free = [
        "fmi3GetVersion",
        "fmi3InstantiateModelExchange",
        "fmi3InstantiateCoSimulation",
        "fmi3InstantiateScheduledExecution",
        "fmi3FreeInstance",
    ];
    let header = std::fs::read_to_string(folder().join("fmi3FunctionTypes.h")).unwrap();
    let words = header.split(|c: char| !c.is_ascii_alphanumeric());
    let mut declared: Vec<_> =
        words.filter_map(|word| word.strip_suffix("TYPE")).filter(|n| !n.is_empty()).collect();
    let mut ours: Vec<_> = FUNCTIONS.iter().chain(&instance_free).copied().collect();
    declared.sort_unstable();
    declared.dedup();
    ours.sort_unstable();
    assert_eq!(ours, declared);
}

macro_rules! signatures {
    (
        $standard:ident $handle:ident
        without an instance { $($free:ident($($free_argument:ident: $free_type:ty),*) -> $result:ty;)+ }
        with an instance {
            $($function:ident $cs:literal $me:literal $tolerated:literal ($($argument:ident: $type:ty),*);)+
        }
    ) => {
        /// The functions with the types of their arguments, as Rust writes them.
        const SIGNATURES: &[(&str, &[&str])] = &[$((stringify!($function), &[$(stringify!($type)),*])),+];
    };
}

fmu_export::fmi3_functions!(signatures);

/// The type as C writes it.
fn in_c(of: &str) -> String {
    let name = |name: &str| if name == "usize" { "size_t".to_owned() } else { name.to_owned() };
    let of = &of.replace("* ", "*");
    match (of.strip_prefix("*const "), of.strip_prefix("*mut ")) {
        (Some(read), _) => format!("const {} *", name(read)),
        (_, Some(written)) => format!("{} *", name(written)),
        _ => name(of),
    }
}

fn folder() -> std::path::PathBuf {
    fmu_test_kit::c_programs::headers(std::path::Path::new(env!("CARGO_MANIFEST_DIR")))
}

fn compile(program: &str) {
    let source = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("fmi3_types.c");
    std::fs::write(&source, program).unwrap();
    let compiler = std::env::var("CC").unwrap_or_else(|_| "cc".into());
    fmu_test_kit::c_programs::output(
        Command::new(compiler)
            .args(["-std=c11", "-Wall", "-Werror", "-c", "-o", "/dev/null", "-I"])
            .args([&folder(), &source]),
        "these tests need a C compiler (cc, or set CC)",
    );
}
