//! Results depend on the calls alone: not on the process, on other instances, on threads, on what was read.

use crate::call_sequence::{Arg, Kind, Numbered, Step};
use crate::checker::Checker;
use crate::finding::{Judge, status_name};
use crate::trajectory::steps;
use crate::writer::{Point, Read, Trajectory, Writer, difference, readable, value_of};
use fmi_abi::Interface;
use std::sync::Arc;

/// The whole trajectory with all that can be read.
fn whole(writer: &mut Writer, of: usize, trajectory: &Trajectory) -> Vec<Read> {
    writer.begin(of, trajectory);
    let mut reads = writer.ask(of, trajectory.interface);
    for point in &trajectory.points {
        writer.point(of, trajectory, point);
        reads.extend(writer.ask(of, trajectory.interface));
    }
    reads
}

fn judge(checker: &Checker, one: Vec<Read>, other: Vec<Read>, what: &'static str) -> Judge {
    let description = checker.description.clone();
    Arc::new(move |run| {
        let (name, first, second) = difference(&description, run, &one, &other)?;
        Some(format!("{name} is {first}, {what} {second}"))
    })
}

/// Repeats the calls in another process with other addresses and other memory contents.
pub fn repeat(checker: &Checker) -> anyhow::Result<()> {
    for trajectory in &checker.trajectories {
        let mut writer = checker.writer();
        let one = whole(&mut writer, 0, trajectory);
        writer.add(Step::FreshProcess);
        let other = whole(&mut writer, 0, trajectory);
        checker.judge(
            "results.process",
            writer.sequence,
            judge(checker, one, other, "in another process"),
        )?;
    }
    Ok(())
}

/// Repeats the calls with an instance of another name. Strings may contain the name.
pub fn name(checker: &Checker) -> anyhow::Result<()> {
    for trajectory in &checker.trajectories {
        let mut writer = checker.writer();
        let one = whole(&mut writer, 0, trajectory);
        writer.free(0);
        let begin = writer.sequence.len();
        let other = whole(&mut writer, 0, trajectory);
        if let Some(Step::Make(_, how)) = writer.sequence.get_mut(begin).map(|numbered| &mut numbered.step) {
            how.name = Some("an instance of another name".to_owned());
        }
        let no_texts = |reads: Vec<Read>| -> Vec<Read> {
            let texts = |read: &Read| {
                read.of.iter().any(|(index, _)| !checker.description.variables[*index].is_number())
            };
            reads.into_iter().filter(|read| !texts(read)).collect()
        };
        let judge = judge(checker, no_texts(one), no_texts(other), "of an instance of another name");
        checker.judge("results.name", writer.sequence, judge)?;
    }
    Ok(())
}

/// A second instance before, meanwhile, and in turns.
pub fn instances(checker: &Checker) -> anyhow::Result<()> {
    for trajectory in checker.trajectories.iter().filter(|trajectory| checker.several(trajectory.interface)) {
        let mut writer = checker.writer();
        let alone = whole(&mut writer, 0, trajectory);
        writer.free(0);
        let (mut one, mut other) = (Vec::new(), Vec::new());
        writer.begin(1, trajectory);
        one.extend(writer.ask(1, trajectory.interface));
        // The other is two points behind, so that both are not in the same state.
        let count = trajectory.points.len();
        for number in 0..count + 2 {
            if number == 1 {
                writer.begin(2, trajectory);
                other.extend(writer.ask(2, trajectory.interface));
            }
            if let Some(point) = trajectory.points.get(number) {
                writer.point(1, trajectory, point);
            }
            if number >= 2 {
                writer.point(2, trajectory, &trajectory.points[number - 2]);
            }
            if number < count {
                one.extend(writer.ask(1, trajectory.interface));
            }
            if number >= 2 {
                other.extend(writer.ask(2, trajectory.interface));
            }
        }
        let first = judge(checker, alone.clone(), one, "beside another instance");
        let second = judge(checker, alone, other, "of a second instance beside the first");
        let both: Judge = Arc::new(move |run| first(run).or_else(|| second(run)));
        checker.judge("results.instances", writer.sequence, both)?;
    }
    Ok(())
}

