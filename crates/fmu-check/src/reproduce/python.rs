//! A script as a program in Python, with nothing but its own library.

use super::c::comment;
use super::{Names, head, library, phases};
use crate::description::Description;
use crate::finding::Finding;
use crate::script::{Arg, Kind, NOBODY, Numbered, Setting, Step};
use fmi_abi::calls::signature;
use std::fmt::Write as _;

/// The program.
pub fn program(finding: &Finding, setting: &Setting, description: &Description) -> String {
    let mut text = String::from("\"\"\"");
    text.push_str(&head(finding, description).join("\n"));
    text.push_str("\npython repro.py FOLDER_OF_THE_UNPACKED_FMU (Linux, macOS)\n\"\"\"\n\n");
    text.push_str(include_str!("prelude.py"));
    let _ = write!(
        text,
        "\n\nfolder = os.path.abspath(sys.argv[1] if len(sys.argv) > 1 else \".\")\nresources = {}.encode()\n",
        if setting.fmi3 { "f\"{folder}/resources/\"" } else { "f\"file://{folder}/resources\"" }
    );
    text.push_str("c = {}\ns = {}\nsizes = {}\nsaved = {}\n");
    for slot in &Names::of(&finding.script).bytes {
        let _ = writeln!(text, "sizes[{slot}] = guarded(bytes(8))\nsaved[{slot}] = room(1 << 24)");
    }
    for slot in &Names::of(&finding.script).states {
        let _ = writeln!(text, "s[{slot}] = guarded(bytes(8))");
    }
    let parts = phases(&finding.script);
    let mut next = 0;
    for (number, part) in parts.iter().enumerate() {
        let _ = write!(text, "\n\ndef phase{number}():\n");
        if part.is_empty() {
            text.push_str("    pass\n");
        }
        for slot in &Names::of(part).states {
            let _ = writeln!(text, "    s[{slot}] = guarded(bytes(8))");
        }
        steps(part, &mut text, "    ", setting.fmi3, description, &mut next);
    }
    let list: String = (0..parts.len()).map(|number| format!("phase{number}, ")).collect();
    let _ = write!(text, "\n\nrun(({list}), f\"{{folder}}/{}\")\n", library(setting, &finding.script));
    text
}

fn steps(
    script: &[Numbered],
    text: &mut String,
    indent: &str,
    fmi3: bool,
    description: &Description,
    next: &mut usize,
) {
    for numbered in script {
        step(&numbered.step, text, indent, fmi3, description, next);
    }
}

