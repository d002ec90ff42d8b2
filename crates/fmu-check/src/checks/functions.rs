//! Functions, versions, an instance for the right token, and the calls that declared capabilities allow.

use crate::call_sequence::{Arg, End, Kind, Setting, Step};
use crate::checker::Checker;
use crate::finding::Judge;
use crate::finding::refused_one;
use fmi_abi::calls::{fmi2, fmi3, signatures};
use fmi_abi::{Interface, Standard};
use std::sync::Arc;

/// Whether all that the library needs is found, also what is needed late.
fn symbols(checker: &Checker) -> anyhow::Result<()> {
    let mut writer = checker.writer();
    writer.add(Step::Version(if checker.fmi3() { "fmi3GetVersion" } else { "fmi2GetVersion" }.to_owned()));
    let [late, now] = [false, true].map(|now| {
        let setting = Setting { now, ..checker.setting.clone() };
        checker.workers.play(&setting, &writer.sequence, checker.limit)
    });
    if let (End::Done, End::Unloadable(why)) = (late?.end, now?.end) {
        let nothing: Judge = Arc::new(|_| None);
        checker.add(checker.claim("package.symbols").finding(why, writer.sequence, nothing));
    }
    Ok(())
}

/// Whether every function that must be there is there.
pub fn present(checker: &Checker) -> anyhow::Result<()> {
    let standard = checker.description.standard;
    let indices = [(Interface::CoSimulation, 0), (Interface::ModelExchange, 1)];
    let mut missing: Vec<String> = Vec::new();
    for (interface, index) in indices {
        let Some(path) = &checker.setting.libraries[index] else { continue };
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
        let observed = format!("the library lacks {}", missing.join(", "));
        checker.add(checker.claim("functions.missing").of_files(observed));
    }
    symbols(checker)?;
    version(checker)?;
    for trajectory in &checker.trajectories {
        capabilities(checker, trajectory.interface)?;
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
    checker.judge("functions.version", writer.sequence, judge)?;
    Ok(())
}

/// Each declared function returns.
fn capabilities(checker: &Checker, interface: Interface) -> anyhow::Result<()> {
    let Some(trajectory) = checker.trajectories.iter().find(|trajectory| trajectory.interface == interface)
    else {
        return Ok(());
    };
    let mut asked: Vec<(&str, Vec<u32>, crate::writer::Writer)> = Vec::new();
    if checker.saves(interface) {
        let mut writer = checker.writer();
        writer.begin(0, trajectory);
        let mut ids = vec![writer.save(0, 0), writer.restore(0, 0)];
        if checker.serializes(interface) {
            ids.extend(writer.serialize(0, 0));
            ids.push(writer.deserialize(0, 0, 1));
        }
        ids.push(writer.drop_state(0, 0));
        asked.push(("canGetAndSetFMUstate and canSerializeFMUstate", ids, writer));
    }
    if let Some((unknown, known)) = super::derivatives::pair(&checker.description, interface) {
        let reference = |index: usize| {
            Arg::In(Kind::U32, vec![u64::from(checker.description.variables[index].reference)])
        };
        let sizes = |index: usize| checker.description.variables[index].size.unwrap_or(1);
        for (names, function) in [
            (["providesDirectionalDerivative", "providesDirectionalDerivatives"], "GetDirectionalDerivative"),
            (["providesAdjointDerivatives", "providesAdjointDerivatives"], "GetAdjointDerivative"),
        ] {
            if !checker.can(interface, &names) {
                continue;
            }
            let mut writer = checker.writer();
            writer.begin(0, trajectory);
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
        let sequence = writer.sequence.clone();
        let flag = flag.to_owned();
        let judge: Judge = Arc::new(move |run| {
            if run.end != End::Done {
                return None;
            }
            let why = ids.iter().find_map(|id| refused_one(&sequence, run, *id))?;
            Some(format!("declared by {flag}, but {why}"))
        });
        checker.judge("functions.capability", writer.sequence, judge)?;
    }
    Ok(())
}
