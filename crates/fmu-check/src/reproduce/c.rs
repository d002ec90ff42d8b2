//! Writes a call sequence as a program in C.

use super::evidence::{Evidence, Expected, Measure};
use crate::call_sequence::{
    Arg, CallSequence, Integration, Kind, Make, NULL_INSTANCE, Numbered, Setting, Step,
};
use crate::description::Description;
use crate::finding::Finding;
use fmi_abi::calls::signature;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

/// Returns the program that makes the calls of a finding and compares their results with the evidence.
pub fn program(
    finding: &Finding,
    sequence: &CallSequence,
    evidence: &Evidence,
    setting: &Setting,
    description: &Description,
) -> String {
    let mut writer = Writer {
        fmi3: setting.fmi3,
        evidence,
        description,
        next: 0,
        threads: String::new(),
        instances: BTreeSet::new(),
        states: BTreeSet::new(),
        bytes: BTreeSet::new(),
    };
    // Each part of the sequence is executed in a separate process.
    let parts = sequence.split(|numbered| numbered.step == Step::FreshProcess).enumerate();
    let parts: Vec<String> = parts
        .map(|(number, part)| {
            format!("static void phase{number}(void) {{\n{}}}\n\n", writer.block(part, "    "))
        })
        .collect();
    let Writer { threads, instances, states, bytes, .. } = &writer;
    let each = |slots: &BTreeSet<usize>, write: &dyn Fn(&usize) -> String| {
        slots.iter().map(write).collect::<String>()
    };
    let declared = each(instances, &|index| format!("static void *c{index};\n"))
        + &each(states, &|slot| format!("static void *s{slot};\n"))
        + &each(bytes, &|slot| format!("static size_t *n{slot};\nstatic char *b{slot};\n"));
    // Files pass the serialized states to the next process.
    let load = each(bytes, &|slot| {
        format!("    b{slot} = guarded(NULL, 1 << 24);\n    n{slot} = passed_on({slot}, b{slot});\n")
    });
    let save = each(bytes, &|slot| format!("    pass_on({slot}, b{slot}, *n{slot});\n"));
    let list: Vec<String> = (0..parts.len()).map(|number| format!("phase{number}")).collect();
    let places: Vec<String> =
        sequence.split(|numbered| numbered.step == Step::FreshProcess).map(place).collect();
    format!(
        "/*\n{} * cc -ffp-contract=off repro.c -o repro -ldl -lpthread -lm && ./repro DIRECTORY_OF_THE_UNPACKED_FMU\n *\n \
         * Exit status: 1 if the finding is reproduced, 0 if it is not, 3 if that is not known.\n */\n\
         #define FMI {}\n{}{declared}\n{threads}{}static void (*const phases[])(void) = {{{}}};\n\
         static const char *const places[] = {{{}}};\n\
         static const char library_name[] = \"{}\";\n\nstatic void load(void) {{\n{load}}}\n\n\
         static void save(void) {{\n{save}}}\n\n{}{}",
        head(finding, description),
        if setting.fmi3 { 3 } else { 2 },
        prelude(sequence),
        parts.concat(),
        list.join(", "),
        places.join(", "),
        library(setting, sequence),
        shows(evidence),
        include_str!("main.c")
    )
}

/// Returns the C expression for the directory in which a process finds the FMU: a name, or NULL for the directory that the
/// program gets as its argument.
fn place(part: &[Numbered]) -> String {
    match part.first().map(|numbered| &numbered.step) {
        Some(Step::Elsewhere(name)) => literal(name.as_bytes()),
        _ => "NULL".to_owned(),
    }
}

/// Returns the C functions that the calls need.
fn prelude(sequence: &CallSequence) -> String {
    let integrates = sequence.iter().any(|numbered| matches!(numbered.step, Step::Integrate(..)));
    [include_str!("prelude.c"), if integrates { include_str!("integrate.c") } else { "" }].concat()
}

