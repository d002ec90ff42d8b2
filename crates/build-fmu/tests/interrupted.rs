//! `build_fmu` on a full disk, or killed while it writes: the FMU is never incomplete.
#![cfg(unix)]
#![allow(unsafe_code)]

use fmu_package::{Platform, Standard};
use std::env::consts::DLL_SUFFIX;
use std::fs;
use std::io::Read;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::sync::OnceLock;
use std::time::Instant;
use zip::ZipArchive;

const OLD: &[u8] = b"the FMU of yesterday";

const LIMIT: libc::rlim_t = 50_000;

const ROUNDS: u32 = 20;

/// Packs a compiled library: within the limits of these tests, none can be compiled.
fn build_fmu(out: &Path) -> Command {
    static LIBRARY: OnceLock<Vec<u8>> = OnceLock::new();
    let platform = Platform::host().unwrap().directory(Standard::Fmi2);
    let library = LIBRARY.get_or_init(|| {
        let directory = tempfile::tempdir().unwrap();
        let mut command = Command::new(env!("CARGO_BIN_EXE_build_fmu"));
        assert!(
            command
                .args(["--no-page", "--fmi", "2", "--out"])
                .arg(directory.path())
                .output()
                .unwrap()
                .status
                .success()
        );
        let fmu = fs::File::open(directory.path().join("prw_testbed.fmu")).unwrap();
        let mut fmu = ZipArchive::new(fmu).unwrap();
        let name = format!("binaries/{platform}/prw_testbed{DLL_SUFFIX}");
        let mut library = Vec::new();
        fmu.by_name(&name).unwrap().read_to_end(&mut library).unwrap();
        library
    });
    let path = out.with_extension("library");
    fs::write(&path, library).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_build_fmu"));
    command.args(["--no-page", "--fmi", "2", "--out"]).arg(out);
    command.arg("--binary").arg(format!("{platform}={}", path.display()));
    command
}

/// Runs the command with a limit on the size of files. The signal ends the process or, if it is ignored, writing fails as on a full
/// disk.
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

/// The last line on stderr, after the lines that report the progress of cargo.
fn error(output: &Output) -> String {
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    let last = text.lines().last().unwrap_or_default();
    assert!(!output.status.success() && last.starts_with("error: "), "{text}");
    last.to_owned()
}

#[test]
fn an_interrupted_write_leaves_the_old_fmu() {
    let directory = tempfile::tempdir().unwrap();
    let out = &directory.path().join("out");
    let fmu = out.join("prw_testbed.fmu");
    fs::create_dir(out).unwrap();
    fs::write(&fmu, OLD).unwrap();
    let names = || -> Vec<_> {
        let entries =
            fs::read_dir(out).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
        entries.filter(|name| name != "prw_testbed.fmu").collect()
    };

    let text = error(&limited(build_fmu(out), libc::SIG_IGN));
    assert!(text.contains(&format!("cannot write {}", fmu.display())), "{text}");
    assert_eq!(fs::read(&fmu).unwrap(), OLD);
    assert_eq!(names(), [""; 0]);

    let output = limited(build_fmu(out), libc::SIG_DFL);
    assert_eq!(output.status.signal(), Some(libc::SIGXFSZ), "{output:?}");
    assert_eq!(fs::read(&fmu).unwrap(), OLD);
    let left = names();
    assert!(left.len() == 1 && left[0].starts_with(".unfinished-"), "{left:?}");

    let output = build_fmu(out).output().unwrap();
    assert!(output.status.success(), "{output:?}");
    assert!(fs::read(&fmu).unwrap().starts_with(b"PK"));
}

/// After `kill -9` at any time, the file is the old FMU or the new one.
#[test]
fn killed_at_any_moment() {
    let directory = tempfile::tempdir().unwrap();
    let out = &directory.path().join("out");
    let fmu = out.join("prw_testbed.fmu");
    fs::create_dir(out).unwrap();
    let mut command = build_fmu(out);
    let begin = Instant::now();
    assert!(command.output().unwrap().status.success());
    let whole = begin.elapsed();
    let new = fs::read(&fmu).unwrap();
    for round in 0..ROUNDS {
        fs::write(&fmu, OLD).unwrap();
        let mut process = build_fmu(out).stdout(Stdio::null()).spawn().unwrap();
        std::thread::sleep(whole * round / (ROUNDS - 1));
        process.kill().unwrap();
        process.wait().unwrap();
        let found = fs::read(&fmu).unwrap();
        assert!(found == OLD || found == new, "{} bytes after round {round}", found.len());
    }
}
