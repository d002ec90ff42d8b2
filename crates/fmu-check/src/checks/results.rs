//! Results depend on the calls alone: not on the process, on other instances, on threads, on what was read.

use crate::checker::{Checker, Claim, steps};
use crate::finding::{Grade, Judge};
use crate::script::{Numbered, Step};
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
        let claim = Claim::new(
            "results.process",
            Grade::Fragile,
            checker.section("2.1", "2.2.1"),
            "The same calls give the same results in another process. What differs comes from memory that was not \
             written, addresses, the clock or chance.",
        );
        checker.judge(&claim, writer.script, judge(checker, one, other, "in another process"))?;
    }
    Ok(())
}

/// A second instance before, meanwhile, and in turns.
pub fn instances(checker: &Checker) -> anyhow::Result<()> {
    for course in checker.courses.iter().filter(|course| checker.several(course.interface)) {
        let section = checker.section("2.1.5", "2.3.1");
        let promise = "An FMU can be instantiated several times; an instance is not affected by others.";
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
        let claim = Claim::new("results.instances", Grade::Violation, section, promise);
        let first = judge(checker, alone.clone(), one, "beside another instance");
        let second = judge(checker, alone, other, "of a second instance beside the first");
        let both: Judge = Arc::new(move |run| first(run).or_else(|| second(run)));
        checker.judge(&claim, writer.script, both)?;
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
        let claim = Claim::new(
            "results.reading",
            Grade::Violation,
            checker.section("2.1.7", "2.2.7.2"),
            "Reading values changes nothing: not the values, and not what follows.",
        );
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
        checker.judge(&claim, writer.script, all_three)?;
    }
    Ok(())
}

/// Instances in threads of their own.
pub fn threads(checker: &Checker) -> anyhow::Result<()> {
    for course in checker.courses.iter().filter(|course| checker.several(course.interface)) {
        let mut writer = checker.writer();
        let alone = whole(&mut writer, 0, course);
        writer.free(0);
        let mut scripts: Vec<Vec<Numbered>> = Vec::new();
        let mut reads = Vec::new();
        for number in 1..=4 {
            let mut thread = Writer::new(&checker.description);
            thread.next = writer.next;
            // More than one simulation, so that they meet.
            for _ in 0..3 {
                whole(&mut thread, number, course);
                thread.free(number);
            }
            reads.push(whole(&mut thread, number, course));
            thread.free(number);
            writer.next = thread.next;
            scripts.push(thread.script);
        }
        writer.add(Step::Parallel(scripts));
        let claim = Claim::new(
            "results.threads",
            Grade::Violation,
            checker.section("2.1", "2.2.1"),
            "Different instances can be called from different threads at the same time.",
        );
        let judges: Vec<Judge> = reads
            .into_iter()
            .map(|reads| judge(checker, alone.clone(), reads, "on a thread beside others"))
            .collect();
        let any: Judge = Arc::new(move |run| judges.iter().find_map(|judge| judge(run)));
        checker.judge(&claim, writer.script, any)?;
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
    {
        return Ok(());
    }
    // Half a step must be as good as a whole one.
    let fixed =
        checker.description.co_simulation.as_ref().and_then(|offer| offer.number("fixedInternalStepSize"));
    let size = course.points[0].size * if fixed.is_some() { 2.0 } else { 1.0 };
    let start = course.points[0].time;
    let held = |size: f64, count: usize| -> Vec<Point> {
        let mut points = steps(&checker.description, start, size, count, false);
        points.iter_mut().for_each(|point| point.inputs = Vec::new());
        points
    };
    let mut writer = checker.writer();
    let mut ends = Vec::new();
    for (of, points) in [held(size, 8), held(2.0 * size, 4), held(size / 2.0, 16)].into_iter().enumerate() {
        let course = Course { points, ..course.clone() };
        writer.begin(of, &course);
        for point in &course.points {
            writer.point(of, &course, point);
        }
        ends.push(writer.read(of));
        writer.free(of);
    }
    let description = checker.description.clone();
    let claim = Claim::new(
        "results.cut",
        Grade::Note,
        checker.section("4.2.2", "4.2.1"),
        "Where inputs do not change, the state at a time hardly depends on how many steps led there \
         (canHandleVariableCommunicationStepSize). A note: a solver of fixed steps has such errors.",
    );
    let judge: Judge = Arc::new(move |run| {
        for (place, variable) in description.variables.iter().enumerate() {
            let values: Vec<Vec<f64>> = ends
                .iter()
                .map(|end| value_of(run, end, place).map(|value| value.numbers()).unwrap_or_default())
                .collect();
            for (number, other) in values[1..].iter().enumerate() {
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
    checker.judge(&claim, writer.script, judge)?;
    Ok(())
}

/// The independent variable is the time, and a step ends where it was to end.
pub fn time(checker: &Checker) -> anyhow::Result<()> {
    let Some(place) =
        checker.description.variables.iter().position(|variable| variable.causality == "independent")
    else {
        return last_successful(checker);
    };
    for course in &checker.courses {
        let mut writer = checker.writer();
        writer.begin(0, course);
        let mut asked = Vec::new();
        for point in &course.points {
            writer.point(0, course, point);
            let time = if course.interface == Interface::CoSimulation {
                point.time + point.size
            } else {
                point.time
            };
            asked.push((writer.read_these(0, &[place]), time));
        }
        let claim = Claim::new(
            "results.time",
            Grade::Violation,
            checker.section("2.2.7", "2.4.7.4"),
            "The independent variable is the time: after a step, its end.",
        );
        let judge: Judge = Arc::new(move |run| {
            asked.iter().find_map(|(reads, time)| {
                let value = *value_of(run, reads, place)?.numbers().first()?;
                let off = (value - time).abs() > 1e-9 * (1.0 + time.abs());
                off.then(|| format!("the independent variable is {value:?} at {time:?}"))
            })
        });
        checker.judge(&claim, writer.script, judge)?;
    }
    last_successful(checker)
}

/// In FMI 3.0 a step says where it has come to.
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
    let claim = Claim::new(
        "results.last-successful-time",
        Grade::Violation,
        "4.2.1",
        "lastSuccessfulTime is the end of the step, which does not return early where that is not allowed.",
    );
    let judge: Judge = Arc::new(move |run| {
        asked.iter().find_map(|(id, time)| {
            let outcome = run.of(*id).filter(|of| of.status == Some(0))?;
            let early = outcome.written.get(2)?.numbers().first() == Some(&1.0);
            let reached = *outcome.written.get(3)?.numbers().first()?;
            if early {
                return Some("a step returned early, which was not allowed".to_owned());
            }
            let off = (reached - time).abs() > 1e-9 * (1.0 + time.abs());
            off.then(|| format!("lastSuccessfulTime is {reached:?}, the step ends at {time:?}"))
        })
    });
    checker.judge(&claim, writer.script, judge)?;
    Ok(())
}