/// Returns the lines of the comment at the beginning of a program.
fn head(finding: &Finding, description: &Description) -> String {
    let section = if finding.section.is_empty() { "not in the standard" } else { &finding.section };
    let lines = [
        format!("{}: {} ({}, {section})", description.model_name, finding.name, finding.severity.name()),
        String::new(),
        format!("Rule: {}", finding.requirement),
        format!("Observed: {}", finding.observed),
        String::new(),
    ];
    lines.iter().map(|line| format!(" * {}\n", in_comment(line))).collect()
}

/// Prepares a string for a comment: puts it on one line, and replaces the characters that could end the comment, even as
/// trigraphs or over continued lines.
fn in_comment(text: &str) -> String {
    fmi_abi::one_line(&text.replace('\\', "/")).replace('\\', "/").replace("??", "? ?").replace("*/", "* /")
}

/// Returns the path of the library in the directory of the unpacked FMU.
fn library(setting: &Setting, sequence: &CallSequence) -> String {
    let model_exchange =
        sequence.iter().any(|numbered| matches!(&numbered.step, Step::Make(_, make) if !make.co_simulation));
    let index = usize::from(model_exchange || setting.libraries[0].is_none());
    let path = setting.libraries[index].clone().unwrap_or_default();
    let directory = setting.resources.parent().unwrap_or(&setting.resources);
    path.strip_prefix(directory).unwrap_or(&path).to_string_lossy().replace('\\', "/")
}

/// Returns the C function that decides whether the results of the calls reproduce the finding.
fn shows(evidence: &Evidence) -> String {
    let results = match evidence {
        Evidence::None | Evidence::End | Evidence::Orphans => None,
        Evidence::Printed => Some("has_text(result(\"printed\", 0))".to_owned()),
        Evidence::Damage => Some("noted(\"damage\")".to_owned()),
        Evidence::Strays => Some("noted(\"stray\")".to_owned()),
        Evidence::Differ(pairs) => {
            let list: Vec<String> = pairs.iter().map(|[one, other]| format!("{{{one}, {other}}}")).collect();
            Some(format!("any_differ((const int[][2]){{{}}}, {})", list.join(", "), pairs.len()))
        }
        Evidence::Same(expected, pairs) => {
            let same = |Expected { id, observed, .. }: &Expected| match is_paired(pairs, *id) {
                // The values only have to differ from the values of the other call of the pair, so only the status is compared
                // with the expected one.
                true => {
                    let (status, _) = observed.split_once(';').unwrap_or_default();
                    format!("begins(result(\"r\", {id}), \"{status};\")")
                }
                false => format!("strcmp(result(\"r\", {id}), {}) == 0", literal(observed.as_bytes())),
            };
            let differ =
                |[one, other]: &[u32; 2]| format!("any_differ((const int[][2]){{{{{one}, {other}}}}}, 1)");
            let all: Vec<String> = expected.iter().map(same).chain(pairs.iter().map(differ)).collect();
            Some(all.join("\n        && "))
        }
        Evidence::Grown(Measure::Settings, first, last, _) => {
            let [first, last] = [first, last].map(|id| format!("strchr(result(\"r\", {id}), ';')"));
            Some(format!("strcmp({first}, {last}) != 0"))
        }
        Evidence::Grown(measure, first, last, limit) => {
            let index = *measure as usize;
            Some(format!("measured({last}, {index}) - measured({first}, {index}) > {limit}"))
        }
    };
    let kind = match evidence {
        Evidence::None => "NONE",
        Evidence::End => "END",
        Evidence::Orphans => "ORPHANS",
        _ => "RESULTS",
    };
    let results = results.unwrap_or_else(|| "false".to_owned());
    format!("#define EVIDENCE {kind}\n\nstatic bool shows(void) {{\n    return {results};\n}}\n\n")
}

/// Returns whether a call belongs to a pair.
fn is_paired(pairs: &[[u32; 2]], id: u32) -> bool {
    pairs.iter().any(|pair| pair.contains(&id))
}

