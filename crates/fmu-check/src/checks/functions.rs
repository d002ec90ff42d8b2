//! What must be there: functions, versions, an instance for the right token, and what the capabilities promise.

use crate::checker::Checker;
use crate::finding::Judge;
use crate::finding::refused_one;
use crate::script::{Arg, End, Kind, Setting, Step};
use fmi_abi::calls::{fmi2, fmi3, signatures};
use fmi_abi::{Interface, Standard};
use std::sync::Arc;

/// Whether all that the library needs is found, also what is needed late.
fn symbols(checker: &Checker) -> anyhow::Result<()> {
    let mut writer = checker.writer();
    writer.add(Step::Version(if checker.fmi3() { "fmi3GetVersion" } else { "fmi2GetVersion" }.to_owned()));
    let [late, now] = [false, true].map(|now| {
        let setting = Setting { now, ..checker.setting.clone() };
        checker.workers.play(&setting, &writer.script, checker.limit)
    });
    if let (End::Done, End::Unloadable(why)) = (late?.end, now?.end) {
        let nothing: Judge = Arc::new(|_| None);
        checker.add(checker.claim("package.symbols").finding(why, writer.script, nothing));
    }
    Ok(())
}

/// Whether every function that must be there is there.
pub fn present(checker: &Checker) -> anyhow::Result<()> {
    let standard = checker.description.standard;
    let places = [(Interface::CoSimulation, 0), (Interface::ModelExchange, 1)];
    let mut missing: Vec<String> = Vec::new();
    for (interface, place) in places {
        let Some(path) = &checker.setting.libraries[place] else { continue };
        let Some(symbols) = super::package::exported(path) else { continue };
        let of_all: &[&str] = if standard == Standard::Fmi2 { fmi2::FREE } else { fmi3::FREE };
        let wanted = of_all.iter().copied().filter(|name| match *name {
            "fmi3InstantiateModelExchange" => interface == Interface::ModelExchange,
            "fmi3InstantiateCoSimulation" => interface == Interface::CoSimulation,
            "fmi3InstantiateScheduledExecution" => false,
            _ => true,
        });
        let on_instances = signatures(standard).iter().filter_map(|signature| {
            // fmi2CancelStep is of Co-Simulation, and allowed in no state of the table.
            let needed = signature.rule.name == "fmi2CancelStep" && interface == Interface::CoSimulation
                || [
                    fmi_abi::Mode::Instantiated,
                    fmi_abi::Mode::Initialization,
                    fmi_abi::Mode::StepComplete,
                    fmi_abi::Mode::Event,
                    fmi_abi::Mode::ContinuousTime,
                    fmi_abi::Mode::StepFailed,
                    fmi_abi::Mode::Terminated,
                ]
                .into_iter()
                .any(|mode| signature.rule.standard.contain(standard, interface, mode));
            needed.then_some(signature.rule.name)
        });
        for name in wanted.chain(on_instances) {
            if !symbols.iter().any(|symbol| symbol == name) && !missing.iter().any(|known| known == name) {
                missing.push(name.to_owned());
            }
        }
    }
    if !missing.is_empty() {
        let seen = format!("the library lacks {}", missing.join(", "));
        checker.add(checker.claim("functions.missing").of_files(seen));
    }
    symbols(checker)?;
    version(checker)?;
    for course in &checker.courses {
        capabilities(checker, course.interface)?;
    }
    Ok(())
}

fn version(checker: &Checker) -> anyhow::Result<()> {
    let mut writer = checker.writer();
    let name = if checker.fmi3() { "fmi3GetVersion" } else { "fmi2GetVersion" };
    let version = writer.add(Step::Version(name.to_owned()));
    let platform = (!checker.fmi3()).then(|| writer.add(Step::Version("fmi2GetTypesPlatform".to_owned())));
    let declared = checker.description.version.clone();
    let judge: Judge = Arc::new(move |run| {
        let text = |id: u32| {
            run.of(id)
                .filter(|of| !of.missing)
                .map(|of| of.text.clone().map(|text| String::from_utf8_lossy(&text).into_owned()))
        };
        if let Some(answer) = text(version) {
            let good = answer.as_ref().is_some_and(|answer| {
                *answer == declared || declared.starts_with("3.") && answer.starts_with("3.")
            });
            if !good {
                let answer = answer.unwrap_or_else(|| "NULL".to_owned());
                return Some(format!("{name} returns {answer}, and fmiVersion is {declared}"));
            }
        }
        let answer = text(platform?)?;
        let answer = answer.unwrap_or_else(|| "NULL".to_owned());
        (answer != "default").then(|| format!("fmi2GetTypesPlatform returns {answer}"))
    });
    checker.judge("functions.version", writer.script, judge)?;
    Ok(())
}

/// What is declared must answer.
fn capabilities(checker: &Checker, interface: Interface) -> anyhow::Result<()> {
    let Some(course) = checker.courses.iter().find(|course| course.interface == interface) else {
        return Ok(());
    };
    let mut asked: Vec<(&str, Vec<u32>, crate::writer::Writer)> = Vec::new();
    if checker.saves(interface) {
        let mut writer = checker.writer();
        writer.begin(0, course);
        let mut ids = vec![writer.save(0, 0), writer.restore(0, 0)];
        if checker.serializes(interface) {
            ids.extend(writer.serialize(0, 0));
            ids.push(writer.deserialize(0, 0, 1));
        }
        ids.push(writer.drop_state(0, 0));
        asked.push(("canGetAndSetFMUstate and canSerializeFMUstate", ids, writer));
    }
    if let Some((unknown, known)) = super::derivatives::pair(&checker.description, interface) {
        let reference = |place: usize| {
            Arg::In(Kind::U32, vec![u64::from(checker.description.variables[place].reference)])
        };
        let sizes = |place: usize| checker.description.variables[place].size.unwrap_or(1);
        for (names, function) in [
            (["providesDirectionalDerivative", "providesDirectionalDerivatives"], "GetDirectionalDerivative"),
            (["providesAdjointDerivatives", "providesAdjointDerivatives"], "GetAdjointDerivative"),
        ] {
            if !checker.can(interface, &names) {
                continue;
            }
            let mut writer = checker.writer();
            writer.begin(0, course);
            let (seeds, results) = if function.contains("Adjoint") {
                (sizes(unknown), sizes(known))
            } else {
                (sizes(known), sizes(unknown))
            };
            let seed = Arg::In(Kind::F64, vec![1_f64.to_bits(); seeds]);
            let mut args = vec![reference(unknown), Arg::Whole(1), reference(known), Arg::Whole(1), seed];
            if checker.fmi3() {
                args.push(Arg::Whole(seeds as i64));
            }
            args.push(Arg::Out(Kind::F64, results));
            if checker.fmi3() {
                args.push(Arg::Whole(results as i64));
            }
            let id = writer.call(0, function, args);
            asked.push((names[1], vec![id], writer));
        }
    }
    for (flag, ids, writer) in asked {
        let script = writer.script.clone();
        let flag = flag.to_owned();
        let judge: Judge = Arc::new(move |run| {
            if run.end != End::Done {
                return None;
            }
            let why = ids.iter().find_map(|id| refused_one(&script, run, *id))?;
            Some(format!("declared by {flag}, but {why}"))
        });
        checker.judge("functions.capability", writer.script, judge)?;
    }
    Ok(())
}
