//! All rules in one table: the name of a finding, its severity and the section for FMI 2.0 and FMI 3.0, and the requirement.

use crate::finding::Finding;
use crate::finding::Severity::{self, Fragile as F, Note as N, Violation as V};
use fmi_abi::Standard;

/// The editions of the standard whose sections the table names, for FMI 2.0 and FMI 3.0.
pub const EDITIONS: [&str; 2] = ["FMI 2.0.5", "FMI 3.0.2"];

/// The topics of the rules.
pub const TOPICS: [&str; 14] = [
    "description",
    "package",
    "functions",
    "start_values",
    "life_cycle",
    "states",
    "derivatives",
    "dependencies",
    "results",
    "reset",
    "refusals",
    "logs",
    "resources",
    "hostile",
];

/// The rule that the files break, with what is wrong.
pub type Observation = (&'static str, String);

/// A rule.
pub struct Rule {
    /// Its name: the topic, a dot, the observation.
    pub name: &'static str,
    /// The severity of a finding in FMI 2.0 and in FMI 3.0.
    pub severities: [Severity; 2],
    /// The sections of the two editions; empty where the rule is not part of the standard.
    pub sections: [&'static str; 2],
    /// The requirement in a sentence.
    pub requirement: &'static str,
}

impl Rule {
    /// The severity of a finding.
    pub fn severity(&self, standard: Standard) -> Severity {
        self.severities[usize::from(standard == Standard::Fmi3)]
    }

    /// The section with the edition.
    pub fn section(&self, standard: Standard) -> String {
        let of = usize::from(standard == Standard::Fmi3);
        match self.sections[of] {
            "" => String::new(),
            section => format!("{} section {section}", EDITIONS[of]),
        }
    }
}

/// Sentences of the standard: a rule, the FMI version, the section, the text.
#[rustfmt::skip]
const QUOTES: &[(&str, u8, &str, &str)] = &[
    ("description.encoding", 2, "2.2", "The first line of an XML file, such as modelDescription.xml, must contain the encoding scheme of the XML file. It is required that the encoding scheme is always UTF-8."),
    ("description.start", 2, "2.2.7", "If initial = \"exact\" or \"approx\", or causality = \"input\", a start value must be provided."),
    ("description.structure", 2, "2.2.8", "Ordered list of all outputs, in other words, a list of ScalarVariable indices where every corresponding ScalarVariable must have causality = \"output\" (and every variable with causality=\"output\" must be listed here)."),
    ("life_cycle.simulation", 3, "2.3.1", "For FMUs that have clocks, eventModeUsed = fmi3True is required."),
    ("life_cycle.free-null", 2, "2.1.5", "If a null pointer is provided for c, the function call is ignored (does not have an effect)."),
    ("life_cycle.states-changed", 2, "3.2.2", "If valuesOfContinuousStatesChanged = fmi2True, then at least one element of the continuous state vector has changed its value due to the function call."),
    ("life_cycle.stop-time", 3, "2.3.2", "If the environment tries to compute past stopTime, the FMU has to return fmi3Status = fmi3Error."),
    ("logs.category", 3, "2.3.1", "The allowed values for category are defined in the modelDescription.xml file via the element <LogCategories>. If the FMU does not define any log categories, category must be NULL."),
    ("logs.off", 3, "2.3.1", "logMessage must only be called for log categories that were enabled by calls to fmi3SetDebugLogging or via loggingOn = fmi3True in fmi3Instantiate."),
    ("logs.silent", 3, "2.3.1", "If a function does not return fmi3OK, it must provide the reason by calling logMessage at least once with this status."),
    ("refusals.discarded", 3, "2.2.4", "The call was not successful and the FMU is in the same state as before the call."),
    ("reset.incomplete", 2, "2.1.6", "The FMU goes into the same state as if fmi2Instantiate would have been called."),
    ("reset.values", 2, "2.1.6", "All variables have their default values."),
    ("resources.settings", 3, "2.2.1", "FMI functions must not change global settings which affect other processes/threads."),
    ("results.early-return", 3, "2.3.1", "If earlyReturnAllowed = fmi3True the importer can handle early return. Only in this case, fmi3DoStep may return with earlyReturn = fmi3True."),
    ("results.threads", 2, "2.1", "FMI functions of one instance do not need to be thread-safe."),
    ("start_values.start", 2, "2.2.7", "If fmiSetXXX is not called on a variable with causality = \"input\", then the FMU must use the start value as value of this input."),
    ("states.changed-by-saving", 2, "2.1.8", "fmi2GetFMUstate makes a copy of the internal FMU state and returns a pointer to this copy (FMUstate)."),
    ("states.free", 2, "2.1.8", "If a null pointer is provided, the call is ignored. The function returns a null pointer in argument FMUstate."),
    ("states.restore-values", 2, "2.1.8", "fmi2SetFMUstate copies the content of the previously copied FMUstate back and uses it as actual new FMU state."),
    ("states.several", 2, "2.1.8", "If *FMUstate != NULL, then *FMUstate points to a previously returned FMUstate that has not been modified since."),
    ("states.twice", 2, "2.1.8", "The FMUstate copy still exists."),
];

const fn rule(
    name: &'static str,
    severities: [Severity; 2],
    sections: [&'static str; 2],
    requirement: &'static str,
) -> Rule {
    Rule { name, severities, sections, requirement }
}

/// The rule of this name. The end of a process (`crash`, `exit`, `hang`) is one of the call sequence's rule, such as
/// `states.fresh-process.crash`, or of its topic, such as `states.crash`.
pub fn find(name: &str) -> Option<&'static Rule> {
    let same = |of: &str| RULES.iter().find(|rule| rule.name == of);
    let of_end = |(base, end): (&str, &str)| {
        let end = ["crash", "exit", "hang"].contains(&end).then(|| same(&format!("*.{end}")))?;
        same(base).or_else(|| end.filter(|_| TOPICS.contains(&base)))
    };
    same(name).or_else(|| of_end(name.rsplit_once('.')?))
}

/// A rule as text, or all of them as a page; `None` if there is no such rule.
pub fn explain(name: &str) -> Option<String> {
    if name != "all" {
        return find(name).map(|rule| page(rule, name));
    }
    let begin = "# Rules of fmu-check\n\nThe rules for the end of a process (`*`) hold in every topic: `states.crash` is a crash \
        in a call that tests saved states. `fmu-check --explain all` prints this page.\n";
    Some(RULES.iter().fold(begin.to_owned(), |text, rule| text + "\n" + &page(rule, rule.name)))
}

fn page(rule: &Rule, name: &str) -> String {
    let (standards, mut lines) = ([Standard::Fmi2, Standard::Fmi3], Vec::new());
    for standard in standards {
        let severity = rule.severity(standard).name();
        match rule.section(standard) {
            section if section.is_empty() => {
                lines.push(format!("* {standard}: {severity}, not in the standard"))
            }
            section => lines.push(format!("* {severity} in {section}")),
        }
    }
    let quote = QUOTES.iter().find(|(of, ..)| *of == rule.name);
    let quote = quote.map_or(String::new(), |(_, standard, section, text)| {
        let edition = EDITIONS[usize::from(*standard == 3)];
        format!("\n> {text}\n>\n> {edition} section {section}\n")
    });
    format!("## {name}\n\n{}\n\n{}\n{quote}", rule.requirement, lines.join("\n"))
}

const SAVING: [&str; 2] = ["2.1.8", "2.2.7.4"];
const VALUES: [&str; 2] = ["2.1.7", "2.2.7.2"];
const VARIABLES: [&str; 2] = ["2.2.7", "2.4.7.4"];
const STRUCTURE: [&str; 2] = ["2.2.8", "2.4.8"];
const DERIVATIVES: [&str; 2] = ["2.1.9", "2.2.12"];
const CREATION: [&str; 2] = ["2.1.5", "2.3.1"];
const STATUS: [&str; 2] = ["2.1.3", "2.2.4"];
const GENERAL: [&str; 2] = ["2.1", "2.2.1"];
const FILES: [&str; 2] = ["2.3", "2.5.1"];
const MACHINES: [&str; 2] = ["3.2.3 and 4.2.4", "2.3"];
const EVENTS: [&str; 2] = ["3.2.2", "2.3.5"];
const RESET: [&str; 2] = ["2.1.6", "2.3.1"];
const ARRAYS: [&str; 2] = ["2.1.7", "2.2.7"];
const STEP: [&str; 2] = ["4.2.2", "4.2.1"];

/// All rules.
#[rustfmt::skip]
pub static RULES: &[Rule] = &[
    rule("*.crash", [V; 2], STATUS, "A call that the standard allows returns with a status."),
    rule("*.exit", [V; 2], STATUS, "A call that the standard allows returns with a status and does not end the process."),
    rule("*.hang", [V; 2], STATUS, "A call that the standard allows returns. It was repeated with nothing beside it and three times the time."),
    rule("arrays.const", [V; 2], ARRAYS, "The FMU does not write to an array that is for reading (const)."),
    rule("arrays.read-beyond", [V; 2], ARRAYS, "The FMU does not read beyond an array that the importer passes with its size."),
    rule("arrays.written-beyond", [V; 2], ARRAYS, "The FMU does not write outside of the arrays that the importer passes with their sizes."),
    rule("dependencies.initial", [V; 2], STRUCTURE, "An initial unknown that depends on an input or on an exact start value lists it in ModelStructure."),
    rule("dependencies.missing", [V; 2], STRUCTURE, "An output or derivative that depends on an input or a state lists it in ModelStructure."),
    rule("derivatives.adjoint", [V; 2], DERIVATIVES, "Adjoint derivatives are those of the transposed matrix."),
    rule("derivatives.adjoint-digits", [N; 2], DERIVATIVES, "Adjoint and directional derivatives agree in 11 digits."),
    rule("derivatives.changed", [V; 2], DERIVATIVES, "A query of derivatives changes no value."),
    rule("derivatives.directional", [V; 2], DERIVATIVES, "Partial derivatives are those of the model, as differences of its values show them."),
    rule("derivatives.linear", [V; 2], DERIVATIVES, "Directional derivatives are linear in the seed."),
    rule("derivatives.nominals", [V; 2], ["3.2.2", "3.2.1"], "Nominal values of states are greater than zero."),
    rule("derivatives.order", [V; 2], DERIVATIVES, "Partial derivatives are those of the variables in the order of the call."),
    rule("derivatives.precision", [N; 2], DERIVATIVES, "Partial derivatives are as exact as differences of the model's values can show; less exact ones may be differences themselves."),
    rule("derivatives.vectors", [V; 2], ["3.2.2", "3.2.1"], "The vectors of states and derivatives have the values of their variables, in the order of ModelStructure."),
    rule("description.combination", [V; 2], VARIABLES, "Causality, variability and initial are a combination of the tables; only floating-point numbers are continuous."),
    rule("description.encoding", [V; 2], ["2.2", "2.4"], "modelDescription.xml is encoded in UTF-8."),
    rule("description.experiment", [V; 2], ["2.2.5", "2.4.6"], "The default experiment ends after its start."),
    rule("description.identifier", [V; 2], ["2.1.1", "2.2.2"], "modelIdentifier is a name in C."),
    rule("description.interfaces", [V; 2], ["2.2.1", "2.4.1"], "The FMU offers at least one interface type."),
    rule("description.names", [V; 2], VARIABLES, "Names of variables are unique."),
    rule("description.range", [V; 2], VARIABLES, "min is not greater than max, and start values lie between them."),
    rule("description.references", [V; 2], VARIABLES, "Each variable has a value reference; in FMI 3.0 value references are unique."),
    rule("description.start", [V; 2], VARIABLES, "Variables with initial = exact or approx and inputs have a start value of their type; calculated variables have none."),
    rule("description.structure", [V; 2], STRUCTURE, "ModelStructure lists all outputs and only derivatives and outputs of the model."),
    rule("description.token", [V; 2], ["2.2.1", "2.4.1"], "guid or instantiationToken is not empty."),
    rule("description.types", [V; 2], ["2.2.3", "2.4.4"], "Each variable has a type. Each declaredType is the name of a type in TypeDefinitions."),
    rule("description.units", [V; 2], ["2.2.2", "2.4.3"], "Units of variables are in UnitDefinitions."),
    rule("functions.capability", [V; 2], ["3.3.1 and 4.3.1", "2.4.2"], "The library can do what a capability flag declares."),
    rule("functions.missing", [V; 2], ["2.3", "2.2.2"], "The library exports all functions of its interface types, including those of capabilities that it lacks."),
    rule("functions.status", [V; 2], STATUS, "A function returns a status that the standard has for it."),
    rule("functions.version", [V; 2], ["2.1.4", "2.2.5"], "The library returns the version of the model description and the platform \"default\"."),
    rule("hostile.bytes", [F; 2], ["", ""], "Bytes that are no serialized state are rejected, and the process lives on."),
    rule("hostile.null", [F; 2], ["", ""], "NULL for an array is rejected, and the process lives on."),
    rule("hostile.null-instance", [F; 2], ["", ""], "NULL for an instance is rejected, and the process lives on."),
    rule("hostile.references", [F; 2], ["", ""], "Unknown value references are rejected, and the process lives on."),
    rule("hostile.sizes", [F; 2], ["", ""], "Wrong sizes are rejected, and the process lives on."),
    rule("hostile.times", [F; 2], ["", ""], "Times and steps that are impossible are rejected, and the process lives on."),
    rule("hostile.values", [F; 2], ["", ""], "Values that are impossible are accepted or rejected, and the process lives on."),
    rule("life_cycle.event-iteration", [F; 2], EVENTS, "The iteration of an event ends."),
    rule("life_cycle.exit", [V; 2], CREATION, "A process whose instances were freed exits; the destructors of the library return."),
    rule("life_cycle.free-null", [V; 2], CREATION, "FreeInstance ignores NULL."),
    rule("life_cycle.late-event", [N; 2], EVENTS, "After time events were skipped, the next one is in the future."),
    rule("life_cycle.next-event-time", [F; 2], EVENTS, "The next time event is in the future: importers integrate up to it."),
    rule("life_cycle.refused", [V; 2], MACHINES, "A call that the state machine allows, with valid arguments, succeeds."),
    rule("life_cycle.simulation", [V; 2], MACHINES, "A simulation with the numbers of the model description succeeds."),
    rule("life_cycle.states-changed", [V; 2], EVENTS, "An event that changes continuous states reports valuesOfContinuousStatesChanged; otherwise importers do not read them."),
    rule("life_cycle.stop-time", [V; 2], ["2.1.6", "2.3.2"], "A step beyond the stop time returns Error."),
    rule("life_cycle.token", [N; 2], CREATION, "Instantiation fails for a guid or instantiationToken that is not that of the model description."),
    rule("life_cycle.unload", [V; 2], CREATION, "A library whose instances were freed can be unloaded and loaded again."),
    rule("logs.category", [N, V], CREATION, "The category of a message is one of LogCategories, or NULL if there are none. FMI 2.0 requires that from edition 2.0.3 on, and the model description does not contain the edition."),
    rule("logs.format", [N; 2], CREATION, "A message is a string, not a format of printf."),
    rule("logs.off", [N, V], CREATION, "There are no messages when logging is off."),
    rule("logs.printed", [N; 2], CREATION, "Messages go to the logger; the standard output is the importer's."),
    rule("logs.silent", [N, V], CREATION, "A function that does not return OK logs the reason, if logging is on."),
    rule("logs.status", [V; 2], CREATION, "The status of a message is one of the standard's."),
    rule("logs.text", [V; 2], CREATION, "A message is a string in UTF-8."),
    rule("package.compression", [V; 2], FILES, "Entries of the ZIP file are stored or deflated."),
    rule("package.glibc", [N; 2], FILES, "A library for Linux runs on systems with glibc 2.28, which are some years old."),
    rule("package.library", [V; 2], FILES, "The library is called <modelIdentifier> with the extension of its platform."),
    rule("package.machine", [V; 2], FILES, "A library is for the processor that its directory is named after."),
    rule("package.names", [F; 2], FILES, "No two entries have names that differ only in upper and lower case."),
    rule("package.needs", [N; 2], FILES, "The libraries that a library needs are in the FMU or part of its platform."),
    rule("package.paths", [V; 2], FILES, "Entries lie within the FMU, with / between directories."),
    rule("package.platforms", [V; 2], FILES, "Directories in binaries are called <arch>-<sys> in FMI 3.0."),
    rule("package.symbols", [F; 2], FILES, "All functions that the library needs are in it or in the libraries that it names. Importers that look them up at once cannot load it."),
    rule("package.unloadable", [V; 2], FILES, "The library for this platform can be loaded."),
    rule("refusals.accepted", [F; 2], STATUS, "Unknown value references are rejected, so that a fault of the importer is noticed."),
    rule("refusals.changed", [F; 2], STATUS, "A rejected call leaves the instance unchanged: importers try again with other values."),
    rule("refusals.constant", [F, V], STATUS, "A constant cannot be set."),
    rule("refusals.crash", [F; 2], STATUS, "An impossible request is rejected, and the process lives on."),
    rule("refusals.discarded", [V; 2], STATUS, "After Discard the FMU is in the state before the call."),
    rule("refusals.exit", [F; 2], STATUS, "An impossible request is rejected, and the process lives on."),
    rule("refusals.hang", [F; 2], STATUS, "An impossible request is rejected without delay."),
    rule("refusals.tolerated", [N; 2], STATUS, "Impossible requests are rejected, so that a fault of the importer is noticed."),
    rule("reset.incomplete", [V; 2], RESET, "After a reset the instance behaves like a new one."),
    rule("reset.values", [V; 2], RESET, "After a reset all variables have their start values, regardless of the values set before."),
    rule("resources.cycles", [V; 2], CREATION, "A call sequence that succeeds once succeeds again, any number of times."),
    rule("resources.files", [V; 2], CREATION, "Files are closed with the instance that opened them."),
    rule("resources.memory", [V; 2], CREATION, "Memory of an instance or a state is freed with it."),
    rule("resources.processes", [V; 2], GENERAL, "Processes that an FMU starts end with the instance that started them."),
    rule("resources.settings", [V; 2], GENERAL, "Functions do not change settings of the process: floating-point control, locale, working directory, signals."),
    rule("resources.threads", [V; 2], CREATION, "Threads end with the instance that started them."),
    rule("results.cut", [N; 2], STEP, "With constant inputs, the state hardly depends on the number of steps (canHandleVariableCommunicationStepSize). Solvers with fixed steps have such errors."),
    rule("results.early-return", [V; 2], ["", "4.2.1"], "A step returns early, or requests event handling, only if that was agreed; lastSuccessfulTime is the time of the FMU."),
    rule("results.early-unsaid", [F; 2], ["", "4.2.1"], "A step that ends at an event before its end reports earlyReturn."),
    rule("results.instances", [V; 2], CREATION, "An instance is not affected by other instances."),
    rule("results.last-successful-time", [N; 2], ["", "4.2.1"], "A step ends at its end, unless the solver cannot (fixedInternalStepSize)."),
    rule("results.name", [F; 2], CREATION, "Numbers do not depend on the name of the instance."),
    rule("results.not-finite", [N; 2], VARIABLES, "Inputs near their start values give finite results."),
    rule("results.process", [F; 2], GENERAL, "The same calls give the same results in another process. Differences come from uninitialized memory, addresses, the clock or chance."),
    rule("results.reading", [V; 2], VALUES, "Reading changes neither values nor the further simulation."),
    rule("results.repeated", [F; 2], VALUES, "A variable that is queried twice in a call gets two values; a call that queries none succeeds."),
    rule("results.threads", [V; 2], GENERAL, "Different instances can be called from different threads at the same time."),
    rule("results.time", [V; 2], VARIABLES, "The independent variable is the time: after a step, its end."),
    rule("start_values.boolean", [V; 2], VARIABLES, "A Boolean is 0 or 1."),
    rule("start_values.fixed", [V; 2], VARIABLES, "Constants and parameters that are not set keep their values after the initialization."),
    rule("start_values.inputs", [V; 2], VALUES, "An input keeps its value until it is set again."),
    rule("start_values.range", [V; 2], VARIABLES, "Integer and enumeration variables that are local or outputs stay between min and max."),
    rule("start_values.set", [V; 2], VALUES, "The value that is read is the value that was set."),
    rule("start_values.start", [V; 2], VARIABLES, "In Initialization Mode, and before it in FMI 3.0, variables with initial = exact and inputs have their start values."),
    rule("start_values.text", [V; 2], VARIABLES, "A string is not NULL."),
    rule("start_values.unwritten", [V; 2], VALUES, "A function that returns OK has written all values that were queried."),
    rule("start_values.utf8", [V; 2], ["2.1.2", "2.2.3"], "Strings are encoded in UTF-8."),
    rule("start_values.when", [V; 2], VALUES, "Start values have the same effect before Initialization Mode and in it."),
    rule("states.bytes", [N; 2], SAVING, "A deserialized state is serialized to the same bytes. Differences show lost or uninitialized memory."),
    rule("states.changed-by-saving", [V; 2], SAVING, "Saving a state copies it and changes nothing."),
    rule("states.free", [V; 2], SAVING, "Freeing a state sets its handle to NULL; freeing NULL is ignored."),
    rule("states.fresh-process", [V; 2], SAVING, "Serialized bytes that are read in another process give the state: its values and the further simulation."),
    rule("states.modes", [V; 2], SAVING, "A state that was saved before or in Initialization Mode can be restored later, in that mode."),
    rule("states.restore", [V; 2], SAVING, "A simulation that continues from a restored state repeats the one that followed the saving."),
    rule("states.restore-values", [V; 2], SAVING, "A restored state has the values at the time of saving."),
    rule("states.serialized", [V; 2], SAVING, "Serialized bytes that are read by another instance give the state: its values and the further simulation."),
    rule("states.several", [V; 2], SAVING, "An instance has any number of saved states, and a handle can be used for a later one."),
    rule("states.twice", [V; 2], SAVING, "Restoring a state does not change it: it can be restored again."),
];

/// Returns the finding that an FMU breaks a rule.
///
/// # Panics
/// If there is no such rule. A test looks for such names.
pub fn broken(standard: Standard, name: &str, observed: String) -> Finding {
    let rule = find(name).unwrap_or_else(|| panic!("no rule is called {name}"));
    Finding {
        name: name.to_owned(),
        severity: rule.severity(standard),
        section: rule.section(standard),
        requirement: rule.requirement.to_owned(),
        observed,
        ..Finding::default()
    }
}

#[cfg(test)]
mod tests {
    use super::{QUOTES, RULES, TOPICS, explain, find};

    #[test]
    fn every_rule_is_written_once_in_order_with_a_topic() {
        let names: Vec<&str> = RULES.iter().map(|rule| rule.name).collect();
        assert!(names.is_sorted_by(|one, other| one < other));
        for name in names {
            let topic = name.split('.').next().unwrap_or_default();
            assert!(["*", "arrays"].contains(&topic) || TOPICS.contains(&topic), "{name}");
        }
    }

    #[test]
    fn ends_of_processes_have_a_rule_in_every_topic() {
        assert_eq!(find("states.crash").map(|rule| rule.name), Some("*.crash"));
        let of_sequence = find("states.fresh-process.crash").map(|rule| rule.name);
        assert_eq!(of_sequence, Some("states.fresh-process"));
        assert_eq!(find("states.restore").map(|rule| rule.name), Some("states.restore"));
        assert!(find("nothing.crash").is_none() && find("states.nothing").is_none());
    }

    /// The page in the documentation is the one that `--explain all` prints.
    #[test]
    fn the_page_has_all_rules() {
        let written = include_str!("../RULES.md");
        assert_eq!(
            explain("all").as_deref(),
            Some(written),
            "fmu-check --explain all > crates/fmu-check/RULES.md"
        );
        assert!(QUOTES.iter().all(|(name, ..)| RULES.iter().any(|rule| rule.name == *name)));
        assert!(explain("states.nothing").is_none());
    }

    /// The sources of the checks name no rule that is not in the table.
    #[test]
    fn every_claim_is_a_rule() {
        let directory = concat!(env!("CARGO_MANIFEST_DIR"), "/src/checks");
        let paths = std::fs::read_dir(directory).expect("the checks").flatten().map(|entry| entry.path());
        let others =
            ["checker.rs", "lib.rs", "always.rs"].map(|name| format!("{directory}/../{name}").into());
        for path in paths.chain(others) {
            let source: String = std::fs::read_to_string(&path).expect("a source");
            // Names end before what ends a run, such as ".hang".
            let names = source.split('"').filter(|name| {
                let topic = name.split_once('.').filter(|(_, rule)| !rule.is_empty());
                topic.is_some_and(|(topic, _)| topic == "arrays" || super::TOPICS.contains(&topic))
            });
            let unknown: Vec<&str> = names.filter(|name| find(name).is_none()).collect();
            assert_eq!(unknown, Vec::<&str>::new(), "{}", path.display());
        }
    }
}