/// Writes calls in C, and collects the functions and variables that they need.
struct Writer<'a> {
    fmi3: bool,
    evidence: &'a Evidence,
    description: &'a Description,
    /// Number of the next loop or thread function.
    next: usize,
    /// Functions that run on separate threads, and the functions that they call.
    threads: String,
    /// Indices of the instances, saved states and serialized states that need a variable.
    instances: BTreeSet<usize>,
    states: BTreeSet<usize>,
    bytes: BTreeSet<usize>,
}

impl Writer<'_> {
    fn number(&mut self) -> usize {
        self.next += 1;
        self.next - 1
    }

    fn block(&mut self, sequence: &[Numbered], indent: &str) -> String {
        indented(&sequence.iter().map(|numbered| self.step(numbered)).collect::<String>(), indent)
    }

    /// Writes each call that the threads make several times as a function, because threads repeat whole simulations: a program
    /// with every call in full would have tens of thousands of lines. Returns the names of the functions by their bodies.
    fn repeated_calls(&mut self, sequences: &[Vec<Numbered>]) -> BTreeMap<String, String> {
        let mut counts = BTreeMap::<String, usize>::new();
        for numbered in sequences.iter().flatten() {
            if let Step::Call { instance: Some(_), function, args } = &numbered.step {
                *counts.entry(self.call(numbered.id, FUNCTION_ARGUMENTS, function, args)).or_default() += 1;
            }
        }
        let mut names = BTreeMap::new();
        for body in counts.into_iter().filter(|(_, count)| *count > 1).map(|(body, _)| body) {
            let name = format!("call{}", self.number());
            let lines = indented(&body, "    ");
            let _ = write!(self.threads, "static void {name}(void *instance, int id) {{\n{lines}}}\n\n");
            names.insert(body, name);
        }
        names
    }

    /// Writes a step of a thread; `repeated` has the names of the functions that make calls.
    fn step_on_thread(&mut self, numbered: &Numbered, repeated: &BTreeMap<String, String>) -> String {
        if let Step::Call { instance: Some(index), function, args } = &numbered.step {
            let body = self.call(numbered.id, FUNCTION_ARGUMENTS, function, args);
            if let Some(name) = repeated.get(&body) {
                self.instances.insert(*index);
                return format!("{name}(c{index}, {});\n", numbered.id);
            }
        }
        self.step(numbered)
    }

    /// Returns whether the values and the messages of a call are compared; `None` if the call is not compared.
    fn matters(&self, id: u32) -> Option<[bool; 2]> {
        match self.evidence {
            Evidence::Same(expected, pairs) => {
                let result = expected.iter().find(|result| result.id == id)?;
                let [values, messages] = result.matters;
                Some([values, messages && !is_paired(pairs, id)])
            }
            Evidence::Differ(pairs) => pairs.iter().any(|pair| pair.contains(&id)).then_some([true, false]),
            _ => None,
        }
    }

    fn step(&mut self, Numbered { id, step, .. }: &Numbered) -> String {
        match step {
            Step::Make(index, make) => self.make(*id, *index, make),
            Step::Call { instance, function, args } => {
                self.instances.extend(*instance);
                let handle = instance.map_or("NULL".to_owned(), |index| format!("c{index}"));
                self.call(*id, [&handle, &id.to_string()], function, args)
            }
            Step::Version(name) => format!("version({id}, \"{name}\");\n"),
            Step::Free(index) => {
                let name = if self.fmi3 { "fmi3FreeInstance" } else { "fmi2FreeInstance" };
                let instance = if *index == NULL_INSTANCE { "NULL".to_owned() } else { format!("c{index}") };
                format!("((void (*)(void *))function(\"{name}\"))({instance});\n")
            }
            Step::Measure => format!("measure({id});\n"),
            Step::Unload => "close_library();\nopen_library();\n".to_owned(),
            Step::Quit => "exit(0);\n".to_owned(),
            Step::Repeat(times, steps) => {
                let (body, i) = (self.block(steps, "    "), self.number());
                format!(
                    "quiet = true;\nfor (long i{i} = 0; i{i} < {times}; i{i}++) {{\n{body}}}\nquiet = false;\n"
                )
            }
            Step::Parallel(sequences) => {
                let (mut text, mut joins) = (String::new(), String::new());
                let repeated = self.repeated_calls(sequences);
                for sequence in sequences {
                    let line = |numbered| self.step_on_thread(numbered, &repeated);
                    let body = indented(&sequence.iter().map(line).collect::<String>(), "    ");
                    let number = self.number();
                    let _ = write!(
                        self.threads,
                        "static void *thread{number}(void *nothing) {{\n{body}    return nothing;\n}}\n\n"
                    );
                    let _ = writeln!(
                        text,
                        "pthread_t t{number};\npthread_create(&t{number}, NULL, thread{number}, NULL);"
                    );
                    let _ = writeln!(joins, "pthread_join(t{number}, NULL);");
                }
                format!("threads = true;\n{text}{joins}threads = false;\n")
            }
            Step::Integrate(index, how) => {
                let (euler, Integration { states, indicators, steps, .. }) = (u8::from(how.euler), how);
                let (begin, end) = (how.begin, how.end);
                let call = format!(
                    "integrate(c{index}, {begin:?}, {end:?}, {steps}, {euler}, {states}, {indicators}, events)"
                );
                let result = match self.matters(*id) {
                    None => String::new(),
                    Some([written, _]) => {
                        let events = if written { "put_numbers(file, events, 3, 8); " } else { "" };
                        format!("FILE *file = begin({id}, status); {events}end(file, \"\"); ")
                    }
                };
                format!("if (c{index}) {{ double events[3]; int status = {call}; {result}}}\n")
            }
            Step::FreshProcess | Step::Elsewhere(_) => String::new(),
        }
    }

    fn make(&mut self, id: u32, index: usize, make: &Make) -> String {
        self.instances.insert(index);
        let (name, token) = (literal(make.name.as_bytes()), literal(make.token.as_bytes()));
        let flags = [make.co_simulation, make.logging, make.event_mode, make.early_return];
        let flags = flags.map(|flag| flag.to_string()).join(", ");
        let made = format!("c{index} = make({index}, {name}, {token}, {flags});\n");
        let [_, log] = self.matters(id).unwrap_or_default();
        let log = if log { "messages" } else { "\"\"" };
        let result = format!("{{ FILE *file = begin({id}, c{index} != NULL); end(file, {log}); }}\n");
        made + if self.matters(id).is_some() { result.as_str() } else { "" }
    }

    /// Writes a call. `handle` and `number` are the C expressions for the instance and for `id`.
    fn call(&mut self, id: u32, [handle, number]: [&str; 2], name: &str, args: &[Arg]) -> String {
        let Some(signature) = signature(name) else { return String::new() };
        let mut parts = Parts::default();
        let (mut types, mut passed) = (String::new(), String::new());
        for (index, (arg, argument)) in args.iter().zip(signature.arguments).enumerate() {
            let _ = write!(types, ", {}", type_of(argument.of));
            let _ = write!(passed, ", {}", self.argument(&mut parts, (index, arg), name));
        }
        let guard = if handle == "NULL" { String::new() } else { format!("if ({handle}) ") };
        let comment =
            comment(args, self.description).map_or(String::new(), |names| format!(" /* {names} */"));
        let mut after = parts.after;
        if let Some([written, log]) = self.matters(id) {
            after.push(format!("FILE *file = begin({number}, status);"));
            after.extend(parts.results.into_iter().filter(|_| written));
            after.push(format!("end(file, {});", if log { "messages" } else { "\"\"" }));
        }
        if *self.evidence == Evidence::Damage {
            after.extend(parts.checks);
        }
        let updates = ["fmi2NewDiscreteStates", "fmi3UpdateDiscreteStates"].contains(&name)
            && args.iter().all(|arg| matches!(arg, Arg::Out(..)));
        let call = match updates {
            true => "update_states".to_owned(),
            false => format!("((int (*)(void *{types}))function(\"{name}\"))"),
        };
        let lines = |lines: Vec<String>| lines.iter().map(|line| format!("    {line}\n")).collect::<String>();
        format!(
            "{guard}{{{comment}\n    size_t before = arrays;\n{}    *messages = 0;\n\
             \x20   int status = {call}({handle}{passed});\n\
             {}\x20   print(\"{name}: %d\", status);\n{}    print(\"\\n\"); release(before);\n}}\n",
            lines(parts.before),
            // Gives other threads time to overwrite the strings before this thread copies them.
            if name.ends_with("GetString") { "    if (threads) usleep(20);\n" } else { "" },
            lines(after)
        )
    }

    /// Returns the C expression for the argument with this number, and adds the lines that it needs to `parts`.
    fn argument(&mut self, parts: &mut Parts, (number, arg): (usize, &Arg), name: &str) -> String {
        let string = |text: &Vec<u8>, end: usize| format!("guarded({}, {})", literal(text), text.len() + end);
        match arg {
            Arg::State(slot) | Arg::StateOut(slot) => self.states.extend([*slot]),
            Arg::Saved(slot) | Arg::SavedSize(slot) | Arg::SizeOut(slot) | Arg::SavedOut(slot) => {
                self.bytes.extend([*slot]);
            }
            _ => {}
        }
        match arg {
            Arg::Real(bits) => number_of(Kind::F64, *bits),
            Arg::Integer(number) => number.to_string(),
            Arg::Null => "NULL".to_owned(),
            Arg::In(kind, bits) => {
                parts.array(number, kind.c_name(), bits.iter().map(|bits| number_of(*kind, *bits)))
            }
            Arg::Strings(texts) => {
                let pointer =
                    |text: &Option<Vec<u8>>| text.as_ref().map_or("NULL".to_owned(), |text| string(text, 1));
                parts.array(number, "void *", texts.iter().map(pointer))
            }
            Arg::Blobs(blobs) => parts.array(number, "void *", blobs.iter().map(|blob| string(blob, 0))),
            Arg::Out(kind, count) => parts.out(name, *kind, *count, number),
            Arg::State(slot) => format!("s{slot}"),
            Arg::StateOut(slot) => {
                parts.results.push(format!("fprintf(file, \"%d,;\", s{slot} != NULL);"));
                format!("&s{slot}")
            }
            Arg::Saved(slot) => format!("guarded(b{slot}, *n{slot})"),
            Arg::SavedSize(slot) => format!("*n{slot}"),
            Arg::SizeOut(slot) => {
                parts.after.push(format!("print(\" -> %zu bytes\", *n{slot});"));
                parts.results.push(format!("put_numbers(file, n{slot}, 1, 8);"));
                format!("n{slot}")
            }
            Arg::SavedOut(slot) => {
                parts.before.push(format!("void *a{number} = guarded(NULL, *n{slot});"));
                parts.after.push(format!("memcpy(b{slot}, a{number}, *n{slot});"));
                parts.results.push(format!("put_numbers(file, a{number}, *n{slot}, 1);"));
                format!("a{number}")
            }
        }
    }
}

