//! Resources that remain after many simulations, and settings of the process.

use crate::call_sequence::{End, Numbered, Step};
use crate::checker::Checker;
use crate::finding::Judge;
use crate::values::Value;
use crate::writer::{Trajectory, Writer};
use fmi_abi::BaseType;
use std::sync::Arc;

/// Simulations, states and calls again and again.
pub fn cycles(checker: &Checker) -> anyhow::Result<()> {
    for trajectory in &checker.trajectories {
        let whole = |writer: &mut Writer| {
            writer.begin(0, trajectory);
            for point in trajectory.points.iter().take(3) {
                writer.point(0, trajectory, point);
            }
            writer.ask(0, trajectory.interface);
            writer.call(0, "Terminate", vec![]);
            writer.free(0);
        };
        measured(checker, "instances made, run and freed", |_| {}, whole)?;
        let variables = checker.description.variables.iter().enumerate();
        let texts: Vec<(usize, Value)> = variables
            .filter(|(_, of)| of.base == Some(BaseType::String) && of.size == Some(1) && !of.clocked)
            .filter(|(_, of)| of.causality == "input" || of.causality == "parameter" && of.initial == "exact")
            .filter_map(|(index, of)| {
                Some((index, Value::Texts(vec![of.start.first()?.clone().into_bytes()])))
            })
            .collect();
        if !texts.is_empty() {
            let make = |writer: &mut Writer| {
                writer.make(0, trajectory.interface);
            };
            let set = |writer: &mut Writer| {
                writer.set(0, &texts);
            };
            measured(checker, "texts set", make, set)?;
        }
        measured(
            checker,
            "resets",
            |writer| {
                writer.make(0, trajectory.interface);
            },
            |writer| {
                writer.enter(0);
                writer.leave(0, trajectory);
                for point in trajectory.points.iter().take(2) {
                    writer.point(0, trajectory, point);
                }
                writer.ask(0, trajectory.interface);
                writer.call(0, "Reset", vec![]);
            },
        )?;
        if checker.saves(trajectory.interface) {
            measured(
                checker,
                "states saved and freed",
                |writer| states_before(writer, trajectory),
                |writer| {
                    states(checker, writer, trajectory);
                },
            )?;
        }
        settings(checker, trajectory)?;
    }
    Ok(())
}

fn states_before(writer: &mut Writer, trajectory: &Trajectory) {
    writer.begin(0, trajectory);
    for point in trajectory.points.iter().take(2) {
        writer.point(0, trajectory, point);
    }
}

fn states(checker: &Checker, writer: &mut Writer, trajectory: &Trajectory) {
    writer.save(0, 0);
    writer.save(0, 0);
    writer.restore(0, 0);
    if checker.serializes(trajectory.interface) {
        writer.serialize(0, 0);
        writer.deserialize(0, 0, 1);
        writer.restore(0, 1);
        writer.drop_state(0, 1);
    }
    writer.ask(0, trajectory.interface);
    writer.drop_state(0, 0);
}

fn measured(
    checker: &Checker,
    what: &'static str,
    before: impl Fn(&mut Writer),
    cycle: impl Fn(&mut Writer),
) -> anyhow::Result<()> {
    let mut writer = checker.writer();
    before(&mut writer);
    let mut steps: Vec<Numbered> = Vec::new();
    let begin = writer.sequence.len();
    cycle(&mut writer);
    steps.extend(writer.sequence.drain(begin..));
    let repeat = |times: usize| Step::Repeat(times, steps.clone());
    let warm = writer.add(repeat(200));
    let first = writer.add(Step::Measure);
    let times = writer.add(repeat(10_000));
    let last = writer.add(Step::Measure);
    let last_of_cycle: Vec<u32> = steps.iter().map(|numbered| numbered.id).collect();
    let done = move |run: &crate::call_sequence::Run| {
        let (one, two) = (run.of(warm)?.measured.as_ref()?.times, run.of(times)?.measured.as_ref()?.times);
        (one >= 50 && two >= 50).then_some(two)
    };
    let memory: Judge = Arc::new(move |run| {
        let times = done(run)?;
        let (one, two) = (run.of(first)?.measured.as_ref()?, run.of(last)?.measured.as_ref()?);
        let grown = two.memory.saturating_sub(one.memory);
        // Where the C library counts, a block is 32 bytes at least, and a few may stay for itself; elsewhere pages are all that can be observed.
        let enough = if one.exact { 16 * times as u64 + 4096 } else { 64 * times as u64 + (4 << 20) };
        (grown > enough).then(|| {
            format!("{grown} bytes are left after {times} {what}: {} for each", grown / times as u64)
        })
    });
    let sequence = writer.sequence.clone();
    let limit = checker.setting.repetitions * 3.0 + checker.limit;
    let run = checker.play_for(&sequence, limit)?;
    if run.end != crate::call_sequence::End::Done {
        let nothing: Judge = Arc::new(|_| None);
        checker.judge("resources.cycles", sequence, nothing)?;
        return Ok(());
    }
    checker.keep_always(&sequence, &run);
    checker.keep("resources.memory", &run, &sequence, memory);
    let threads: Judge = Arc::new(move |run| {
        let times = done(run)?;
        let (one, two) = (run.of(first)?.measured.as_ref()?, run.of(last)?.measured.as_ref()?);
        (two.threads > one.threads + 2)
            .then(|| format!("{} threads are left after {times} {what}", two.threads - one.threads))
    });
    checker.keep("resources.threads", &run, &sequence, threads);
    let files: Judge = Arc::new(move |run| {
        let times = done(run)?;
        let (one, two) = (run.of(first)?.measured.as_ref()?, run.of(last)?.measured.as_ref()?);
        (two.files > one.files + 2)
            .then(|| format!("{} files are left open after {times} {what}", two.files - one.files))
    });
    checker.keep("resources.files", &run, &sequence, files);
    let inner = steps.clone();
    let again: Judge = Arc::new(move |run| {
        let times = run.of(times)?.measured.as_ref()?.times;
        let why = crate::finding::refused(&inner, run, &last_of_cycle[1..])
            .or_else(|| crate::finding::refused_one(&inner, run, last_of_cycle[0]))?;
        (times > 1).then(|| format!("after {} {what}: {why}", times - 1))
    });
    checker.keep("resources.cycles", &run, &sequence, again);
    Ok(())
}

/// Rounding, locale, directory, signals: as before.
fn settings(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let mut writer = checker.writer();
    // The library is loaded with the first call.
    writer.add(Step::Version(if checker.fmi3() { "fmi3GetVersion" } else { "fmi2GetVersion" }.to_owned()));
    let first = writer.add(Step::Measure);
    writer.begin(0, trajectory);
    for point in &trajectory.points {
        writer.point(0, trajectory, point);
    }
    writer.ask(0, trajectory.interface);
    let last = writer.add(Step::Measure);
    let judge: Judge = Arc::new(move |run| {
        let (one, two) = (run.of(first)?.measured.as_ref()?, run.of(last)?.measured.as_ref()?);
        let (was, is) = one.settings.iter().zip(&two.settings).find(|(was, is)| was != is)?;
        Some(format!("{was} has become {is}"))
    });
    let run = checker.judge("resources.settings", writer.sequence.clone(), judge)?;
    let judge: Judge = Arc::new(move |run| {
        let line = run.said.lines().find(|line| !line.trim().is_empty())?;
        (run.end == End::Done).then(|| format!("{:?}", line.chars().take(80).collect::<String>()))
    });
    checker.keep("logs.printed", &run, &writer.sequence, judge);
    Ok(())
}
