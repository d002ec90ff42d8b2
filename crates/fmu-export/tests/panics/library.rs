//! The model as a shared library, which is made into C sources for a test.

#[path = "../models/faulty.rs"]
#[allow(dead_code, reason = "some of it is for tests in the same program")]
mod faulty;

fmu_export::symbols!(faulty::Faulty);