/// C expressions for the instance and the number of a call in a function that makes it.
const FUNCTION_ARGUMENTS: [&str; 2] = ["instance", "id"];

/// Returns the lines of a text with an indent.
fn indented(text: &str, indent: &str) -> String {
    text.lines().fold(String::new(), |all, line| all + indent + line + "\n")
}

/// Lines that the arguments of a call need.
#[derive(Default)]
struct Parts {
    /// Lines before the call.
    before: Vec<String>,
    /// Lines that print or copy the results after the call.
    after: Vec<String>,
    /// Lines that write the results to a file.
    results: Vec<String>,
    /// Lines that detect writes outside of the arrays for results.
    checks: Vec<String>,
}

impl Parts {
    /// Adds an array for the FMU to read; returns the name of its variable.
    fn array(&mut self, number: usize, element: &str, list: impl Iterator<Item = String>) -> String {
        let list: Vec<String> = list.collect();
        let (count, list) = (list.len(), if list.is_empty() { "0".to_owned() } else { list.join(", ") });
        let size = format!("{count} * sizeof *v{number}");
        self.before.push(format!(
            "{element} v{number}[] = {{{list}}}; void *a{number} = guarded(v{number}, {size});"
        ));
        self.checks.push(format!("check_array(a{number}, v{number}, {size});"));
        format!("a{number}")
    }

