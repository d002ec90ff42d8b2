//! The test model `Talker` as a shared library, which the C programs of the tests load as a second FMU.

#[path = "../../fmu-test-kit/src/models/talker.rs"]
mod talker;

fmu_export::symbols!(talker::Talker);