/// Reading changes nothing, regardless of the variables, their grouping and the number of reads.
pub fn reading(checker: &Checker) -> anyhow::Result<()> {
    for trajectory in &checker.trajectories {
        let mut writer = checker.writer();
        writer.begin(0, trajectory);
        for point in &trajectory.points {
            writer.point(0, trajectory, point);
        }
        let silent = writer.ask(0, trajectory.interface);
        writer.free(0);
        let all = readable(&checker.description);
        writer.begin(1, trajectory);
        writer.ask(1, trajectory.interface);
        for point in &trajectory.points {
            writer.point(1, trajectory, point);
            for index in all.iter().rev().take(200) {
                writer.read_these(1, &[*index]);
            }
            writer.ask(1, trajectory.interface);
        }
        let read = writer.ask(1, trajectory.interface);
        let again = writer.ask(1, trajectory.interface);
        let singly: Vec<Read> =
            all.iter().take(400).flat_map(|index| writer.read_these(1, &[*index])).collect();
        let description = checker.description.clone();
        let changed = judge(checker, silent, read.clone(), "after more was read meanwhile");
        let twice = judge(checker, read.clone(), again, "read a second time");
        let alone: Judge = Arc::new(move |run| {
            for single in &singly {
                let (index, _) = single.of.first()?;
                let together = value_of(run, &read, *index);
                let one = value_of(run, std::slice::from_ref(single), *index);
                if let (Some(together), Some(one)) = (together, one)
                    && let Some(at) = together.differ(&one)
                {
                    let name = &description.variables[*index].name;
                    return Some(format!(
                        "{name} is {} read with others and {} read alone",
                        together.show(at),
                        one.show(at)
                    ));
                }
            }
            None
        });
        let all_three: Judge =
            Arc::new(move |run| twice(run).or_else(|| alone(run)).or_else(|| changed(run)));
        checker.judge("results.reading", writer.sequence, all_three)?;
        repeated(checker, trajectory, &all)?;
        first(checker, trajectory)?;
    }
    Ok(())
}

/// Each output read first after a step, in a separate instance.
fn first(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let variables = &checker.description.variables;
    let outputs =
        readable(&checker.description).into_iter().filter(|index| variables[*index].causality == "output");
    let mut writer = checker.writer();
    let start = |writer: &mut Writer| {
        writer.begin(0, trajectory);
        for point in trajectory.points.iter().take(3) {
            writer.point(0, trajectory, point);
        }
    };
    start(&mut writer);
    let together = writer.read(0);
    writer.free(0);
    let mut alone = Vec::new();
    for output in outputs.take(checker.most(16)) {
        start(&mut writer);
        alone.push((output, writer.read_these(0, &[output])));
        writer.free(0);
    }
    let description = checker.description.clone();
    let judge: Judge = Arc::new(move |run| {
        alone.iter().find_map(|(output, reads)| {
            let (one, other) = (value_of(run, reads, *output)?, value_of(run, &together, *output)?);
            let at = one.differ(&other)?;
            let name = &description.variables[*output].name;
            Some(format!("{name} is {} read first and {} read after others", one.show(at), other.show(at)))
        })
    });
    checker.judge("results.reading", writer.sequence, judge)?;
    Ok(())
}

/// A variable twice in one call, and none at all.
fn repeated(checker: &Checker, trajectory: &Trajectory, all: &[usize]) -> anyhow::Result<()> {
    let mut writer = checker.writer();
    writer.begin(0, trajectory);
    let singly = writer.read_these(0, all);
    let indices: Vec<usize> = all.iter().flat_map(|index| [*index, *index]).collect();
    let doubly = writer.read_these(0, &indices);
    let float = if checker.fmi3() { "Float64" } else { "Real" };
    let mut nothing = vec![Arg::In(Kind::U32, Vec::new()), Arg::Whole(0), Arg::Out(Kind::F64, 0)];
    if checker.fmi3() {
        nothing.push(Arg::Whole(0));
    }
    let none = writer.call(0, &format!("Get{float}"), nothing);
    let description = checker.description.clone();
    let judge: Judge = Arc::new(move |run| {
        if let Some(status) = run.status(none).filter(|status| *status > 1) {
            return Some(format!("a call that queries no variable returns {}", status_name(status)));
        }
        singly.iter().zip(&doubly).find_map(|(single, double)| {
            if [single, double].iter().any(|read| run.status(read.id).is_none_or(|status| status > 1)) {
                return None;
            }
            let mut at = 0;
            single.of.iter().find_map(|(index, size)| {
                at += 2 * size;
                let once = value_of(run, std::slice::from_ref(single), *index)?;
                let second = run.written(double.id)?.part(at - size, *size)?;
                let element = once.differ(&second)?;
                let name = &description.variables[*index].name;
                Some(format!(
                    "{name} is {}, asked for twice in a call {} the second time",
                    once.show(element),
                    second.show(element)
                ))
            })
        })
    });
    checker.judge("results.repeated", writer.sequence, judge)?;
    Ok(())
}