    /// Adds an array for results; returns the name of its variable.
    fn out(&mut self, name: &str, kind: Kind, count: usize, number: usize) -> String {
        let (c, width) = (kind.c_name(), kind.size());
        self.before.push(format!("void *a{number} = guarded(NULL, {count} * sizeof({c}));"));
        self.checks.push(format!("check_array(a{number}, NULL, 0);"));
        let letter = match kind {
            Kind::Pointer => 's',
            kind if kind.is_float() => 'f',
            Kind::I8 | Kind::I16 | Kind::I32 | Kind::I64 => 'i',
            _ => 'u',
        };
        if name == "fmi2NewDiscreteStates" {
            // fmi2EventInfo has five flags, padding and the time.
            let time = format!("show((char *)a{number} + 24, 1, 'f', 8);");
            self.after.push(format!("print(\" ->\"); show(a{number}, 5, 'i', 4); {time}"));
        } else if name != "fmi3GetBinary" {
            let guard = if letter == 's' { "if (status < 2) " } else { "" };
            self.after.push(format!("print(\" ->\"); {guard}show(a{number}, {count}, '{letter}', {width});"));
        }
        if name != "fmi3GetBinary" {
            self.results.push(match letter {
                's' => format!("if (status < 2) put_strings(file, a{number}, {count});"),
                _ => format!("put_numbers(file, a{number}, {count}, {width});"),
            });
        }
        format!("a{number}")
    }
}

