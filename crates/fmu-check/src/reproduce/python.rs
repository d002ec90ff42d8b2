//! A script as a program in Python: its steps as data, which a prelude plays.

use super::evidence::Evidence;
use super::{head, library, phases};
use crate::description::Description;
use crate::finding::Finding;
use crate::script::{Script, Setting};
use std::fmt::Write as _;

/// The program.
pub fn program(
    finding: &Finding,
    script: &Script,
    evidence: &Evidence,
    setting: &Setting,
    description: &Description,
) -> serde_json::Result<String> {
    let mut text = String::from("\"\"\"");
    text.push_str(&head(finding, description).join("\n"));
    text.push_str("\npython repro.py FOLDER_OF_THE_UNPACKED_FMU (Linux, macOS)\n\n");
    text.push_str(
        "Exit status: 1 if the finding shows, 0 if it does not, 3 if that cannot be told.\n\"\"\"\n\n",
    );
    text.push_str(include_str!("prelude.py"));
    let quoted = |json: String| format!("r'''{}'''", json.replace("'''", "\\u0027\\u0027\\u0027"));
    let _ = writeln!(text, "\nLIBRARY = {:?}", library(setting, script));
    let _ = writeln!(text, "EVIDENCE = json.loads({})", quoted(serde_json::to_string(evidence)?));
    // A process for each part, a line for each step.
    text.push_str("PHASES = [\n");
    for part in phases(script) {
        text.push_str("    [\n");
        for numbered in part {
            let _ = writeln!(text, "        json.loads({}),", quoted(serde_json::to_string(numbered)?));
        }
        text.push_str("    ],\n");
    }
    text.push_str("]\n\nmain()\n");
    Ok(text)
}
