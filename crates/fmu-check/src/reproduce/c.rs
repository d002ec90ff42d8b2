//! A sequence as a program in C.

use super::evidence::{Evidence, Measure, Proof};
use super::{Names, head, library, phases};
use crate::call_sequence::{Arg, CallSequence, Kind, Make, NOBODY, Numbered, Setting, Step};
use crate::description::Description;
use crate::finding::Finding;
use fmi_abi::calls::signature;
use std::fmt::Write as _;

/// The program.
pub fn program(
    finding: &Finding,
    sequence: &CallSequence,
    evidence: &Evidence,
    setting: &Setting,
    description: &Description,
) -> String {
    let mut text = String::from("/*\n");
    for line in head(finding, description) {
        let _ = writeln!(text, " * {line}");
    }
    text.push_str(
        " * cc repro.c -o repro -ldl -lpthread && ./repro FOLDER_OF_THE_UNPACKED_FMU\n *\n \
         * Exit status: 1 if the finding shows, 0 if it does not, 3 if that cannot be told.\n */\n",
    );
    text.push_str(include_str!("prelude.c"));
    let names = Names::of(sequence);
    for index in names.instances.iter().filter(|index| **index != NOBODY) {
        let _ = writeln!(text, "static void *c{index};");
    }
    for slot in &names.states {
        let _ = writeln!(text, "static void *s{slot};");
    }
    for slot in &names.bytes {
        let _ = writeln!(text, "static size_t *n{slot};\nstatic char *b{slot};");
    }
    text.push_str(
        "static char resources[5000];\nstatic __attribute__((unused)) Callbacks callbacks = {say2, calloc, free, NULL, NULL};\n\n",
    );
    let mut writer = Writer { fmi3: setting.fmi3, evidence, description, next: 0, threads: String::new() };
    let mut bodies = String::new();
    let parts = phases(sequence);
    for (number, part) in parts.iter().enumerate() {
        let mut body = String::new();
        writer.steps(part, &mut body, "    ");
        let _ = write!(bodies, "static void phase{number}(void) {{\n{body}}}\n\n");
    }
    text.push_str(&writer.threads);
    text.push_str(&bodies);
    let list: Vec<String> = (0..parts.len()).map(|number| format!("phase{number}")).collect();
    let _ = writeln!(text, "static void (*const phases[])(void) = {{{}}};", list.join(", "));
    let _ = writeln!(text, "static const char library_name[] = \"{}\";", library(setting, sequence));
    let format = if setting.fmi3 { "%s/resources/" } else { "file://%s/resources" };
    let _ = writeln!(text, "static const char resources_format[] = \"{format}\";");
    // Serialized bytes are passed on to the next process in files.
    let each =
        |write: &dyn Fn(usize) -> String| names.bytes.iter().map(|slot| write(*slot)).collect::<String>();
    let load = each(&|slot| {
        format!("    b{slot} = guarded(NULL, 1 << 24);\n    n{slot} = passed_on({slot}, b{slot});\n")
    });
    let save = each(&|slot| format!("    pass_on({slot}, b{slot}, *n{slot});\n"));
    let _ = write!(text, "\nstatic void load(void) {{\n{load}}}\n\n");
    let _ = write!(text, "static void save(void) {{\n{save}}}\n\n");
    text.push_str(&shows(evidence));
    text.push_str(include_str!("main.c"));
    text
}

