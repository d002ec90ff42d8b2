//! `build_fmu` on a full disk, or killed while it writes: the FMU is never incomplete.
#![cfg(unix)]
#![allow(unsafe_code)]

use fmu_package::{Platform, Standard};
use std::env::consts::DLL_SUFFIX;
use std::fs;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};
use zip::ZipArchive;

const OLD: &[u8] = b"the FMU of yesterday";

/// Largest size of a file that a limited process can write, bytes. The FMU is larger.
const LIMIT: libc::rlim_t = 50_000;

/// Number of builds that are killed, each at another time.
const ROUNDS: u32 = 20;

/// Builds the FMU, extracts its library and returns the path of the extracted file.
fn library(directory: &Path) -> PathBuf {
    let out = directory.join("whole");
    let mut command = Command::new(env!("CARGO_BIN_EXE_build_fmu"));
    let output = command.args(["--no-page", "--fmi", "2", "--out"]).arg(&out).output().unwrap();
    assert!(output.status.success(), "{output:?}");
    let mut fmu = ZipArchive::new(fs::File::open(out.join("prw_testbed.fmu")).unwrap()).unwrap();
    let path = directory.join("library");
    let mut entry = fmu.by_name(&format!("binaries/{}/prw_testbed{DLL_SUFFIX}", platform())).unwrap();
    std::io::copy(&mut entry, &mut fs::File::create(&path).unwrap()).unwrap();
    path
}

fn platform() -> &'static str {
    Platform::host().unwrap().directory(Standard::Fmi2)
}

/// Returns the command that packs a compiled library. It does not compile, because the compiler would exceed [`LIMIT`].
fn build_fmu(library: &Path, out: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_build_fmu"));
    command.args(["--no-page", "--fmi", "2", "--out"]).arg(out);
    command.arg("--binary").arg(format!("{}={}", platform(), library.display()));
    command
}

/// Runs the command with a limit on the size of files. A write beyond the limit raises SIGXFSZ. With `SIG_DFL` as `signal`, this ends
/// the process; with `SIG_IGN`, the write fails as on a full disk.
fn limited(mut command: Command, signal: libc::sighandler_t) -> Output {
    let limit = libc::rlimit { rlim_cur: LIMIT, rlim_max: LIMIT };
    let restrict = move || {
        // SAFETY: both calls change only the new process.
        unsafe {
            libc::signal(libc::SIGXFSZ, signal);
            if libc::setrlimit(libc::RLIMIT_FSIZE, &raw const limit) != 0 {
                return Err(std::io::Error::last_os_error());
            }
        }
        Ok(())
    };
    // SAFETY: the closure only makes system calls between fork and exec.
    unsafe { command.pre_exec(restrict) };
    command.output().unwrap()
}

/// Returns the error message: the last line on stderr, after the lines that report the progress of cargo.
fn error(output: &Output) -> String {
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    let last = text.lines().last().unwrap_or_default();
    assert!(!output.status.success() && last.starts_with("error: "), "{text}");
    last.to_owned()
}

/// One test, because the library takes long to compile.
#[test]
fn the_old_fmu_remains_until_the_new_one_is_complete() {
    let directory = tempfile::tempdir().unwrap();
    let library = library(directory.path());
    let out = &directory.path().join("out");
    let fmu = out.join("prw_testbed.fmu");
    fs::create_dir(out).unwrap();
    fs::write(&fmu, OLD).unwrap();
    let names = || -> Vec<_> {
        let entries =
            fs::read_dir(out).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
        entries.filter(|name| name != "prw_testbed.fmu").collect()
    };

    let text = error(&limited(build_fmu(&library, out), libc::SIG_IGN));
    assert!(text.contains(&format!("cannot write {}", fmu.display())), "{text}");
    assert_eq!(fs::read(&fmu).unwrap(), OLD);
    assert_eq!(names(), [""; 0]);

    let output = limited(build_fmu(&library, out), libc::SIG_DFL);
    assert_eq!(output.status.signal(), Some(libc::SIGXFSZ), "{output:?}");
    assert_eq!(fs::read(&fmu).unwrap(), OLD);
    let left = names();
    assert!(left.len() == 1 && left[0].starts_with(".unfinished-"), "{left:?}");

    let build = || {
        let begin = Instant::now();
        let output = build_fmu(&library, out).output().unwrap();
        assert!(output.status.success(), "{output:?}");
        begin.elapsed()
    };
    let first = build();
    assert_eq!(names(), [""; 0], "the temporary file of the killed process must be removed");
    // The shortest of three, because a build waits until other builds in the workspace have ended.
    killed_at_any_time(|| build_fmu(&library, out), first.min(build()).min(build()), &fmu);
}

/// Asserts that the file is the old FMU or the new one after `kill -9` at any time.
fn killed_at_any_time(build_fmu: impl Fn() -> Command, duration: Duration, fmu: &Path) {
    let new = fs::read(fmu).unwrap();
    assert!(new.starts_with(b"PK"));
    for round in 0..ROUNDS {
        fs::write(fmu, OLD).unwrap();
        let mut process = build_fmu().stdout(Stdio::null()).spawn().unwrap();
        std::thread::sleep(duration * round / (ROUNDS - 1));
        process.kill().unwrap();
        process.wait().unwrap();
        let found = fs::read(fmu).unwrap();
        assert!(found == OLD || found == new, "{} bytes after round {round}", found.len());
    }
}
