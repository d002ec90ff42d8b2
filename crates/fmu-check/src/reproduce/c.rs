//! A script as a program in C.

use super::{Names, head, library, phases};
use crate::description::Description;
use crate::finding::Finding;
use crate::script::{Arg, Kind, NOBODY, Numbered, Setting, Step};
use fmi_abi::calls::signature;
use std::fmt::Write as _;

/// The program.
pub fn program(finding: &Finding, setting: &Setting, description: &Description) -> String {
    let mut text = String::from("/*\n");
    for line in head(finding, description) {
        let _ = writeln!(text, " * {line}");
    }
    text.push_str(" * cc repro.c -o repro -ldl -lpthread && ./repro FOLDER_OF_THE_UNPACKED_FMU\n */\n");
    text.push_str(include_str!("prelude.c"));
    let names = Names::of(&finding.script);
    for place in names.instances.iter().filter(|place| **place != NOBODY) {
        let _ = writeln!(text, "static void *c{place};");
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
    let mut writer = Writer { fmi3: setting.fmi3, next: 0, threads: String::new() };
    let mut bodies = String::new();
    let parts = phases(&finding.script);
    for (number, part) in parts.iter().enumerate() {
        let mut body = String::new();
        writer.steps(part, &mut body, "    ", description);
        let _ = write!(bodies, "static void phase{number}(void) {{\n{body}}}\n\n");
    }
    text.push_str(&writer.threads);
    text.push_str(&bodies);
    let list: Vec<String> = (0..parts.len()).map(|number| format!("phase{number}")).collect();
    let _ = writeln!(text, "static void (*const phases[])(void) = {{{}}};", list.join(", "));
    let _ = writeln!(text, "static const char library_name[] = \"{}\";", library(setting, &finding.script));
    let format = if setting.fmi3 { "%s/resources/" } else { "file://%s/resources" };
    let _ = writeln!(text, "static const char resources_format[] = \"{format}\";");
    // Serialized bytes are passed on to the next process in files.
    let each =
        |write: &dyn Fn(usize) -> String| names.bytes.iter().map(|slot| write(*slot)).collect::<String>();
    let load = each(&|slot| {
        format!("    b{slot} = guarded(NULL, 1 << 24);\n    n{slot} = passed_on(folder, {slot}, b{slot});\n")
    });
    let save = each(&|slot| format!("    pass_on(folder, {slot}, b{slot}, *n{slot});\n"));
    let _ = write!(text, "\nstatic void load(const char *folder) {{\n    (void)folder;\n{load}}}\n\n");
    let _ = write!(text, "static void save(const char *folder) {{\n    (void)folder;\n{save}}}\n\n");
    text.push_str(include_str!("main.c"));
    text
}

struct Writer {
    fmi3: bool,
    next: usize,
    threads: String,
}

impl Writer {
    fn steps(&mut self, script: &[Numbered], text: &mut String, indent: &str, description: &Description) {
        for numbered in script {
            self.step(&numbered.step, text, indent, description);
        }
    }

    fn step(&mut self, step: &Step, text: &mut String, indent: &str, description: &Description) {
        match step {
            Step::Make(place, make) => {
                let of = |text: &Option<String>| {
                    text.as_ref().map_or("NULL".to_owned(), |text| literal(text.as_bytes()))
                };
                let (name, token) = (of(&make.name), of(&make.token));
                let resources = if make.resources { "resources" } else { "NULL" };
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
                    "{indent}c{place} = {made};\n{indent}printf(\"instance {place}: %s\\n\", c{place} ? \"made\" : \"NULL\");"
                );
            }
            Step::Free(place) => {
                let name = if self.fmi3 { "fmi3FreeInstance" } else { "fmi2FreeInstance" };
                let instance = if *place == NOBODY { "NULL".to_owned() } else { format!("c{place}") };
                let _ = writeln!(text, "{indent}((void (*)(void *))function(\"{name}\"))({instance});");
            }
            Step::Version(name) => {
                let _ = writeln!(
                    text,
                    "{indent}printf(\"{name}: %s\\n\", ((const char *(*)(void))function(\"{name}\"))());"
                );
            }
            Step::Measure => {
                let _ = writeln!(text, "{indent}measure();");
            }
            Step::Repeat(times, steps) => {
                let mut body = String::new();
                self.steps(steps, &mut body, &format!("{indent}    "), description);
                // Only what is measured is told.
                let quiet: String = body
                    .lines()
                    .filter(|line| !line.trim_start().starts_with("printf("))
                    .map(|line| format!("{line}\n"))
                    .collect();
                let counter = self.next;
                self.next += 1;
                let _ = write!(
                    text,
                    "{indent}for (long i{counter} = 0; i{counter} < {times}; i{counter}++) {{\n{quiet}{indent}}}\n"
                );
            }
            Step::Parallel(scripts) => {
                let mut joins = String::new();
                for script in scripts {
                    let number = self.next;
                    self.next += 1;
                    let mut body = String::new();
                    self.steps(script, &mut body, "    ", description);
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
            }
            Step::FreshProcess => {}
            Step::Unload => {
                let _ = writeln!(text, "{indent}dlclose(library);\n{indent}library = NULL;");
            }
            Step::Quit => {
                let _ = writeln!(text, "{indent}exit(0);");
            }
            Step::Call { of, function, args } => self.call(*of, function, args, text, indent, description),
        }
    }

    fn call(
        &mut self,
        of: Option<usize>,
        name: &str,
        args: &[Arg],
        text: &mut String,
        indent: &str,
        description: &Description,
    ) {
        let Some(signature) = signature(name) else { return };
        let (mut types, mut passed, mut before, mut after) =
            (Vec::new(), Vec::new(), String::new(), String::new());
        for (arg, argument) in args.iter().zip(signature.arguments) {
            types.push(type_of(argument.of));
            let number = self.next;
            let mut array = |kind: Kind, bits: &[u64]| {
                let list = bits.iter().map(|bits| number_of(kind, *bits)).collect::<Vec<_>>().join(", ");
                let c = c_name(kind);
                let list = if bits.is_empty() { "0".to_owned() } else { list };
                let _ = writeln!(
                    before,
                    "{indent}    {c} v{number}[] = {{{list}}}; void *a{number} = guarded(v{number}, {} * sizeof({c}));",
                    bits.len()
                );
                format!("a{number}")
            };
            passed.push(match arg {
                Arg::Real(bits) => number_of(Kind::F64, *bits),
                Arg::Whole(number) => number.to_string(),
                Arg::Null => "NULL".to_owned(),
                Arg::Misaligned => "(char *)guarded(NULL, 64) + 1".to_owned(),
                Arg::In(kind, bits) => array(*kind, bits),
                Arg::Texts(texts) => {
                    let list = texts.iter().map(|text| text.as_ref().map_or("NULL".to_owned(), |text| format!("guarded({}, {})", literal(text), text.len() + 1)));
                    let list = list.collect::<Vec<_>>().join(", ");
                    let _ = writeln!(before, "{indent}    void *v{number}[] = {{{list}}}; void *a{number} = guarded(v{number}, sizeof v{number});");
                    format!("a{number}")
                }
                Arg::Blobs(blobs) => {
                    let list = blobs.iter().map(|blob| format!("guarded({}, {})", literal(blob), blob.len())).collect::<Vec<_>>().join(", ");
                    let _ = writeln!(before, "{indent}    void *v{number}[] = {{{list}}}; void *a{number} = guarded(v{number}, sizeof v{number});");
                    format!("a{number}")
                }
                Arg::Out(kind, count) => {
                    let c = c_name(*kind);
                    let _ = writeln!(before, "{indent}    void *a{number} = guarded(NULL, {count} * sizeof({c}));");
                    let letter = match kind {
                        kind if kind.is_float() => 'f',
                        Kind::Pointer => 's',
                        Kind::I8 | Kind::I16 | Kind::I32 | Kind::I64 => 'i',
                        _ => 'u',
                    };
                    let guard = if *kind == Kind::Pointer { "if (status < 2) " } else { "" };
                    if name == "fmi2NewDiscreteStates" {
                        // Of fmi2EventInfo the five flags, then the time.
                        let _ = writeln!(after, "{indent}    printf(\" ->\"); show(a{number}, 5, 'i', 4); show((char *)a{number} + 24, 1, 'f', 8);");
                    } else if name != "fmi3GetBinary" {
                        let _ = writeln!(after, "{indent}    printf(\" ->\"); {guard}show(a{number}, {count}, '{letter}', sizeof({c}));");
                    }
                    format!("a{number}")
                }
                Arg::State(slot) => format!("s{slot}"),
                Arg::StateOut(slot) => format!("&s{slot}"),
                Arg::Saved(slot) => format!("guarded(b{slot}, *n{slot})"),
                Arg::SavedSize(slot) => format!("*n{slot}"),
                Arg::SizeOut(slot) => {
                    let _ = writeln!(after, "{indent}    printf(\" -> %zu bytes\", *n{slot});");
                    format!("n{slot}")
                }
                Arg::SavedOut(slot) => {
                    let _ = writeln!(before, "{indent}    void *a{number} = guarded(NULL, *n{slot});");
                    let _ = writeln!(after, "{indent}    memcpy(b{slot}, a{number}, *n{slot});");
                    format!("a{number}")
                }
            });
            self.next += 1;
        }
        let instance = of.map_or("NULL".to_owned(), |place| format!("c{place}"));
        let types: String = types.iter().map(|of| format!(", {of}")).collect();
        let passed: String = passed.iter().map(|arg| format!(", {arg}")).collect();
        let comment = comment(args, description).map_or(String::new(), |names| format!(" /* {names} */"));
        let _ = write!(
            text,
            "{indent}{{{comment}\n{before}{indent}    int status = ((int (*)(void *{types}))function(\"{name}\"))({instance}{passed});\n\
             {indent}    printf(\"{name}: %d\", status);\n{after}{indent}    printf(\"\\n\");\n{indent}}}\n"
        );
    }
}

/// The names of the variables that a call is about.
pub fn comment(args: &[Arg], description: &Description) -> Option<String> {
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