/// The function that tells whether the results of the calls are those of the finding.
fn shows(evidence: &Evidence) -> String {
    let (kind, expression) = match evidence {
        Evidence::None => ("NONE", "false".to_owned()),
        Evidence::End => ("END", "false".to_owned()),
        Evidence::Left => ("LEFT", "false".to_owned()),
        Evidence::Printed => ("RESULTS", "*result(\"printed\", 0) != 0".to_owned()),
        Evidence::Damage => ("RESULTS", "damaged()".to_owned()),
        Evidence::Differ(proofs) => {
            let of = |index: usize| proofs.get(index).map_or(0, |proof| proof.id);
            ("RESULTS", format!("strcmp(result(\"r\", {}), result(\"r\", {})) != 0", of(0), of(1)))
        }
        Evidence::AnyDiffer(pairs) => {
            let list: Vec<String> = pairs.iter().map(|[one, other]| format!("{{{one}, {other}}}")).collect();
            let list = list.join(", ");
            ("RESULTS", format!("any_differ((const int[][2]){{{list}}}, {})", pairs.len()))
        }
        Evidence::Same(proofs) => {
            let same = |Proof { id, observed, .. }: &Proof| {
                format!("strcmp(result(\"r\", {id}), {}) == 0", literal(observed.as_bytes()))
            };
            ("RESULTS", proofs.iter().map(same).collect::<Vec<_>>().join("\n        && "))
        }
        Evidence::Grown(Measure::Settings, first, last, _) => {
            let settings = |id: &u32| format!("strchr(result(\"r\", {id}), ';')");
            ("RESULTS", format!("strcmp({}, {}) != 0", settings(first), settings(last)))
        }
        Evidence::Grown(measure, first, last, most) => {
            let index = *measure as usize;
            ("RESULTS", format!("measured({last}, {index}) - measured({first}, {index}) > {most}"))
        }
    };
    format!("#define EVIDENCE {kind}\n\nstatic bool shows(void) {{\n    return {expression};\n}}\n\n")
}

struct Writer<'a> {
    fmi3: bool,
    evidence: &'a Evidence,
    description: &'a Description,
    next: usize,
    threads: String,
}

