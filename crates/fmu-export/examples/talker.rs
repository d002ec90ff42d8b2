//! The talker of the tests as a shared library: a second FMU in a process.

#[path = "../tests/models/talker.rs"]
mod talker;

fmu_export::symbols!(talker::Talker);
