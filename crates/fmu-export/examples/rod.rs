//! The test model `Rod` as a shared library, for tests of importers that read arrays.

#[path = "../../fmu-test-kit/src/models/rod.rs"]
#[allow(dead_code, missing_docs)]
mod rod;

fmu_export::symbols!(rod::Rod);
