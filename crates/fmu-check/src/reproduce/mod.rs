//! Writes the calls of a finding for reports: as text, and so that they can be executed again without the check.

mod evidence;
mod text;

pub use evidence::evidence;
pub use text::{Printed, expectation};

use crate::call_sequence::{Setting, fold};
use crate::description::Description;
use crate::evidence::{Evidence, Replay};
use crate::finding::Finding;

/// Adds the calls and the expected results to a finding. `limit` is the maximum duration of a process in seconds.
pub fn write(
    finding: &mut Finding,
    evidence: Evidence,
    setting: &Setting,
    limit: f64,
    description: &Description,
) {
    let sequence = fold(&finding.sequence);
    let printed = Printed { description, run: None };
    finding.calls = printed.lines(&sequence);
    finding.expected = expectation(&evidence, &finding.sequence, None);
    let Setting { soft, now, memory, repetitions, .. } = *setting;
    finding.replay = Some(Replay { soft, now, memory, repetitions, limit, evidence, sequence });
}
