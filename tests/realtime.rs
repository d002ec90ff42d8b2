//! A control loop with the testbed, which must not allocate, make system calls, or lock.

fmu_test_kit::control_loop!(prw_testbed::TestbedFmu);
