//! The control loop of the testbed.

fmu_test_kit::control_loop!(prw_testbed::TestbedFmu);
