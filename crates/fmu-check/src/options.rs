//! Options of a check.

use crate::finding::topic_of;
use crate::rules;
use clap::{Args as _, FromArgMatches as _};
use std::path::PathBuf;

/// Topics that are not part of a quick check.
const LONG: [&str; 2] = ["malformed", "resources"];

/// Longest duration that an option may have, s; about 11 days.
const LONGEST: f64 = 1e6;

/// Options of a check, which are also the options of the command line.
#[derive(Clone, Debug, clap::Args)]
pub struct Options {
    // A program may also list rules. The check of a rule is executed if it has the name of the rule in the table of checks; findings of
    // other rules are reported if a check of a listed topic makes them.
    /// Checks only these topics, separated by commas: description, package, functions, start_values, life_cycle,
    /// states, derivatives, dependencies, dynamics, results, reset, rejections, logs, resources, malformed.
    #[arg(long, value_delimiter = ',', value_parser = clap::builder::PossibleValuesParser::new(rules::TOPICS))]
    pub only: Vec<String>,
    /// Does not fail if these topics or interfaces (co-simulation, model-exchange, scheduled-execution; separated by commas) are
    /// not checked.
    #[arg(long, value_name = "NAME", value_delimiter = ',', value_parser = clap::builder::PossibleValuesParser::new(
        rules::TOPICS.iter().chain(&INTERFACES)))]
    pub allow_unchecked: Vec<String>,
    /// Maximum duration of the check in seconds, including the repetitions that prove findings.
    #[arg(long, default_value_t = 120.0, value_parser = seconds)]
    pub time: f64,
    /// Maximum duration of a call sequence in seconds; a longer one is a hang if it also exceeds three times this limit when it
    /// is repeated.
    #[arg(long, default_value_t = 10.0, value_parser = seconds)]
    pub limit: f64,
    /// Megabytes of memory that the FMU may use.
    #[arg(long, default_value_t = 8192)]
    pub memory: u64,
    /// Maximum size of the unpacked FMU in megabytes.
    #[arg(long, default_value_t = 1000)]
    pub unpacked: u64,
    /// Seed of the random call sequences.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Checks in at most 30 seconds, without the topics malformed and resources, and with fewer values and call sequences.
    #[arg(long, conflicts_with = "time")]
    pub quick: bool,
    /// Accepts the findings, and the unchecked topics and interfaces, in this file. A line is NAME: REASON, or
    /// NAME "PART OF THE OBSERVATION": REASON.
    #[arg(long, value_name = "FILE")]
    pub baseline: Option<PathBuf>,
    /// Prints a rule, its severity and its section of the standard; `all` prints all rules.
    #[arg(long, value_name = "RULE", exclusive = true)]
    pub explain: Option<String>,
    /// Writes report.html, report.json, junit.xml and report.sarif to this directory.
    #[arg(long, value_name = "DIRECTORY")]
    pub out: Option<PathBuf>,
    /// Prints the report as JSON.
    #[arg(long)]
    pub json: bool,
    /// Fails for findings of this severity and worse.
    #[arg(long, value_enum, default_value_t = FailOn::Violation)]
    pub fail_on: FailOn,
    /// Seconds after which the repetitions that detect leaks end; if there are then too few for an evaluation, they may take four
    /// times as long.
    #[arg(long, default_value_t = 1.5, value_parser = seconds)]
    pub repeat: f64,
    /// Does not shorten call sequences.
    #[arg(long)]
    pub no_shrink: bool,
    /// Also checks interface types that start another program (needsExecutionTool); that program must be installed.
    #[arg(long)]
    pub execution_tool: bool,
    /// Whether this is the check of a build: it makes the calls of a quick check, but in `time` and with `limit`, because a slow model
    /// is not a mistake.
    #[arg(skip)]
    pub is_build: bool,
}

/// Reads a duration in seconds.
pub(crate) fn seconds(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(seconds) if seconds > 0.0 && seconds <= LONGEST => Ok(seconds),
        _ => Err(format!("write a number of seconds above 0 and up to {LONGEST}")),
    }
}

impl Options {
    /// Returns whether a topic or a rule is to be checked.
    pub(crate) fn wants(&self, name: &str) -> bool {
        let topic = topic_of(name);
        match self.only.is_empty() {
            true => !self.quick || !LONG.contains(&topic),
            false => self.only.iter().any(|only| only == topic || only == name),
        }
    }
}

/// The defaults of the command.
impl Default for Options {
    fn default() -> Self {
        let command = Self::augment_args(clap::Command::new("fmu-check")).no_binary_name(true);
        let matches = command.get_matches_from([""; 0]);
        Self::from_arg_matches(&matches).unwrap_or_else(|error| error.exit())
    }
}

/// Lowest severity that fails the check.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum FailOn {
    /// Violations of the standard.
    Violation,
    /// Fragile findings and violations.
    Fragile,
    /// All findings.
    Note,
    /// No finding fails the check.
    Never,
}

/// Names of the interface types that an FMU may have.
pub const INTERFACES: [&str; 3] = ["co-simulation", "model-exchange", "scheduled-execution"];
