//! Call sequences as programs in C, which show a finding without this tool.

mod c;
mod evidence;

use crate::call_sequence::{Run, Setting};
use crate::description::Description;
use crate::finding::Finding;

/// Writes the program of a finding, which compares its results with the results of the last run.
pub fn program(finding: &mut Finding, run: &Run, setting: &Setting, description: &Description) {
    let evidence = evidence::evidence(finding, run);
    let sequence = evidence::as_repeated(&finding.sequence, run);
    finding.c = c::program(finding, &sequence, &evidence, setting, description);
}
