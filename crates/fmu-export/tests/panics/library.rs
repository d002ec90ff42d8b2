//! The test model `Faulty` as a library, which a test converts to C sources.

#[path = "../../../fmu-test-kit/src/models/faulty.rs"]
#[allow(dead_code, reason = "only tests use some of its functions")]
mod faulty;

fmu_export::symbols!(faulty::Faulty);
