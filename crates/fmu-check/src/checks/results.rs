//! Results depend on the calls alone: not on the process, on other instances, on threads, on what was read.

use crate::checker::Checker;
use crate::course::steps;
use crate::finding::{Judge, status_name};
use crate::script::{Arg, Kind, Numbered, Step};
use crate::writer::{Course, Point, Read, Writer, difference, readable, value_of};
use fmi_abi::Interface;
use std::sync::Arc;

/// The whole course with all that can be read.
fn whole(writer: &mut Writer, of: usize, course: &Course) -> Vec<Read> {
    writer.begin(of, course);
    let mut reads = writer.ask(of, course.interface);
    for point in &course.points {
        writer.point(of, course, point);
        reads.extend(writer.ask(of, course.interface));
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

/// The same calls in another process, whose memory is elsewhere and held other things.
pub fn repeat(checker: &Checker) -> anyhow::Result<()> {
    for course in &checker.courses {
        let mut writer = checker.writer();
        let one = whole(&mut writer, 0, course);
        writer.add(Step::FreshProcess);
        let other = whole(&mut writer, 0, course);
        checker.judge("results.process", writer.script, judge(checker, one, other, "in another process"))?;
    }
    Ok(())
}

/// The same calls of an instance of another name. Texts may well have it in them.
pub fn name(checker: &Checker) -> anyhow::Result<()> {
    for course in &checker.courses {
        let mut writer = checker.writer();
        let one = whole(&mut writer, 0, course);
        writer.free(0);
        let begin = writer.script.len();
        let other = whole(&mut writer, 0, course);
        if let Some(Step::Make(_, how)) = writer.script.get_mut(begin).map(|numbered| &mut numbered.step) {
            how.name = Some("an instance of another name".to_owned());
        }
        let no_texts = |reads: Vec<Read>| -> Vec<Read> {
            let texts = |read: &Read| {
                read.of.iter().any(|(place, _)| !checker.description.variables[*place].is_number())
            };
            reads.into_iter().filter(|read| !texts(read)).collect()
        };
        let judge = judge(checker, no_texts(one), no_texts(other), "of an instance of another name");
        checker.judge("results.name", writer.script, judge)?;
    }
    Ok(())
}

/// A second instance before, meanwhile, and in turns.
pub fn instances(checker: &Checker) -> anyhow::Result<()> {
    for course in checker.courses.iter().filter(|course| checker.several(course.interface)) {
        let mut writer = checker.writer();
        let alone = whole(&mut writer, 0, course);
        writer.free(0);
        let (mut one, mut other) = (Vec::new(), Vec::new());
        writer.begin(1, course);
        one.extend(writer.ask(1, course.interface));
        // The other is two points behind, so that both are not in the same state.
        let count = course.points.len();
        for number in 0..count + 2 {
            if number == 1 {
                writer.begin(2, course);
                other.extend(writer.ask(2, course.interface));
            }
            if let Some(point) = course.points.get(number) {
                writer.point(1, course, point);
            }
            if number >= 2 {
                writer.point(2, course, &course.points[number - 2]);
            }
            if number < count {
                one.extend(writer.ask(1, course.interface));
            }
            if number >= 2 {
                other.extend(writer.ask(2, course.interface));
            }
        }
        let first = judge(checker, alone.clone(), one, "beside another instance");
        let second = judge(checker, alone, other, "of a second instance beside the first");
        let both: Judge = Arc::new(move |run| first(run).or_else(|| second(run)));
        checker.judge("results.instances", writer.script, both)?;
    }
    Ok(())
}

/// What is read, how often and in which groups changes nothing.
pub fn reading(checker: &Checker) -> anyhow::Result<()> {
    for course in &checker.courses {
        let mut writer = checker.writer();
        writer.begin(0, course);
        for point in &course.points {
            writer.point(0, course, point);
        }
        let silent = writer.ask(0, course.interface);
        writer.free(0);
        let all = readable(&checker.description);
        writer.begin(1, course);
        writer.ask(1, course.interface);
        for point in &course.points {
            writer.point(1, course, point);
            for place in all.iter().rev().take(200) {
                writer.read_these(1, &[*place]);
            }
            writer.ask(1, course.interface);
        }
        let read = writer.ask(1, course.interface);
        let again = writer.ask(1, course.interface);
        let singly: Vec<Read> =
            all.iter().take(400).flat_map(|place| writer.read_these(1, &[*place])).collect();
        let description = checker.description.clone();
        let changed = judge(checker, silent, read.clone(), "after more was read meanwhile");
        let twice = judge(checker, read.clone(), again, "read a second time");
        let alone: Judge = Arc::new(move |run| {
            for single in &singly {
                let (place, _) = single.of.first()?;
                let together = value_of(run, &read, *place);
                let one = value_of(run, std::slice::from_ref(single), *place);
                if let (Some(together), Some(one)) = (together, one)
                    && let Some(at) = together.differ(&one)
                {
                    let name = &description.variables[*place].name;
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
        checker.judge("results.reading", writer.script, all_three)?;
        repeated(checker, course, &all)?;
        first(checker, course)?;
    }
    Ok(())
}

/// Each output read first after a step, in a separate instance.
fn first(checker: &Checker, course: &Course) -> anyhow::Result<()> {
    let variables = &checker.description.variables;
    let outputs =
        readable(&checker.description).into_iter().filter(|place| variables[*place].causality == "output");
    let mut writer = checker.writer();
    let start = |writer: &mut Writer| {
        writer.begin(0, course);
        for point in course.points.iter().take(3) {
            writer.point(0, course, point);
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
    checker.judge("results.reading", writer.script, judge)?;
    Ok(())
}

/// A variable twice in one call, and none at all.
fn repeated(checker: &Checker, course: &Course, all: &[usize]) -> anyhow::Result<()> {
    let mut writer = checker.writer();
    writer.begin(0, course);
    let singly = writer.read_these(0, all);
    let places: Vec<usize> = all.iter().flat_map(|place| [*place, *place]).collect();
    let doubly = writer.read_these(0, &places);
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
            single.of.iter().find_map(|(place, size)| {
                at += 2 * size;
                let once = value_of(run, std::slice::from_ref(single), *place)?;
                let second = run.written(double.id)?.part(at - size, *size)?;
                let element = once.differ(&second)?;
                let name = &description.variables[*place].name;
                Some(format!(
                    "{name} is {}, asked for twice in a call {} the second time",
                    once.show(element),
                    second.show(element)
                ))
            })
        })
    });
    checker.judge("results.repeated", writer.script, judge)?;
    Ok(())
}

/// Instances in threads of their own.
pub fn threads(checker: &Checker) -> anyhow::Result<()> {
    for course in checker.courses.iter().filter(|course| checker.several(course.interface)) {
        let mut writer = checker.writer();
        let alone = whole(&mut writer, 0, course);
        writer.free(0);
        let mut scripts: Vec<Vec<Numbered>> = Vec::new();
        let mut reads: Vec<Vec<Read>> = Vec::new();
        for number in 1..=4 {
            let mut thread = Writer::new(&checker.description);
            thread.next = writer.next;
            // More than one simulation, so that they meet.
            for _ in 0..20 {
                reads.push(whole(&mut thread, number, course));
                thread.free(number);
            }
            writer.next = thread.next;
            scripts.push(thread.script);
        }
        writer.add(Step::Parallel(scripts));
        let judges: Vec<Judge> = reads
            .into_iter()
            .map(|reads| judge(checker, alone.clone(), reads, "on a thread beside others"))
            .collect();
        let any: Judge = Arc::new(move |run| judges.iter().find_map(|judge| judge(run)));
        checker.judge("results.threads", writer.script, any)?;
    }
    Ok(())
}

/// The same time in steps of another size, with inputs that do not change.
pub fn cut(checker: &Checker) -> anyhow::Result<()> {
    let Some(course) = checker.courses.iter().find(|course| course.interface == Interface::CoSimulation)
    else {
        return Ok(());
    };
    if !checker.can(Interface::CoSimulation, &["canHandleVariableCommunicationStepSize"])
        || course.points.len() < 4
        || checker.description.event_mode()
    {
        return Ok(());
    }
    // Half a step must be as good as a whole one.
    let fixed =
        checker.description.co_simulation.as_ref().and_then(|offer| offer.number("fixedInternalStepSize"));
    let size = course.points[0].size * if fixed.is_some() { 2.0 } else { 1.0 };
    let start = course.points[0].time;
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
        let course = Course { points, ..course.clone() };
        writer.begin(of, &course);
        for point in &course.points {
            writer.point(of, &course, point);
        }
        ends.push(writer.read(of));
        writer.free(of);
    }
    let description = checker.description.clone();
    let judge: Judge = Arc::new(move |run| {
        for (place, variable) in description.variables.iter().enumerate() {
            let values: Vec<Vec<f64>> = ends
                .iter()
                .map(|end| value_of(run, end, place).map(|value| value.numbers()).unwrap_or_default())
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
    checker.judge("results.cut", writer.script, judge)?;
    Ok(())
}

/// The independent variable is the time, and a step ends where it was to end.
pub fn time(checker: &Checker) -> anyhow::Result<()> {
    let Some(place) =
        checker.description.variables.iter().position(|variable| variable.causality == "independent")
    else {
        return last_successful(checker);
    };
    // Steps of another size than the solver may have, too.
    let offer = checker.description.co_simulation.as_ref();
    let odd =
        checker.courses.iter().find(|course| course.interface == Interface::CoSimulation).filter(|_| {
            offer.is_some_and(|offer| {
                offer.can(&["canHandleVariableCommunicationStepSize"])
                    && offer.number("fixedInternalStepSize").is_none()
            })
        });
    let odd = odd.and_then(|course| {
        let first = course.points.first()?;
        let points = steps(&checker.description, first.time, &[0.77 * first.size; 4], false);
        Some(Course { points, ..course.clone() })
    });
    // From the start time of the description and from another one, which an FMU may refuse.
    let courses = checker.courses.iter().flat_map(|course| [(course, false), (course, true)]);
    for (course, later) in courses.chain(odd.iter().map(|course| (course, false))) {
        let mut writer = checker.writer();
        let by = if later { course.end - checker.description.start_time } else { 0.0 };
        if later && course.interface == Interface::ModelExchange {
            continue;
        }
        writer.begin(0, course);
        writer.start_at(checker.description.start_time + by);
        let mut asked = Vec::new();
        for point in &course.points {
            let point = Point { time: point.time + by, ..point.clone() };
            let ids = writer.point(0, course, &point);
            let stepped = course.interface == Interface::CoSimulation;
            let time = if stepped { point.time + point.size } else { point.time };
            let id = ids.last().copied().filter(|_| stepped && checker.fmi3());
            asked.push((writer.read_these(0, &[place]), time, id));
        }
        let judge: Judge = Arc::new(move |run| {
            asked.iter().find_map(|(reads, time, step)| {
                let value = *value_of(run, reads, place)?.numbers().first()?;
                // Section 4.2.1 of FMI 3.0: a step may end elsewhere, and says where.
                let reached = step.and_then(|id| run.of(id)?.written.get(3)?.numbers().first().copied());
                let time = &reached.unwrap_or(*time);
                let off = (value - time).abs() > 1e-9 * (1.0 + time.abs());
                off.then(|| format!("the independent variable is {value:?} at {time:?}"))
            })
        });
        checker.judge("results.time", writer.script, judge)?;
    }
    last_successful(checker)
}

/// In FMI 3.0 a step says where it has come to, which may be elsewhere where its end cannot be met.
fn last_successful(checker: &Checker) -> anyhow::Result<()> {
    let course = checker.courses.iter().find(|course| course.interface == Interface::CoSimulation);
    let (true, Some(course)) = (checker.fmi3(), course) else { return Ok(()) };
    let mut writer = checker.writer();
    writer.begin(0, course);
    let mut asked = Vec::new();
    for point in &course.points {
        let ids = writer.point(0, course, point);
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
    checker.judge("results.last-successful-time", writer.script, judge)?;
    Ok(())
}
