//! The functions have the types of the standard's headers: a C program says so when it is compiled.

use fmu_run::fmi3::FUNCTIONS;
use std::fmt::Write;
use std::process::Command;

/// The types as C sees those of this crate. `bool` and bytes are one type to it in all but name.
#[test]
fn types() {
    use fmu_export::fmi3::types::*;
    let sizes = [
        ("fmi3Status", size_of::<Status>()),
        ("fmi3Boolean", size_of::<fmi3Boolean>()),
        ("fmi3Clock", size_of::<fmi3Clock>()),
        ("fmi3DependencyKind", size_of::<fmi3DependencyKind>()),
        ("fmi3IntervalQualifier", size_of::<fmi3IntervalQualifier>()),
        ("fmi3ValueReference", size_of::<fmi3ValueReference>()),
        ("fmi3Float32", size_of::<fmi3Float32>()),
        ("fmi3UInt64", size_of::<fmi3UInt64>()),
        ("fmi3Binary", size_of::<fmi3Binary>()),
    ];
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
    ($($function:ident $cs:literal $me:literal $tolerated:literal ($($argument:ident: $type:ty),*);)+) => {
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
    fmu_run::c_programs::headers(std::path::Path::new(env!("CARGO_MANIFEST_DIR")))
}

fn compile(program: &str) {
    let source = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("fmi3_types.c");
    std::fs::write(&source, program).unwrap();
    let compiler = std::env::var("CC").unwrap_or_else(|_| "cc".into());
    fmu_run::c_programs::output(
        Command::new(compiler)
            .args(["-std=c11", "-Wall", "-Werror", "-c", "-o", "/dev/null", "-I"])
            .args([&folder(), &source]),
        "these tests need a C compiler (cc, or set CC)",
    );
}
