//! Reads untrusted files, in the tests and in libFuzzer. Each file must be read successfully, or cause an error message of one
//! line.

use fmu_run::{Description, Fmu, Order, System};
use std::path::Path;

/// The orders of data exchange with which a system is opened.
pub const ORDERS: [Order; 2] = [Order::Dependencies, Order::Jacobi];

/// Asserts that an error message is not empty, contains no control characters such as newlines, and is not too long.
fn check<T>(result: Result<T, String>) {
    if let Err(why) = result {
        assert!(!why.trim().is_empty(), "a message is empty");
        let begin: String = why.chars().take(300).collect();
        assert!(!why.contains(char::is_control), "control characters: {begin:?}");
        assert!(why.chars().count() < 2000, "too long: {begin}");
    }
}

/// Reads a model description.
pub fn description(bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    check(Description::parse(&text).map_err(|why| fmu_run::Error::Fmu(why).to_string()));
}

/// Writes one file of a system to its directory, which already contains the other files, and opens the directory.
pub fn file_of_system(directory: &Path, name: &str, bytes: &[u8]) {
    std::fs::write(directory.join(name), bytes).unwrap();
    for order in ORDERS {
        // SAFETY: the only FMU in the directory is one of these tests.
        check(unsafe { System::open(directory, order) }.map_err(|error| error.to_string()));
    }
}

/// Writes an archive to an empty directory, and opens it as an FMU and as a system.
pub fn archive(directory: &Path, bytes: &[u8]) {
    let path = directory.join("archive");
    std::fs::write(&path, bytes).unwrap();
    // SAFETY: these archives contain no library.
    check(unsafe { Fmu::open(&path) }.map_err(|error| error.to_string()));
    // SAFETY: as above.
    check(unsafe { System::open(&path, Order::Jacobi) }.map_err(|error| error.to_string()));
    let names: Vec<_> =
        std::fs::read_dir(directory).unwrap().flatten().map(|entry| entry.file_name()).collect();
    assert_eq!(names, ["archive"], "a file was written outside of the temporary directory");
}
