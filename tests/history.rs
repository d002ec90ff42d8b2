//! Random histories of the testbed.

use fmu_test_kit::history::Histories;
use prw_testbed::TestbedFmu;

#[test]
fn undone_calls_leave_no_trace() {
    Histories::default().check::<TestbedFmu>();
}

#[test]
fn steps_stay_cheap() {
    fmu_test_kit::costs::steps_stay_cheap::<TestbedFmu>();
}