/// Returns the names of the variables whose value references are the first argument, at most eight.
fn comment(args: &[Arg], description: &Description) -> Option<String> {
    let Some(Arg::In(Kind::U32, references)) = args.first() else { return None };
    let names: Vec<&str> = references
        .iter()
        .take(8)
        .filter_map(|reference| {
            description.variables.iter().find(|variable| u64::from(variable.reference) == *reference)
        })
        .map(|variable| variable.name.as_str())
        .collect();
    let more = if references.len() > 8 { ", ..." } else { "" };
    (!names.is_empty()).then(|| format!("{}{more}", in_comment(&names.join(", "))))
}

/// Returns the C type of an argument that has this type in `fmi_abi`.
fn type_of(name: &str) -> &'static str {
    match name {
        "usize" => "size_t",
        "fmi2Real" | "fmi3Float64" => "double",
        "fmi3Boolean" => "bool",
        "fmi2ValueReference" | "fmi3ValueReference" => "uint32_t",
        name if name.starts_with('*') || name.to_lowercase().contains("fmustate") => "void *",
        _ => "int",
    }
}

/// Returns a number as a C expression.
fn number_of(kind: Kind, bits: u64) -> String {
    let number = kind.number(bits);
    match kind {
        Kind::F64 | Kind::F32 if number.is_nan() => "(0.0 / 0.0)".to_owned(),
        Kind::F64 | Kind::F32 if number.is_infinite() => {
            format!("({}1.0 / 0.0)", if number < 0.0 { "-" } else { "" })
        }
        Kind::F64 | Kind::F32 => format!("{number:?}"),
        Kind::I64 => format!("INT64_C({})", bits as i64),
        Kind::U64 | Kind::Size => format!("UINT64_C({bits})"),
        _ => format!("{number}"),
    }
}

/// Returns a C string literal of the first 4000 bytes.
fn literal(bytes: &[u8]) -> String {
    let text = bytes.iter().take(4000).fold(String::new(), |mut text, byte| {
        let _ = match byte {
            b'"' | b'\\' => write!(text, "\\{}", char::from(*byte)),
            b' '..=b'~' if *byte != b'?' => write!(text, "{}", char::from(*byte)),
            other => write!(text, "\\{other:03o}"),
        };
        text
    });
    format!("\"{text}\"")
}