impl Writer<'_> {
    fn steps(&mut self, sequence: &[Numbered], text: &mut String, indent: &str) {
        for Numbered { id, step, .. } in sequence {
            let matters = match self.evidence {
                Evidence::Differ(proofs) | Evidence::Same(proofs) => {
                    proofs.iter().find(|proof| proof.id == *id).map(|proof| proof.matters)
                }
                Evidence::AnyDiffer(pairs) => {
                    pairs.iter().any(|pair| pair.contains(id)).then_some([true, true, false])
                }
                _ => None,
            };
            match step {
                Step::Make(index, make) => self.make(*id, *index, make, matters, text, indent),
                Step::Call { of, function, args } => {
                    self.call(*id, *of, function, args, matters, text, indent)
                }
                Step::Version(name) => {
                    let _ = writeln!(
                        text,
                        "{indent}{{\n{indent}    const char *version = ((const char *(*)(void))function(\"{name}\"))();\n\
                         {indent}    print(\"{name}: %s\\n\", version);\n\
                         {indent}    FILE *file = results(\"r\", {id}, \"w\"); put_texts(file, &version, 1); fclose(file);\n{indent}}}"
                    );
                }
                other => self.around(*id, other, text, indent),
            }
        }
    }

    /// A step that is no call of the FMU.
    fn around(&mut self, id: u32, step: &Step, text: &mut String, indent: &str) {
        let _ = match step {
            Step::Free(index) => {
                let name = if self.fmi3 { "fmi3FreeInstance" } else { "fmi2FreeInstance" };
                let instance = if *index == NOBODY { "NULL".to_owned() } else { format!("c{index}") };
                writeln!(text, "{indent}((void (*)(void *))function(\"{name}\"))({instance});")
            }
            Step::Measure => writeln!(text, "{indent}measure({id});"),
            Step::Unload => writeln!(text, "{indent}dlclose(library);\n{indent}open_library();"),
            Step::Quit => writeln!(text, "{indent}exit(0);"),
            Step::Repeat(times, steps) => {
                let mut body = String::new();
                self.steps(steps, &mut body, &format!("{indent}    "));
                let counter = self.next;
                self.next += 1;
                writeln!(
                    text,
                    "{indent}quiet = true;\n{indent}for (long i{counter} = 0; i{counter} < {times}; i{counter}++) {{\n{body}{indent}}}\n\
                     {indent}quiet = false;"
                )
            }
            Step::Parallel(sequences) => {
                let mut joins = String::new();
                for sequence in sequences {
                    let number = self.next;
                    self.next += 1;
                    let mut body = String::new();
                    self.steps(sequence, &mut body, "    ");
                    let _ = write!(
                        self.threads,
                        "static void *thread{number}(void *nothing) {{\n{body}    return nothing;\n}}\n\n"
                    );
                    let _ = writeln!(
                        text,
                        "{indent}pthread_t t{number};\n{indent}pthread_create(&t{number}, NULL, thread{number}, NULL);"
                    );
                    let _ = writeln!(joins, "{indent}pthread_join(t{number}, NULL);");
                }
                text.push_str(&joins);
                Ok(())
            }
            _ => Ok(()),
        };
    }

    fn make(
        &self,
        id: u32,
        index: usize,
        make: &Make,
        matters: Option<[bool; 3]>,
        text: &mut String,
        indent: &str,
    ) {
        let of = |text: &Option<String>| {
            text.as_ref().map_or("NULL".to_owned(), |text| {
                format!("guarded({}, {})", literal(text.as_bytes()), text.len() + 1)
            })
        };
        let (name, token) = (of(&make.name), of(&make.token));
        let resources = if make.resources { "guarded(resources, strlen(resources) + 1)" } else { "NULL" };
        let logging = u8::from(make.logging);
        let made = match (self.fmi3, make.co_simulation) {
            (false, co_simulation) => format!(
                "((void *(*)(const char *, int, const char *, const char *, const Callbacks *, int, int))function(\"fmi2Instantiate\"))\
                 ({name}, {}, {token}, {resources}, &callbacks, 0, {logging})",
                u8::from(co_simulation)
            ),
            (true, false) => format!(
                "((void *(*)(const char *, const char *, const char *, bool, bool, void *, void *))function(\"fmi3InstantiateModelExchange\"))\
                 ({name}, {token}, {resources}, false, {logging}, NULL, (void *)say3)"
            ),
            (true, true) => format!(
                "((void *(*)(const char *, const char *, const char *, bool, bool, bool, bool, const uint32_t *, size_t, void *, void *, void *))\
                 function(\"fmi3InstantiateCoSimulation\"))({name}, {token}, {resources}, false, {logging}, {}, {}, NULL, 0, NULL, (void *)say3, NULL)",
                u8::from(make.event_mode),
                u8::from(make.early_return)
            ),
        };
        let _ = writeln!(
            text,
            "{indent}{{ size_t before = arrays; *said = 0; c{index} = {made}; release(before); }}\n{indent}print(\"instance {index}: %s\\n\", c{index} ? \"made\" : \"NULL\");"
        );
        if let Some([_, _, log]) = matters {
            let log = if log { "said" } else { "\"\"" };
            let _ = writeln!(
                text,
                "{indent}{{ FILE *file = results(\"r\", {id}, \"w\"); fprintf(file, \"%d;%s\", c{index} != NULL, {log}); fclose(file); }}"
            );
        }
    }

    #[allow(clippy::too_many_arguments, reason = "the parts of a step")]
    fn call(
        &mut self,
        id: u32,
        of: Option<usize>,
        name: &str,
        args: &[Arg],
        matters: Option<[bool; 3]>,
        text: &mut String,
        indent: &str,
    ) {
        let Some(signature) = signature(name) else { return };
        let inner = format!("{indent}    ");
        let mut parts = Parts::default();
        for (arg, argument) in args.iter().zip(signature.arguments) {
            parts.types.push(type_of(argument.of));
            parts.add(arg, name, self.next);
            self.next += 1;
        }
        let instance = of.map_or("NULL".to_owned(), |index| format!("c{index}"));
        let list = |parts: &[String]| parts.iter().map(|part| format!(", {part}")).collect::<String>();
        let types: Vec<String> = parts.types.iter().map(|of| (*of).to_owned()).collect();
        let comment =
            comment(args, self.description).map_or(String::new(), |names| format!(" /* {names} */"));
        let lines = |parts: &[String]| {
            parts.iter().fold(String::new(), |mut lines, part| {
                let _ = writeln!(lines, "{inner}{part}");
                lines
            })
        };
        let mut after = lines(&parts.after);
        if let Some([_, written, log]) = matters {
            let _ = writeln!(after, "{inner}FILE *file = results(\"r\", {id}, \"w\");");
            let _ = writeln!(after, "{inner}fprintf(file, \"%d;\", status);");
            after.push_str(&lines(if written { &parts.proofs } else { &[] }));
            let _ = writeln!(
                after,
                "{inner}fprintf(file, \"%s\", {}); fclose(file);",
                if log { "said" } else { "\"\"" }
            );
        }
        if *self.evidence == Evidence::Damage {
            after.push_str(&lines(&parts.checks));
        }
        let guard = of.map_or(String::new(), |index| format!("if (c{index}) "));
        let _ = write!(
            text,
            "{indent}{guard}{{{comment}\n{inner}size_t before = arrays;\n{}{inner}*said = 0;\n\
             {inner}int status = ((int (*)(void *{}))function(\"{name}\"))({instance}{});\n\
             {inner}print(\"{name}: %d\", status);\n{after}{inner}print(\"\\n\"); release(before);\n{indent}}}\n",
            lines(&parts.before),
            list(&types),
            list(&parts.passed)
        );
    }
}

