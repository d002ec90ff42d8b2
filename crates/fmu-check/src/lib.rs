#![doc = include_str!("../README.md")]
//!
//! ## Inside
//!
//! A check writes a call sequence (`writer`, `call_sequence`), which a separate process executes (`run`, `worker`), and evaluates
//! the results. The call sequence of a finding is shortened (`shrink`) so that the standard still allows it (`legal`), executed
//! twice, and written to the report with the results that show the finding (`reproduce`, `evidence`), from which `replay` executes
//! it again. All `unsafe` code is in `worker`, which loads and calls the library of the FMU in processes that may crash.
//!
//! Each module uses only modules before it: `call_sequence`, `worker`, `evidence`, `finding`, `rules`, `description`,
//! `consistency`, `values`, `legal`, `writer`, `shrink`, `run`, `reproduce`, `always`, `options`, `checker`, `trajectory`,
//! `schema`, `checks`, `opening`, `activity`, `schedule`, `baseline`, `report`, `session`, `replay`.

mod activity;
mod always;
mod baseline;
mod call_sequence;
mod checker;
mod checks;
mod consistency;
mod description;
mod evidence;
mod finding;
mod legal;
mod opening;
mod options;
mod replay;
mod report;
mod reproduce;
mod rules;
mod run;
mod schedule;
mod schema;
mod session;
mod shrink;
mod trajectory;
mod values;
#[allow(unsafe_code, reason = "the library of the FMU is loaded and called here")]
mod worker;
mod writer;

pub use activity::Progress;
pub use checker::Unchecked;
pub use finding::{Finding, Proof, Severity};
pub use options::{FailOn, Options};
pub use replay::{ReplayOptions, replay};
pub use report::Report;
pub use session::check;
pub use worker::run_worker_if_requested;

use anyhow::Context as _;
use run::Stop;
use std::io::{IsTerminal as _, Write as _};
use std::path::Path;
use std::process::ExitCode;

/// Checks an FMU, prints the findings and writes the reports; with `--explain`, only prints a rule. Returns the exit status: 1 if
/// a finding fails the check; otherwise 2 if the FMU, or an interface or topic that must be checked, was not checked, or if a
/// file cannot be read or written; otherwise 0. After an interrupt it is 130.
///
/// The program must call [`run_worker_if_requested`] first in `main`, because the check starts the same program again to execute
/// call sequences.
pub fn command(fmu: &Path, options: &Options) -> ExitCode {
    if let Some(rule) = &options.explain {
        return match rules::explain(rule) {
            Some(text) => {
                // A closed pipe is not an error.
                let _ = std::io::stdout().write_all(text.as_bytes());
                ExitCode::SUCCESS
            }
            None => {
                eprintln!("error: no rule is called {rule}; --explain all prints all");
                ExitCode::from(2)
            }
        };
    }
    let shows = !options.json && std::io::stderr().is_terminal();
    let progress = if shows { Progress::Line } else { Progress::None };
    worker::listen_for_interrupts();
    match check(fmu, options, progress).and_then(|report| {
        let text = match options.json {
            true => format!("{}\n", report.json()?),
            false => report.terminal(std::io::stdout().is_terminal()),
        };
        // A closed pipe is not an error.
        let written = std::io::stdout().write_all(text.as_bytes());
        written.or_else(|error| match error.kind() {
            std::io::ErrorKind::BrokenPipe => Ok(()),
            _ => Err(error).context("the report cannot be written to the standard output"),
        })?;
        if let Some(directory) = &options.out {
            report.write(directory).with_context(|| format!("{}: cannot be written", directory.display()))?;
        }
        Ok(report)
    }) {
        Ok(report) if !worker::interrupted() => ExitCode::from(report.status),
        result => {
            let error = result.err().unwrap_or_else(|| Stop::Interrupted.into());
            eprintln!("error: {}", fmi_abi::one_line(&format!("{error:#}")));
            ExitCode::from(if worker::interrupted() { 130 } else { 2 })
        }
    }
}
