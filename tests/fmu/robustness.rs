//! Random sequences of calls, and loading and unloading of the library, alone and together with another FMU. The tests of
//! fmu-export cover other guarantees of docs/robustness.md with test models.

use fmu_test_kit::fault_injection::{run, run_seeds};
use fmu_test_kit::{Importer, fmi3};
use prw_testbed::TestbedFmu;

#[test]
fn every_guarantee_holds_for_any_calls() {
    let tally = run_seeds(4, &[("prw_testbed", run::<Importer, TestbedFmu>)]);
    assert_eq!(tally.len(), 44, "every function must be called");
    run_seeds(4, &[("prw_testbed in FMI 3.0", run::<fmi3::Importer, TestbedFmu>)]);
}

#[cfg(target_os = "linux")]
#[test]
fn loading_and_unloading_leaks_nothing() {
    use fmu_test_kit::c_programs::{compile, reload};
    use std::path::Path;
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("crates/fmu-export/tests/c/reload.c");
    let program = compile(&source, Path::new(env!("CARGO_TARGET_TMPDIR")));
    reload(&program, &["prw_testbed"]);
    reload(&program, &["prw_testbed", "prw_controller"]);
}