/// Instances in threads of their own.
pub fn threads(checker: &Checker) -> anyhow::Result<()> {
    for trajectory in checker.trajectories.iter().filter(|trajectory| checker.several(trajectory.interface)) {
        let mut writer = checker.writer();
        let alone = whole(&mut writer, 0, trajectory);
        writer.free(0);
        let mut sequences: Vec<Vec<Numbered>> = Vec::new();
        let mut reads: Vec<Vec<Read>> = Vec::new();
        for number in 1..=4 {
            let mut thread = Writer::new(&checker.description);
            thread.next = writer.next;
            // More than one simulation, so that they meet.
            for _ in 0..20 {
                reads.push(whole(&mut thread, number, trajectory));
                thread.free(number);
            }
            writer.next = thread.next;
            sequences.push(thread.sequence);
        }
        writer.add(Step::Parallel(sequences));
        let judges: Vec<Judge> = reads
            .into_iter()
            .map(|reads| judge(checker, alone.clone(), reads, "on a thread beside others"))
            .collect();
        let any: Judge = Arc::new(move |run| judges.iter().find_map(|judge| judge(run)));
        checker.judge("results.threads", writer.sequence, any)?;
    }
    Ok(())
}

/// Covers the same time in steps of another size, with constant inputs.
pub fn cut(checker: &Checker) -> anyhow::Result<()> {
    let Some(trajectory) =
        checker.trajectories.iter().find(|trajectory| trajectory.interface == Interface::CoSimulation)
    else {
        return Ok(());
    };
    if !checker.can(Interface::CoSimulation, &["canHandleVariableCommunicationStepSize"])
        || trajectory.points.len() < 4
        || checker.description.event_mode()
    {
        return Ok(());
    }
    // Half a step must be as good as a whole one.
    let fixed =
        checker.description.co_simulation.as_ref().and_then(|offer| offer.number("fixedInternalStepSize"));
    let size = trajectory.points[0].size * if fixed.is_some() { 2.0 } else { 1.0 };
    let start = trajectory.points[0].time;
    let held = |size: f64, count: usize| -> Vec<Point> {
        let mut points = steps(&checker.description, start, &vec![size; count], false);
        points.iter_mut().for_each(|point| point.inputs = Vec::new());
        points
    };
    let mut writer = checker.writer();
    let mut ends = Vec::new();
    let sizes = [(size, 8), (2.0 * size, 4), (size / 2.0, 16), (size / 3.0, 24)];
    let sizes = if fixed.is_some() { &sizes[..3] } else { &sizes };
    for (of, points) in sizes.iter().map(|(size, count)| held(*size, *count)).enumerate() {
        let trajectory = Trajectory { points, ..trajectory.clone() };
        writer.begin(of, &trajectory);
        for point in &trajectory.points {
            writer.point(of, &trajectory, point);
        }
        ends.push(writer.read(of));
        writer.free(of);
    }
    let description = checker.description.clone();
    let judge: Judge = Arc::new(move |run| {
        for (index, variable) in description.variables.iter().enumerate() {
            let values: Vec<Vec<f64>> = ends
                .iter()
                .map(|end| value_of(run, end, index).map(|value| value.numbers()).unwrap_or_default())
                .collect();
            // 4, 8, 16 and 24 steps: what each of them adds, and not what a solver gets wrong, grows like this.
            if let [eight, four, sixteen, more] = &values[..]
                && variable.is_float()
                && let ([eight, ..], [four, ..], [sixteen, ..], [more, ..]) =
                    (&eight[..], &four[..], &sixteen[..], &more[..])
            {
                let (first, second, third) = (eight - four, sixteen - eight, more - sixteen);
                let like = |one: f64, other: f64| (one - other).abs() < 0.02 * other.abs();
                let scale = eight.abs().max(1e-3 * variable.nominal);
                if like(second, 2.0 * first) && like(third, second) && first.abs() > 1e-10 * scale {
                    return Some(format!(
                        "{} is {four:?} after 4 steps, {eight:?} after 8, {sixteen:?} after 16 and {more:?} after 24 to the \
                         same time: each adds something",
                        variable.name
                    ));
                }
            }
            for (number, other) in values[1..].iter().take(2).enumerate() {
                for (one, other) in values[0].iter().zip(other) {
                    let scale = one.abs().max(other.abs()).max(1e-3 * variable.nominal);
                    if (one - other).abs() > 1e-2 * scale {
                        let how = ["half as many steps", "twice as many steps"][number];
                        return Some(format!("{} is {one:?}, with {how} {other:?}", variable.name));
                    }
                }
            }
        }
        None
    });
    checker.judge("results.cut", writer.sequence, judge)?;
    Ok(())
}

