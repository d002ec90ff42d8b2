//! Reads malformed model descriptions, systems, parameter sets and archives, and mutations of them, in processes with limited
//! memory.
#![allow(unsafe_code, reason = "FMUs are opened")]
#![cfg(all(target_os = "linux", target_arch = "x86_64"))]

#[path = "../foreign/built.rs"]
#[allow(dead_code, reason = "some functions are used by other tests")]
mod built;
mod corpus;
mod harness;

use corpus::Files;
use fmu_run::Standard;
use fmu_test_kit::Random;
use std::path::{Path, PathBuf};
use std::process::Command;
use tempfile::TempDir;

/// Limits of the address space in which all files are read, in MB. The process itself needs about 20 MB. `make test` tries the first.
const LIMITS: [u64; 4] = [80, 48, 128, 256];
/// Environment variable that contains the directory in which the child process works.
const DIRECTORY: &str = "READERS_DIRECTORY";
/// Environment variable that contains the number of mutations for each kind of file.
const MUTATIONS: &str = "READERS_MUTATIONS";

/// Creates a directory for a system, with the FMU `m`, parameters, a pipe and a link. Next to it are secret files, which the system
/// must not read.
fn system(outer: &Path) -> PathBuf {
    let directory = outer.join("system");
    std::fs::create_dir_all(&directory).unwrap();
    let archive = built::built("plain", Standard::Fmi2, outer, &[]);
    let file = std::fs::File::open(archive).unwrap();
    zip::ZipArchive::new(file).unwrap().extract(directory.join("m")).unwrap();
    for secret in ["secret.fmu", "secret.ssv"] {
        std::fs::write(outer.join(secret), corpus::parameters().remove(0).1).unwrap();
    }
    let pipe = Command::new("mkfifo").arg(directory.join("pipe")).status().unwrap();
    assert!(pipe.success());
    std::os::unix::fs::symlink("../secret.ssv", directory.join("link")).unwrap();
    reset(&directory);
    directory
}

/// Restores the files that the tests replace.
fn reset(directory: &Path) {
    std::fs::write(directory.join("p.ssv"), corpus::parameters().remove(0).1).unwrap();
    let names = corpus::systems();
    let (_, bound) = names.iter().find(|(name, _)| *name == "parameters").unwrap();
    std::fs::write(directory.join("SystemStructure.ssd"), bound).unwrap();
}

/// Runs an ignored test of this file in a process with limits of memory and processor time.
fn run_limited(test: &str, megabytes: u64, mutations: usize) {
    let outer = TempDir::new().unwrap();
    system(outer.path());
    let limits = format!("ulimit -c 0; ulimit -t 120; ulimit -v {}; exec \"$0\" \"$@\"", megabytes << 10);
    let output = Command::new("sh")
        .args(["-c", &limits])
        .arg(std::env::current_exe().unwrap())
        .args(["--ignored", "--exact", test, "--nocapture", "--test-threads=1"])
        .env(DIRECTORY, outer.path())
        .env(MUTATIONS, mutations.to_string())
        .env("TMPDIR", outer.path())
        .env("RUST_BACKTRACE", "0")
        // Otherwise the thread of the test would have a separate arena, which needs more address space than some limits allow, so
        // each allocation would take a page.
        .env("MALLOC_ARENA_MAX", "1")
        .output()
        .unwrap();
    let text =
        [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned()).concat();
    let last: Vec<_> = text.lines().rev().take(12).collect();
    assert!(
        output.status.success() && text.contains("1 passed"),
        "{megabytes} MB, {}: {last:#?}",
        output.status
    );
}

fn directory() -> PathBuf {
    PathBuf::from(std::env::var_os(DIRECTORY).expect("a parent process starts this test"))
}

/// Calls `read` with each file. Prints the name of the file first, so that the parent process can report the last one.
fn each(kind: &str, files: &Files, mut read: impl FnMut(&[u8])) {
    for (name, bytes) in files {
        println!("{kind}: {name}");
        read(bytes);
    }
}

/// Writes the small files to a directory for each libFuzzer target, as its initial corpus. The last byte of an input of the target
/// `system` selects the file of the system: 0 for `SystemStructure.ssd`, 1 for `p.ssv`.
#[test]
#[ignore = "make fuzz starts it"]
fn write_corpus() {
    let outer = directory();
    let write = |target: &str, files: Files, last: &[u8]| {
        let directory = outer.join(target);
        std::fs::create_dir_all(&directory).unwrap();
        for (name, bytes) in files.into_iter().filter(|(_, bytes)| bytes.len() < 20_000) {
            std::fs::write(directory.join(format!("{name} {}", last.len())), [&bytes, last].concat())
                .unwrap();
        }
    };
    write("description", corpus::descriptions(), &[]);
    write("archive", corpus::archives(), &[]);
    write("system", corpus::systems(), &[0]);
    let parameters = corpus::parameters().into_iter();
    write("system", parameters.map(|(name, bytes)| (name, [bytes, vec![1]].concat())).collect(), &[]);
}

