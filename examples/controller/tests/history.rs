//! Random histories of the controller.

#[test]
fn undone_calls_leave_no_trace() {
    fmu_test_kit::history::Histories::default().check::<prw_controller::controller::Controller>();
}

#[test]
fn steps_stay_cheap() {
    fmu_test_kit::costs::steps_stay_cheap::<prw_controller::controller::Controller>();
}