fn step(
    step: &Step,
    text: &mut String,
    indent: &str,
    fmi3: bool,
    description: &Description,
    next: &mut usize,
) {
    match step {
        Step::Make(place, make) => {
            let of = |text: &Option<String>| {
                text.as_ref().map_or("None".to_owned(), |text| format!("text({})", literal(text.as_bytes())))
            };
            let (name, token) = (of(&make.name), of(&make.token));
            let resources = if make.resources { "text(resources)" } else { "None" };
            let logging = if make.logging { "True" } else { "False" };
            let pointer = |what: &str| format!("c_void_p({what})");
            let (name, token, resources) = (pointer(&name), pointer(&token), pointer(resources));
            let made = match (fmi3, make.co_simulation) {
                (false, co_simulation) => format!(
                    "\"fmi2Instantiate\", {name}, c_int({}), {token}, {resources}, ctypes.byref(callbacks), c_int(0), c_int({logging})",
                    u8::from(co_simulation)
                ),
                (true, false) => format!(
                    "\"fmi3InstantiateModelExchange\", {name}, {token}, {resources}, c_bool(False), c_bool({logging}), None, say3"
                ),
                (true, true) => format!(
                    "\"fmi3InstantiateCoSimulation\", {name}, {token}, {resources}, c_bool(False), c_bool({logging}), c_bool({}), c_bool({}), None, c_size_t(0), None, say3, None",
                    u8::from(make.event_mode),
                    u8::from(make.early_return)
                ),
            };
            let _ = writeln!(text, "{indent}c[{place}] = call({made}, result=c_void_p)");
        }
        Step::Free(place) => {
            let name = if fmi3 { "fmi3FreeInstance" } else { "fmi2FreeInstance" };
            let instance = if *place == NOBODY { "None".to_owned() } else { format!("c.pop({place}, None)") };
            let _ = writeln!(text, "{indent}call(\"{name}\", c_void_p({instance}), result=None)");
        }
        Step::Version(name) => {
            let _ = writeln!(text, "{indent}call(\"{name}\", result=c_char_p)");
        }
        Step::Measure => {
            let _ = writeln!(text, "{indent}measure()");
        }
        Step::Repeat(times, inner) => {
            let _ = writeln!(text, "{indent}for _ in range({times}):");
            steps(inner, text, &format!("{indent}    "), fmi3, description, next);
        }
        Step::Parallel(scripts) => {
            let mut names = Vec::new();
            for script in scripts {
                let name = format!("thread{next}");
                *next += 1;
                let _ = writeln!(text, "{indent}def {name}():");
                steps(script, text, &format!("{indent}    "), fmi3, description, next);
                names.push(format!("threading.Thread(target={name})"));
            }
            let _ = writeln!(text, "{indent}threads = [{}]", names.join(", "));
            let _ = writeln!(text, "{indent}for thread in threads:\n{indent}    thread.start()");
            let _ = writeln!(text, "{indent}for thread in threads:\n{indent}    thread.join()");
        }
        Step::FreshProcess => {}
        Step::Unload => {
            let _ = writeln!(text, "{indent}libc.dlclose(c_void_p(library._handle))");
        }
        Step::Quit => {
            let _ = writeln!(text, "{indent}sys.stdout.flush()\n{indent}libc.exit(0)");
        }
        Step::Call { of, function, args } => {
            let Some(signature) = signature(function) else { return };
            if let Some(names) = comment(args, description) {
                let _ = writeln!(text, "{indent}# {}", names.replace(['\n', '\r'], " "));
            }
            let (mut passed, mut shown, mut after) = (Vec::new(), Vec::new(), String::new());
            for (arg, argument) in args.iter().zip(signature.arguments) {
                let name = format!("a{next}");
                let plain = match argument.of {
                    "usize" => "c_size_t",
                    "fmi3Boolean" => "c_bool",
                    "fmi2ValueReference" | "fmi3ValueReference" => "c_uint32",
                    _ => "c_int",
                };
                passed.push(match arg {
                    Arg::Real(bits) => format!("c_double({})", number_of(Kind::F64, *bits)),
                    Arg::Whole(number) => format!("{plain}({number})"),
                    Arg::Null => "None".to_owned(),
                    Arg::Misaligned => "c_void_p(room(64) + 1)".to_owned(),
                    Arg::In(kind, bits) => {
                        let list: String =
                            bits.iter().map(|bits| format!(", {}", number_of(*kind, *bits))).collect();
                        format!("c_void_p(guarded(struct.pack(\"{}{}\"{list})))", bits.len(), letter(*kind))
                    }
                    Arg::Texts(texts) => {
                        let list: Vec<String> = texts
                            .iter()
                            .map(|text| {
                                text.as_ref()
                                    .map_or("0".to_owned(), |text| format!("text({})", literal(text)))
                            })
                            .collect();
                        format!("c_void_p(pointers([{}]))", list.join(", "))
                    }
                    Arg::Blobs(blobs) => {
                        let list: Vec<String> =
                            blobs.iter().map(|blob| format!("guarded({})", literal(blob))).collect();
                        format!("c_void_p(pointers([{}]))", list.join(", "))
                    }
                    Arg::Out(kind, count) => {
                        let _ = writeln!(text, "{indent}{name} = room({})", kind.size() * count);
                        if function == "fmi2NewDiscreteStates" {
                            // Of fmi2EventInfo the five flags, then the time.
                            shown.extend([format!("({name}, \"i\", 5)"), format!("({name} + 24, \"d\", 1)")]);
                        } else if function != "fmi3GetBinary" {
                            shown.push(format!("({name}, \"{}\", {count})", letter(*kind)));
                        }
                        format!("c_void_p({name})")
                    }
                    Arg::State(slot) => format!("c_void_p(word(s[{slot}]))"),
                    Arg::StateOut(slot) => format!("c_void_p(s[{slot}])"),
                    Arg::Saved(slot) => {
                        format!("c_void_p(guarded(ctypes.string_at(saved[{slot}], word(sizes[{slot}]))))")
                    }
                    Arg::SavedSize(slot) => format!("c_size_t(word(sizes[{slot}]))"),
                    Arg::SizeOut(slot) => {
                        shown.push(format!("(sizes[{slot}], \"N\", 1)"));
                        format!("c_void_p(sizes[{slot}])")
                    }
                    Arg::SavedOut(slot) => {
                        let _ = writeln!(text, "{indent}{name} = room(word(sizes[{slot}]))");
                        let _ = writeln!(
                            after,
                            "{indent}ctypes.memmove(saved[{slot}], {name}, word(sizes[{slot}]))"
                        );
                        format!("c_void_p({name})")
                    }
                });
                *next += 1;
            }
            let instance = of.map_or("None".to_owned(), |place| format!("c_void_p(c[{place}])"));
            let passed: String = passed.iter().map(|arg| format!(", {arg}")).collect();
            let shown =
                if shown.is_empty() { String::new() } else { format!(", show=[{}]", shown.join(", ")) };
            let _ = write!(text, "{indent}call(\"{function}\", {instance}{passed}{shown})\n{after}");
        }
    }
}

/// The letter of a kind in the module struct.
fn letter(kind: Kind) -> char {
    match kind {
        Kind::F64 => 'd',
        Kind::F32 => 'f',
        Kind::I8 => 'b',
        Kind::U8 => 'B',
        Kind::I16 => 'h',
        Kind::U16 => 'H',
        Kind::I32 => 'i',
        Kind::U32 => 'I',
        Kind::I64 => 'q',
        Kind::U64 => 'Q',
        Kind::Size => 'N',
        Kind::Pointer => 'P',
    }
}

fn number_of(kind: Kind, bits: u64) -> String {
    let number = kind.number(bits);
    match kind {
        Kind::F64 | Kind::F32 if number.is_nan() => "float(\"nan\")".to_owned(),
        Kind::F64 | Kind::F32 if number.is_infinite() => {
            format!("float(\"{}inf\")", if number < 0.0 { "-" } else { "" })
        }
        Kind::F64 | Kind::F32 => format!("{number:?}"),
        Kind::I64 => format!("{}", bits as i64),
        Kind::U64 | Kind::Size => format!("{bits}"),
        _ => format!("{number}"),
    }
}

fn literal(bytes: &[u8]) -> String {
    let text: String = bytes
        .iter()
        .take(4000)
        .map(|byte| match byte {
            b'"' | b'\\' => format!("\\{}", char::from(*byte)),
            b' '..=b'~' => char::from(*byte).to_string(),
            other => format!("\\x{other:02x}"),
        })
        .collect();
    format!("b\"{text}\"")
}
