//! Checks the exported functions, the version, and the functions of declared capabilities.

use super::derivatives::{references, request_derivatives, unknown_and_known};
use crate::call_sequence::{Action, End, Run, Setting};
use crate::checker::Checker;
use crate::finding::fails;
use crate::writer::{Part, Trajectory};
use fmi_abi::calls::{signatures, without_instance};
use fmi_abi::{Interface, Mode};
use std::sync::Arc;

/// Checks that the loader can resolve all symbols when it loads the library. By default, it resolves a function when the
/// function is first called.
fn symbols(checker: &Checker) -> anyhow::Result<()> {
    let sequence = checker.only(checker.version(), false);
    let [lazy, immediate] = [false, true].map(|now| {
        let setting = Setting { now, ..checker.setting.clone() };
        checker.workers.execute(&setting, &sequence, checker.limit)
    });
    if let (End::Done, End::Unloadable(why)) = (lazy?.end, immediate?.end) {
        // The calls of a finding of this name are repeated with `Setting::now`.
        let criterion = Arc::new(|run: &Run| match &run.end {
            End::Unloadable(why) => Some(why.clone()),
            _ => None,
        });
        checker.add(checker.broken("package.symbols", why).shown_by(sequence, criterion));
    }
    Ok(())
}

/// Checks that the library exports all functions of its interface types, that all symbols which the library needs can be
/// resolved, and that the library returns the right version.
pub fn present(checker: &Checker) -> anyhow::Result<()> {
    let modes: Vec<Mode> = (0..9).filter_map(|bit| Mode::from_number(1 << bit)).collect();
    let standard = checker.description.standard;
    let mut missing: Vec<&str> = Vec::new();
    for (index, interface) in [Interface::CoSimulation, Interface::ModelExchange].into_iter().enumerate() {
        let Some(path) = &checker.setting.libraries[index] else { continue };
        let Some(symbols) = super::package::exported(path) else { continue };
        let wanted = without_instance(standard).iter().copied().filter(|name| match *name {
            "fmi3InstantiateModelExchange" => interface == Interface::ModelExchange,
            "fmi3InstantiateCoSimulation" => interface == Interface::CoSimulation,
            name => name != "fmi3InstantiateScheduledExecution",
        });
        let with_instance = signatures(standard).iter().map(|signature| signature.rule).filter(|rule| {
            // The table allows fmi2CancelStep in no state, but Co-Simulation must export it.
            rule.name == "fmi2CancelStep" && interface == Interface::CoSimulation
                || modes.iter().any(|mode| rule.standard.contains(standard, interface, *mode))
        });
        for name in wanted.chain(with_instance.map(|rule| rule.name)) {
            if !symbols.iter().any(|symbol| symbol == name) && !missing.contains(&name) {
                missing.push(name);
            }
        }
    }
    if !missing.is_empty() {
        let observed = format!("the library lacks {}", missing.join(", "));
        checker.add(checker.broken("functions.missing", observed));
    }
    symbols(checker)?;
    version(checker)
}

/// Checks the version and, in FMI 2.0, the platform.
fn version(checker: &Checker) -> anyhow::Result<()> {
    let mut sequence = checker.only(checker.version(), false);
    if !checker.fmi3() {
        let mut platform = checker.only(Action::Version("fmi2GetTypesPlatform".to_owned()), false);
        platform[0].id = 1;
        sequence.extend(platform);
    }
    let name = if checker.fmi3() { "fmi3GetVersion" } else { "fmi2GetVersion" };
    let declared = checker.description.version.clone();
    checker.check("functions.version", sequence, move |run| {
        // Is "NULL" if the function returned NULL, and `None` if the library lacks the function.
        let string = |id: u32| {
            let outcome = run.outcome(id).filter(|outcome| !outcome.missing)?;
            let text = outcome.text.as_ref().map(|text| String::from_utf8_lossy(text).into_owned());
            Some(text.unwrap_or_else(|| "NULL".to_owned()))
        };
        if let Some(version) = string(0)
            && version != declared
            && !(declared.starts_with("3.") && version.starts_with("3."))
        {
            return Some(format!("{name} returns {version}, and fmiVersion is {declared}"));
        }
        let platform = string(1)?;
        (platform != "default").then(|| format!("fmi2GetTypesPlatform returns {platform}"))
    })
}

/// Checks that the functions of declared capabilities succeed: saving and serializing states, and directional and adjoint
/// derivatives.
pub fn capabilities(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let (interface, mut calls) = (trajectory.interface, Vec::new());
    if checker.saves(interface) {
        let mut writer = checker.writer(trajectory);
        let mut ids = writer.write(0, &[Part::Begin, Part::Save(0), Part::Restore(0)]).ids;
        if checker.serializes(interface) {
            ids.extend(writer.serialize(0, 0));
            ids.push(writer.deserialize(0, 0, 1));
        }
        ids.extend(writer.write(0, &[Part::Drop(0)]).ids);
        calls.push(("canGetAndSetFMUstate and canSerializeFMUstate", ids, writer.sequence));
    }
    let pair = unknown_and_known(&checker.description, interface);
    for (name, flags, function) in [
        (
            "providesDirectionalDerivatives",
            ["providesDirectionalDerivative", "providesDirectionalDerivatives"],
            "GetDirectionalDerivative",
        ),
        ("providesAdjointDerivatives", ["providesAdjointDerivatives"; 2], "GetAdjointDerivative"),
    ] {
        let Some((unknown, known)) = pair.filter(|_| checker.can(interface, &flags)) else { continue };
        let mut writer = checker.writer(trajectory);
        let mut ids = writer.begin(0);
        let size = |index: usize| checker.description.variables[index].size.unwrap_or(1);
        let (seed_size, count) = match function {
            "GetAdjointDerivative" => (size(unknown), size(known)),
            _ => (size(known), size(unknown)),
        };
        let [unknowns, knowns] = [unknown, known].map(|index| references(&checker.description, &[index]));
        ids.push(request_derivatives(
            &mut writer,
            function,
            &unknowns,
            &knowns,
            &vec![1.0; seed_size],
            count,
        ));
        calls.push((name, ids, writer.sequence));
    }
    for (flag, ids, sequence) in calls {
        let fails = fails(&sequence, ids);
        checker.check("functions.capability", sequence, move |run| {
            Some(format!("declared by {flag}, but {}", fails(run)?))
        })?;
    }
    Ok(())
}
