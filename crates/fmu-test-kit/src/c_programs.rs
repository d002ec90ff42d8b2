//! Compiles and runs C programs that load FMUs, for tests, with the headers of the FMI standards.
//!
//! If a tool or a file is missing, the functions panic with a message that names the remedy.

use std::env::consts::{DLL_PREFIX, DLL_SUFFIX};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Returns the directory of the headers of FMI 2.0 and FMI 3.0. It is the value of the environment variable
/// `FMI2_HEADERS`, or else a directory of the Python package fmpy in the `.venv` of `directory` or of a directory above it.
///
/// # Panics
/// Panics if none of these directories contains `fmi2Functions.h`.
pub fn headers(directory: &Path) -> PathBuf {
    let named = std::env::var_os("FMI2_HEADERS").map(PathBuf::from);
    let in_venvs = directory.ancestors().flat_map(|directory| {
        let versions = std::fs::read_dir(directory.join(".venv/lib")).into_iter().flatten().flatten();
        versions.map(|version| version.path().join("site-packages/fmpy/c-code"))
    });
    named.into_iter().chain(in_venvs).find(|directory| directory.join("fmi2Functions.h").exists()).expect(
        "the headers of FMI 2.0 and 3.0 are missing; run: make headers (or set FMI2_HEADERS to their directory)",
    )
}

/// Returns the path of the shared library of this name. Cargo writes libraries to the directory of the test, to its
/// parent, or to the `examples` directory in one of them.
///
/// # Panics
/// Panics if the library has not been built.
pub fn library(name: &str) -> PathBuf {
    let test = std::env::current_exe().expect("a test");
    let file = format!("{DLL_PREFIX}{name}{DLL_SUFFIX}");
    let directories = test.ancestors().skip(1).take(2);
    let mut paths =
        directories.flat_map(|directory| [directory.join(&file), directory.join("examples").join(&file)]);
    paths.find(|path| path.exists()).unwrap_or_else(|| {
        panic!(
            "{file} is missing near {}; cargo build --examples builds it, and so does cargo test without --test",
            test.display()
        )
    })
}

/// Runs a program and returns its standard output.
///
/// # Panics
/// Panics with the message `missing` if the program cannot be started. Also panics if the program fails, or if its output
/// is not UTF-8.
pub fn output(command: &mut Command, missing: &str) -> String {
    let output = command.output().unwrap_or_else(|error| panic!("{missing}: {command:?}: {error}"));
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command:?}: {}\n{stderr}", output.status);
    String::from_utf8(output.stdout).expect("UTF-8")
}

/// Compiles a C program into a directory and returns the path of the program. The FMI headers are searched from the
/// directory of `source` upwards, see [`headers`].
///
/// # Panics
/// Panics if the compiler reports an error or a warning, or if the compiler or the headers are missing.
pub fn compile(source: &Path, directory: &Path) -> PathBuf {
    let program = directory.join(source.file_stem().expect("a file"));
    output(c_compiler(&headers(source)).arg("-o").args([&program, source]).arg("-ldl"), NO_COMPILER);
    program
}

/// Checks that a C file compiles without warnings.
///
/// # Errors
/// Returns the messages of the compiler.
///
/// # Panics
/// Panics if there is no compiler.
pub fn check_syntax(source: &Path, headers: &Path) -> Result<(), String> {
    let output = c_compiler(headers).arg("-fsyntax-only").arg(source).output().expect(NO_COMPILER);
    if output.status.success() { Ok(()) } else { Err(String::from_utf8_lossy(&output.stderr).into_owned()) }
}

const NO_COMPILER: &str = "these tests need a C compiler (cc, or set CC)";

fn c_compiler(headers: &Path) -> Command {
    let mut compiler = Command::new(std::env::var("CC").unwrap_or_else(|_| "cc".into()));
    compiler.args(["-std=c11", "-D_GNU_SOURCE", "-Wall", "-Wextra", "-Werror", "-g", "-I"]).arg(headers);
    compiler
}

/// Returns the command that runs a program. If the environment variable `C_RUNNER` is set, its command runs the program;
/// `make sanitize` sets it to valgrind.
///
/// # Panics
/// Never panics.
pub fn command(program: &Path) -> Command {
    let runner = std::env::var("C_RUNNER").unwrap_or_default();
    let mut words = runner.split_whitespace().map(OsStr::new).chain([program.as_os_str()]);
    let mut command = Command::new(words.next().expect("at least the program"));
    command.args(words);
    command
}

/// Runs `reload.c`, which loads, uses and unloads libraries repeatedly, and checks that its memory does not grow.
///
/// No allocated byte may remain of nine tenths of the rounds. Memory that is not allocated with `malloc` shows in the resident
/// memory, whose number of pages varies by some 100 KiB in total. `RELOAD_ROUNDS` sets the number of rounds.
///
/// # Panics
/// Panics if the memory grows by more, or if the program fails.
pub fn reload(program: &Path, names: &[&str]) {
    let rounds: i64 = std::env::var("RELOAD_ROUNDS").map_or(200, |rounds| rounds.parse().expect("a number"));
    let mut command = command(program);
    // The cache of freed blocks that each thread has counts as allocated.
    command.env("GLIBC_TUNABLES", "glibc.malloc.tcache_count=0");
    command.arg(rounds.to_string()).args(names.iter().map(|name| library(name)));
    let printed = output(&mut command, "the compiled program does not run");
    println!("{names:?}: {printed}");
    let memory: Vec<i64> = printed.split_whitespace().map(|word| word.parse().expect("a number")).collect();
    let [allocated, resident, allocated_at_end, resident_at_end] = memory[..] else {
        panic!("four numbers expected: {printed}")
    };
    assert_eq!(allocated_at_end, allocated, "{names:?}: allocated bytes remain");
    let growth = (resident_at_end - resident) * 1024;
    assert!(growth < 100 * rounds.max(3000), "{names:?}: {growth} bytes more");
}
