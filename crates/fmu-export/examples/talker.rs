//! The talker of the tests as a shared library: a second FMU in a process.

#[path = "../tests/toys/talker.rs"]
mod talker;

fmu_export::fmi2_symbols!(talker::Talker);
fmu_export::fmi3_symbols!(talker::Talker);
