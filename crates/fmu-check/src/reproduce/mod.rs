//! Programs in C that reproduce a finding without fmu-check.

mod c;
pub mod confirm;
mod evidence;

use crate::call_sequence::{Run, Setting};
use crate::description::Description;
use crate::finding::Finding;

/// Writes the program that reproduces a finding. The program compares its results with the results of `run`.
pub fn program(finding: &mut Finding, run: &Run, setting: &Setting, description: &Description) {
    let evidence = evidence::evidence(finding, run);
    let sequence = evidence::as_repeated(&finding.sequence, run);
    finding.c = c::program(finding, &sequence, &evidence, setting, description);
}