#[test]
#[ignore = "started under a limit of memory"]
fn read_all() {
    let outer = directory();
    let system = outer.join("system");
    each("description", &corpus::descriptions(), harness::description);
    each("system", &corpus::systems(), |bytes| {
        harness::file_of_system(&system, "SystemStructure.ssd", bytes)
    });
    reset(&system);
    each("parameters", &corpus::parameters(), |bytes| harness::file_of_system(&system, "p.ssv", bytes));
    let alone = outer.join("alone");
    std::fs::create_dir(&alone).unwrap();
    each("archive", &corpus::archives(), |bytes| harness::archive(&alone, bytes));
}

#[test]
fn malformed_files_are_errors() {
    run_limited("read_all", LIMITS[0], 0);
}

#[test]
#[ignore = "make test-long runs it"]
fn malformed_files_are_errors_whatever_memory_there_is() {
    for megabytes in LIMITS {
        run_limited("read_all", megabytes, 0);
    }
}

#[test]
#[ignore = "started under a limit of memory"]
fn read_uses() {
    let system = directory().join("system");
    let [descriptions, systems] = corpus::uses();
    each("description", &descriptions, harness::description);
    each("system", &systems, |bytes| harness::file_of_system(&system, "SystemStructure.ssd", bytes));
}

#[test]
fn parts_with_many_uses_are_read_once() {
    run_limited("read_uses", 512, 0);
}

/// Mutates a file one to four times: changes bytes, repeats or removes parts, and inserts tokens that may confuse a parser.
fn mutated(random: &mut Random, original: &[u8]) -> Vec<u8> {
    const TOKENS: [&str; 16] = [
        "<",
        ">",
        "\"",
        "/>",
        "<a",
        "<!--",
        "-->",
        "<![CDATA[",
        "&#0;",
        "&lt;",
        "-1",
        "18446744073709551615",
        "1e999",
        "..",
        "%00",
        "\u{1b}[2J",
    ];
    let mut bytes = original.to_vec();
    for _ in 0..=random.below(4) {
        if bytes.is_empty() {
            return bytes;
        }
        let begin = random.below(bytes.len());
        let end = (begin + 1 + random.below(64)).min(bytes.len());
        match random.below(5) {
            0 => bytes[begin] = random.bits() as u8,
            1 => _ = bytes.drain(begin..end),
            2 => {
                let part = bytes[begin..end].repeat(1 + random.below(8));
                bytes.splice(begin..begin, part);
            }
            3 => _ = bytes.splice(begin..begin, TOKENS[random.below(TOKENS.len())].bytes()),
            _ => bytes[begin] ^= 1 << random.below(8),
        }
    }
    bytes
}

#[test]
#[ignore = "started under a limit of memory"]
fn read_mutations() {
    let outer = directory();
    let system = outer.join("system");
    let count: usize = std::env::var(MUTATIONS).unwrap().parse().unwrap();
    let mut random = Random(1);
    let mut mutate = |files: &Files, read: &dyn Fn(&[u8])| {
        // Only small files are mutated, because large ones take more time and do not find more faults.
        let small: Vec<_> = files.iter().filter(|(_, bytes)| bytes.len() < 5000).collect();
        for _ in 0..count {
            let (_, original) = small[random.below(small.len())];
            let bytes = mutated(&mut random, original);
            // The input is stored outside of this process, because it may end the process.
            std::fs::write(outer.join("input"), &bytes).unwrap();
            read(&bytes);
        }
    };
    mutate(&corpus::descriptions(), &harness::description);
    mutate(&corpus::systems(), &|bytes| harness::file_of_system(&system, "SystemStructure.ssd", bytes));
    reset(&system);
    mutate(&corpus::parameters(), &|bytes| harness::file_of_system(&system, "p.ssv", bytes));
    let alone = outer.join("alone");
    std::fs::create_dir(&alone).unwrap();
    mutate(&corpus::archives(), &|bytes| harness::archive(&alone, bytes));
}

/// Returns the number of mutations for each kind of file.
fn mutations() -> usize {
    std::env::var(MUTATIONS).map_or(150, |count| count.parse().unwrap())
}

#[test]
fn mutations_of_malformed_files_are_errors() {
    run_limited("read_mutations", 256, mutations());
}