/// The lines of a call.
#[derive(Default)]
struct Parts {
    types: Vec<&'static str>,
    passed: Vec<String>,
    before: Vec<String>,
    after: Vec<String>,
    /// Lines that keep the results.
    proofs: Vec<String>,
    /// Lines that look for damage.
    checks: Vec<String>,
}

impl Parts {
    fn add(&mut self, arg: &Arg, name: &str, number: usize) {
        let passed = match arg {
            Arg::Real(bits) => number_of(Kind::F64, *bits),
            Arg::Whole(number) => number.to_string(),
            Arg::Null => "NULL".to_owned(),
            Arg::Misaligned => "(char *)guarded(NULL, 64) + 1".to_owned(),
            Arg::In(kind, bits) => {
                let list: Vec<String> = bits.iter().map(|bits| number_of(*kind, *bits)).collect();
                self.array(number, c_name(*kind), &list)
            }
            Arg::Texts(texts) => {
                let string = |text: &Vec<u8>| format!("guarded({}, {})", literal(text), text.len() + 1);
                let list: Vec<String> =
                    texts.iter().map(|text| text.as_ref().map_or("NULL".to_owned(), string)).collect();
                self.array(number, "void *", &list)
            }
            Arg::Blobs(blobs) => {
                let list: Vec<String> =
                    blobs.iter().map(|blob| format!("guarded({}, {})", literal(blob), blob.len())).collect();
                self.array(number, "void *", &list)
            }
            Arg::Out(kind, count) => self.out(name, *kind, *count, number),
            Arg::State(slot) => format!("s{slot}"),
            Arg::StateOut(slot) => {
                self.proofs.push(format!("fprintf(file, \"%d,;\", s{slot} != NULL);"));
                format!("&s{slot}")
            }
            Arg::Saved(slot) => format!("guarded(b{slot}, *n{slot})"),
            Arg::SavedSize(slot) => format!("*n{slot}"),
            Arg::SizeOut(slot) => {
                self.after.push(format!("print(\" -> %zu bytes\", *n{slot});"));
                self.proofs.push(format!("put_words(file, n{slot}, 1, 8);"));
                format!("n{slot}")
            }
            Arg::SavedOut(slot) => {
                self.before.push(format!("void *a{number} = guarded(NULL, *n{slot});"));
                self.after.push(format!("memcpy(b{slot}, a{number}, *n{slot});"));
                self.proofs.push(format!("put_words(file, a{number}, *n{slot}, 1);"));
                format!("a{number}")
            }
        };
        self.passed.push(passed);
    }

