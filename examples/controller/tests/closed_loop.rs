//! Invalid options of `build_closed_loop` are rejected.

use std::process::Command;

#[test]
fn invalid_numbers_are_rejected() {
    let directory = std::env::temp_dir().join(format!("prw-closed-loop-{}", std::process::id()));
    for (arguments, message) in [
        (&["--go-to", "nan", "60"][..], "--go-to must have finite numbers, not NaN"),
        (&["--go-to", "30", "inf"], "--go-to must have finite numbers, not inf"),
        (&["--stop-time", "inf"], "--stop-time must be finite and > 0, it is inf"),
        (&["--step-size", "0"], "--step-size must be finite and > 0, it is 0"),
    ] {
        let program = env!("CARGO_BIN_EXE_build_closed_loop");
        let output = Command::new(program).args(arguments).arg("--out").arg(&directory).output().unwrap();
        assert!(!output.status.success());
        assert_eq!(String::from_utf8_lossy(&output.stderr), format!("error: {message}\n"));
    }
    assert!(!directory.exists());
}