/// The independent variable is the time, and a step ends where it was to end.
pub fn time(checker: &Checker) -> anyhow::Result<()> {
    let Some(index) =
        checker.description.variables.iter().position(|variable| variable.causality == "independent")
    else {
        return last_successful(checker);
    };
    // Steps of another size than the solver may have, too.
    let offer = checker.description.co_simulation.as_ref();
    let odd = checker
        .trajectories
        .iter()
        .find(|trajectory| trajectory.interface == Interface::CoSimulation)
        .filter(|_| {
            offer.is_some_and(|offer| {
                offer.can(&["canHandleVariableCommunicationStepSize"])
                    && offer.number("fixedInternalStepSize").is_none()
            })
        });
    let odd = odd.and_then(|trajectory| {
        let first = trajectory.points.first()?;
        let points = steps(&checker.description, first.time, &[0.77 * first.size; 4], false);
        Some(Trajectory { points, ..trajectory.clone() })
    });
    // From the start time of the description and from another start time, which an FMU may reject.
    let trajectories =
        checker.trajectories.iter().flat_map(|trajectory| [(trajectory, false), (trajectory, true)]);
    for (trajectory, later) in trajectories.chain(odd.iter().map(|trajectory| (trajectory, false))) {
        let mut writer = checker.writer();
        let by = if later { trajectory.end - checker.description.start_time } else { 0.0 };
        if later && trajectory.interface == Interface::ModelExchange {
            continue;
        }
        writer.begin(0, trajectory);
        writer.start_at(checker.description.start_time + by);
        let mut asked = Vec::new();
        for point in &trajectory.points {
            let point = Point { time: point.time + by, ..point.clone() };
            let ids = writer.point(0, trajectory, &point);
            let stepped = trajectory.interface == Interface::CoSimulation;
            let time = if stepped { point.time + point.size } else { point.time };
            let id = ids.last().copied().filter(|_| stepped && checker.fmi3());
            asked.push((writer.read_these(0, &[index]), time, id));
        }
        let judge: Judge = Arc::new(move |run| {
            asked.iter().find_map(|(reads, time, step)| {
                let value = *value_of(run, reads, index)?.numbers().first()?;
                // Section 4.2.1 of FMI 3.0: a step may end elsewhere, and says where.
                let reached = step.and_then(|id| run.of(id)?.written.get(3)?.numbers().first().copied());
                let time = &reached.unwrap_or(*time);
                let off = (value - time).abs() > 1e-9 * (1.0 + time.abs());
                off.then(|| format!("the independent variable is {value:?} at {time:?}"))
            })
        });
        checker.judge("results.time", writer.sequence, judge)?;
    }
    last_successful(checker)
}

/// In FMI 3.0 a step says where it has come to, which may be elsewhere where its end cannot be met.
fn last_successful(checker: &Checker) -> anyhow::Result<()> {
    let trajectory =
        checker.trajectories.iter().find(|trajectory| trajectory.interface == Interface::CoSimulation);
    let (true, Some(trajectory)) = (checker.fmi3(), trajectory) else { return Ok(()) };
    let mut writer = checker.writer();
    writer.begin(0, trajectory);
    let mut asked = Vec::new();
    for point in &trajectory.points {
        let ids = writer.point(0, trajectory, point);
        asked.extend(ids.last().map(|id| (*id, point.time + point.size)));
    }
    let judge: Judge = Arc::new(move |run| {
        asked.iter().find_map(|(id, time)| {
            let outcome = run.of(*id).filter(|of| of.status == Some(0))?;
            let reached = *outcome.written.get(3)?.numbers().first()?;
            let off = (reached - time).abs() > 1e-9 * (1.0 + time.abs());
            off.then(|| format!("lastSuccessfulTime is {reached:?}, the step ends at {time:?}"))
        })
    });
    checker.judge("results.last-successful-time", writer.sequence, judge)?;
    Ok(())
}