    /// An array for reading.
    fn array(&mut self, number: usize, of: &str, list: &[String]) -> String {
        let (count, list) = (list.len(), if list.is_empty() { "0".to_owned() } else { list.join(", ") });
        self.before.push(format!(
            "{of} v{number}[] = {{{list}}}; void *a{number} = guarded(v{number}, {count} * sizeof *v{number});"
        ));
        self.checks.push(format!("look_at(a{number}, v{number}, {count} * sizeof *v{number});"));
        format!("a{number}")
    }

    /// An array that is written.
    fn out(&mut self, name: &str, kind: Kind, count: usize, number: usize) -> String {
        let (c, width) = (c_name(kind), kind.size());
        self.before.push(format!("void *a{number} = guarded(NULL, {count} * sizeof({c}));"));
        let letter = match kind {
            kind if kind.is_float() => 'f',
            Kind::I8 | Kind::I16 | Kind::I32 | Kind::I64 => 'i',
            _ => 'u',
        };
        if name == "fmi2NewDiscreteStates" {
            // fmi2EventInfo has five flags, then the time.
            let time = format!("show((char *)a{number} + 24, 1, 'f', 8);");
            self.after.push(format!("print(\" ->\"); show(a{number}, 5, 'i', 4); {time}"));
        } else if kind == Kind::Pointer && name != "fmi3GetBinary" {
            self.after
                .push(format!("print(\" ->\"); if (status < 2) show(a{number}, {count}, 's', {width});"));
            self.proofs.push(format!("if (status < 2) put_texts(file, a{number}, {count});"));
        } else if name != "fmi3GetBinary" {
            self.after.push(format!("print(\" ->\"); show(a{number}, {count}, '{letter}', {width});"));
        }
        if kind != Kind::Pointer && name != "fmi3GetBinary" {
            self.proofs.push(format!("put_words(file, a{number}, {count}, {width});"));
        }
        self.checks.push(format!("look_at(a{number}, NULL, 0);"));
        format!("a{number}")
    }
}

/// The names of the variables that a call is about.
fn comment(args: &[Arg], description: &Description) -> Option<String> {
    let Some(Arg::In(Kind::U32, references)) = args.first() else { return None };
    let names: Vec<&str> = references
        .iter()
        .take(8)
        .filter_map(|reference| description.variables.iter().find(|of| u64::from(of.reference) == *reference))
        .map(|variable| variable.name.as_str())
        .collect();
    let more = if references.len() > 8 { ", ..." } else { "" };
    (!names.is_empty()).then(|| format!("{}{more}", names.join(", ").replace("*/", "* /")))
}

fn type_of(of: &str) -> &'static str {
    match of {
        "usize" => "size_t",
        "fmi2Real" | "fmi3Float64" => "double",
        "fmi3Boolean" => "bool",
        "fmi2ValueReference" | "fmi3ValueReference" => "uint32_t",
        of if of.starts_with('*') || of.to_lowercase().contains("fmustate") => "void *",
        _ => "int",
    }
}

fn c_name(kind: Kind) -> &'static str {
    match kind {
        Kind::F64 => "double",
        Kind::F32 => "float",
        Kind::I8 => "int8_t",
        Kind::U8 => "uint8_t",
        Kind::I16 => "int16_t",
        Kind::U16 => "uint16_t",
        Kind::I32 => "int32_t",
        Kind::U32 => "uint32_t",
        Kind::I64 => "int64_t",
        Kind::U64 => "uint64_t",
        Kind::Size => "size_t",
        Kind::Pointer => "void *",
    }
}

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

/// A string in C; long ones are cut off.
fn literal(bytes: &[u8]) -> String {
    let mut text = String::from("\"");
    for byte in bytes.iter().take(4000) {
        match byte {
            b'"' | b'\\' => {
                text.push('\\');
                text.push(char::from(*byte));
            }
            b' '..=b'~' if *byte != b'?' => text.push(char::from(*byte)),
            other => {
                let _ = write!(text, "\\{other:03o}");
            }
        }
    }
    text.push('"');
    text
}
