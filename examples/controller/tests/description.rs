//! The committed model description of the controller.

use std::fs;
use std::path::Path;
use std::process::Command;

const COMMITTED: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/modelDescription/modelDescription.xml");

/// Checks that the description is up to date, because the tables in the documentation are generated from it.
#[test]
fn the_committed_description_is_up_to_date() {
    let directory = Path::new(env!("CARGO_TARGET_TMPDIR")).join("controller");
    let mut build = Command::new(env!("CARGO_BIN_EXE_build_fmu_controller"));
    let output = build.args(["--describe", "--out"]).arg(&directory).output().unwrap();
    assert!(output.status.success(), "{output:?}");
    assert!(
        fs::read_to_string(COMMITTED).unwrap_or_default()
            == fs::read_to_string(directory.join("modelDescription.xml")).unwrap(),
        "modelDescription/modelDescription.xml of the controller is out of date; write it again with\n    \
         cargo fmu build -p prw_controller --describe"
    );
}
