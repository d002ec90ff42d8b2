//! Checks that results do not depend on the process, arguments of the instantiation, other instances, threads, reads or the step size, and
//! that the FMU returns the right times.

use crate::call_sequence::{Action, Arg, Kind, Make, Run};
use crate::checker::Checker;
use crate::description::Description;
use crate::finding::{Criterion, any, status_name};
use crate::trajectory::steps;
use crate::values::is_other_time;
use crate::writer::Part::{Begin, Points, ReadAll, Run as RunFrom};
use crate::writer::{Part, Point, Read, Trajectory, access, number_of, value_of};
use fmi_abi::Causality;

/// Complete simulation that reads all variables and vectors at every point.
const COMPLETE: &[Part] = &[Begin, ReadAll, RunFrom(0)];

/// Checks that a simulation has the same results in another process, where addresses and the contents of uninitialized memory differ.
pub fn repeat(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let mut writer = checker.writer(trajectory);
    let one = writer.write(0, COMPLETE).reads;
    writer.add(Action::FreshProcess);
    let other = writer.write(0, COMPLETE).reads;
    let criterion = checker.differ(&one, &other, "{} is {}, in another process {}");
    checker.check("results.process", writer.sequence, criterion)
}

/// Rule and message about an argument of the instantiation that must not affect results, and a change of the argument.
type Argument = (&'static str, &'static str, fn(&mut Make));
const ARGUMENTS: [Argument; 3] = [
    ("results.name", "{} is {}, of an instance of another name {}", |make| {
        make.name = "an instance of another name".to_owned()
    }),
    ("results.logging", "{} is {}, of an instance without logging {}", |make| make.logging = false),
    ("results.visible", "{} is {}, of a visible instance {}", |make| make.visible = true),
];

/// Checks that an instance with other [`ARGUMENTS`] has the same results. Strings are not compared, because they may contain the name.
pub fn arguments(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    for (rule, message, change) in ARGUMENTS {
        let mut writer = checker.writer(trajectory);
        let [usual, changed] = [|_: &mut Make| {}, change].map(|change| {
            writer.make_with(0, change);
            let reads = writer.write(0, &[Part::Enter, Part::Leave, ReadAll, RunFrom(0)]).reads;
            writer.free(0);
            checker.numeric(reads)
        });
        let criterion = checker.differ(&usual, &changed, message);
        checker.check(rule, writer.sequence, criterion)?;
    }
    Ok(())
}

/// Checks that two instances that are called in turns have the same results as a single instance.
pub fn instances(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let mut writer = checker.writer(trajectory);
    let single = writer.write(0, COMPLETE).reads;
    writer.free(0);
    let (mut one, mut other) = (writer.write(1, &[Begin, ReadAll]).reads, Vec::new());
    // The second instance is two points behind the first, so that their states differ.
    let count = trajectory.points.len();
    for number in 0..count + 2 {
        if number == 1 {
            other.extend(writer.write(2, &[Begin, ReadAll]).reads);
        }
        if let Some(point) = trajectory.points.get(number) {
            writer.point(1, point);
        }
        if number >= 2 {
            writer.point(2, &trajectory.points[number - 2]);
        }
        if number < count {
            one.extend(writer.read_all(1));
        }
        if number >= 2 {
            other.extend(writer.read_all(2));
        }
    }
    let criteria = [
        checker.differ(&single, &one, "{} is {}, next to another instance {}"),
        checker.differ(&single, &other, "{} is {}, of a second instance next to the first {}"),
    ];
    checker.check("results.instances", writer.sequence, any(criteria))
}

/// Returns the criterion that each variable has the same value if it is read separately (`singly`) and with others (`together`). The
/// message is made of the name and both values.
fn same_value(
    checker: &Checker,
    singly: Vec<(usize, Vec<Read>)>,
    together: Vec<Read>,
    message: fn(&str, String, String) -> String,
) -> Box<dyn Criterion> {
    let description = checker.description.clone();
    Box::new(move |run: &Run| {
        singly.iter().find_map(|(index, reads)| {
            let (one, other) = (value_of(run, reads, *index)?, value_of(run, &together, *index)?);
            let at = one.differ(&other)?;
            Some(message(&description.variables[*index].name, one.show(at), other.show(at)))
        })
    })
}

/// Checks that results do not depend on how many variables are read, how they are grouped, and how often they are read.
pub fn reading(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let mut writer = checker.writer(trajectory);
    let read_at_end = writer.write(0, &[Begin, Points(usize::MAX), ReadAll, Part::Free]).reads;
    let all = &checker.readable;
    writer.write(1, &[Begin, ReadAll]);
    for point in &trajectory.points {
        writer.point(1, point);
        for index in all.iter().rev().take(200) {
            writer.read_these(1, &[*index]);
        }
        writer.read_all(1);
    }
    let [read, again] = [(); 2].map(|()| writer.read_all(1));
    let mut single = |index: &usize| (*index, writer.read_these(1, &[*index]));
    let singly: Vec<_> = all.iter().take(400).map(&mut single).collect();
    let criteria = [
        checker.differ(&read, &again, "{} is {}, read a second time {}"),
        same_value(checker, singly, read.clone(), |name, one, together| {
            format!("{name} is {together} read with others and {one} read separately")
        }),
        checker.differ(&read_at_end, &read, "{} is {}, after more was read meanwhile {}"),
    ];
    checker.check("results.reading", writer.sequence, any(criteria))?;
    read_twice(checker, trajectory, all)?;
    read_first(checker, trajectory)
}

/// Checks that each output has the same value whether it is read first or after others.
fn read_first(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let variables = &checker.description.variables;
    let outputs = checker.readable.iter().copied();
    let outputs =
        outputs.filter(|index| variables[*index].causality == Causality::Output).take(checker.at_most(16));
    let mut writer = checker.writer(trajectory);
    let together = writer.write(0, &[Begin, Points(3), Part::Read, Part::Free]).reads;
    let mut single = Vec::new();
    for output in outputs {
        writer.write(0, &[Begin, Points(3)]);
        single.push((output, writer.read_these(0, &[output])));
        writer.free(0);
    }
    let criterion = same_value(checker, single, together, |name, one, other| {
        format!("{name} is {one} read first and {other} read after others")
    });
    checker.check("results.reading", writer.sequence, criterion)
}

/// Checks that a call that reads each variable twice returns equal values, and that a call that reads no variable succeeds.
fn read_twice(checker: &Checker, trajectory: &Trajectory, all: &[usize]) -> anyhow::Result<()> {
    let mut writer = checker.writer(trajectory);
    writer.begin(0);
    let singly = writer.read_these(0, all);
    let indices: Vec<usize> = all.iter().flat_map(|index| [*index, *index]).collect();
    let twice = writer.read_these(0, &indices);
    let nothing = access(checker.description.standard, Vec::new(), [Arg::Out(Kind::F64, 0)], 0);
    let none = writer.call(0, if checker.fmi3() { "GetFloat64" } else { "GetReal" }, nothing);
    let description = checker.description.clone();
    checker.check("results.repeated", writer.sequence, move |run| {
        if let Some(status) = run.status(none).filter(|status| *status > 1) {
            return Some(format!("a call that queries no variable returns {}", status_name(status)));
        }
        singly.iter().zip(&twice).find_map(|(single, double)| {
            if [single, double].iter().any(|read| !run.succeeds(read.id)) {
                return None;
            }
            single.parts().find_map(|(index, begin, size)| {
                let once = run.written(single.id)?.part(begin, size)?;
                let second = run.written(double.id)?.part(2 * begin + size, size)?;
                let element = once.differ(&second)?;
                let name = &description.variables[index].name;
                let (once, second) = (once.show(element), second.show(element));
                Some(format!("{name} is {once}, and {second} when it is read a second time in a call"))
            })
        })
    })
}

/// Checks that simulations on four threads have the same results as a single simulation.
pub fn threads(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let mut writer = checker.writer(trajectory);
    let single = writer.write(0, COMPLETE).reads;
    writer.free(0);
    let (mut threads, mut criteria) = (Vec::new(), Vec::new());
    for number in 1..=4 {
        let mut thread = threads.last().unwrap_or(&writer).thread();
        // Each thread executes twenty simulations, so that simulations on different threads overlap.
        for _ in 0..20 {
            let reads = thread.write(number, COMPLETE).reads;
            criteria.push(checker.differ(
                &single,
                &reads,
                "{} is {}, on a thread in parallel with others {}",
            ));
            thread.free(number);
        }
        threads.push(thread);
    }
    writer.join(threads);
    checker.check("results.threads", writer.sequence, any(criteria))
}

/// Checks that simulations to the same time have similar results with different step sizes. The inputs are constant.
pub fn cut(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    if !checker.can(trajectory.interface, &["canHandleVariableCommunicationStepSize"])
        || trajectory.points.len() < 4
        || checker.description.event_mode()
    {
        return Ok(());
    }
    // If the internal step size is fixed, half a step must still be a multiple of it, so the steps are twice as long.
    let offer = checker.description.co_simulation.as_ref();
    let fixed = offer.and_then(|offer| offer.fixed_internal_step_size());
    let Point { time: start, size, .. } = trajectory.points[0];
    let size = size * if fixed.is_some() { 2.0 } else { 1.0 };
    let mut writer = checker.writer(trajectory);
    let sizes = [(size, 8), (2.0 * size, 4), (size / 2.0, 16), (size / 3.0, 24)];
    let sizes = if fixed.is_some() { &sizes[..3] } else { &sizes };
    let mut ends = Vec::new();
    for (instance, (size, count)) in sizes.iter().enumerate() {
        writer.begin(instance);
        for point in steps(&checker.description, start, &vec![*size; *count], false) {
            writer.point(instance, &Point { inputs: Vec::new(), ..point });
        }
        ends.push(writer.write(instance, &[Part::Read, Part::Free]).reads);
    }
    let description = checker.description.clone();
    checker.check("results.cut", writer.sequence, move |run| {
        (0..description.variables.len()).find_map(|index| {
            let value = |end: &Vec<Read>| value_of(run, end, index).map(|value| value.numbers());
            let values: Vec<Vec<f64>> = ends.iter().map(|end| value(end).unwrap_or_default()).collect();
            different_in_steps(&description, index, &values)
        })
    })
}

/// Describes how far the values of a variable at one time differ if that time is reached in different numbers of steps; `None` if they
/// are similar. `values` contains the values after 8, 4 and 16 steps and, unless there is a `fixedInternalStepSize`,
/// after 24.
fn different_in_steps(description: &Description, index: usize, values: &[Vec<f64>]) -> Option<String> {
    let variable = &description.variables[index];
    let name = &variable.name;
    // If each step adds the same error, the error is proportional to the number of steps. The error of a solver is not.
    if let [eight, four, sixteen, more] = values
        && variable.is_float()
        && let ([eight, ..], [four, ..], [sixteen, ..], [more, ..]) =
            (&eight[..], &four[..], &sixteen[..], &more[..])
    {
        let (first, second, third) = (eight - four, sixteen - eight, more - sixteen);
        let is_like = |one: f64, other: f64| (one - other).abs() < 0.02 * other.abs();
        let scale = eight.abs().max(1e-3 * variable.nominal());
        if is_like(second, 2.0 * first) && is_like(third, second) && first.abs() > 1e-10 * scale {
            return Some(format!(
                "{name} is {four:?} after 4 steps, {eight:?} after 8, {sixteen:?} after 16 and {more:?} after 24 to the \
                 same time: each adds something"
            ));
        }
    }
    let comparisons = ["half as many steps", "twice as many steps"];
    values[1..].iter().zip(comparisons).find_map(|(others, comparison)| {
        let off = |(one, other): &(&f64, &f64)| {
            let scale = one.abs().max(other.abs()).max(1e-3 * variable.nominal());
            (*one - *other).abs() > 1e-2 * scale
        };
        let (one, other) = values[0].iter().zip(others).find(off)?;
        Some(format!("{name} is {one:?}, with {comparison} {other:?}"))
    })
}

/// Checks that the independent variable is the time at the end of each step or, in Model Exchange, at each point.
pub fn time(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let description = &checker.description;
    let Some(index) = description.independent() else { return Ok(()) };
    let mut runs = vec![(0.0, trajectory.points.clone())];
    if let (true, Some(first)) = (trajectory.is_stepped(), trajectory.points.first()) {
        // Another start time, which an FMU may reject, and a step size that is unlikely to be a multiple of the solver's step
        // size.
        runs.push((trajectory.end - description.start_time, trajectory.points.clone()));
        let offer = description.co_simulation.as_ref();
        if offer.is_some_and(|offer| {
            offer.can(&["canHandleVariableCommunicationStepSize"])
                && offer.fixed_internal_step_size().is_none()
        }) {
            runs.push((0.0, steps(description, first.time, &[0.77 * first.size; 4], false)));
        }
    }
    for (by, points) in runs {
        let mut writer = checker.writer(trajectory);
        writer.make(0);
        writer.enter_with(0, None, description.start_time + by, None);
        writer.leave(0);
        let mut reads = Vec::new();
        for point in points {
            let point = Point { time: point.time + by, ..point };
            let ids = writer.point(0, &point);
            let stepped = trajectory.is_stepped();
            let time = if stepped { point.time + point.size } else { point.time };
            let id = ids.last().copied().filter(|_| stepped && checker.fmi3());
            reads.push((writer.read_these(0, &[index]), time, id));
        }
        checker.check("results.time", writer.sequence, move |run| {
            reads.iter().find_map(|(reads, time, step)| {
                let value = number_of(run, reads, index)?;
                // A step may end early, at the lastSuccessfulTime that it returns (section 4.2.1 of FMI 3.0).
                let reached = step.and_then(|id| run.outcome(id)?.written.get(3)?.numbers().first().copied());
                let time = reached.unwrap_or(*time);
                is_other_time(value, time)
                    .then(|| format!("the independent variable is {value:?} at {time:?}"))
            })
        })?;
    }
    Ok(())
}

/// Checks that `lastSuccessfulTime` is the end of each step that returns OK.
pub fn last_successful(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let mut writer = checker.writer(trajectory);
    writer.begin(0);
    let mut points = Vec::new();
    for point in &trajectory.points {
        let ids = writer.point(0, point);
        points.extend(ids.last().map(|id| (*id, point.time + point.size)));
    }
    checker.check("results.last-successful-time", writer.sequence, move |run| {
        points.iter().find_map(|(id, time)| {
            let outcome = run.outcome(*id).filter(|outcome| outcome.status == Some(0))?;
            let reached = *outcome.written.get(3)?.numbers().first()?;
            is_other_time(reached, *time)
                .then(|| format!("lastSuccessfulTime is {reached:?}, the step ends at {time:?}"))
        })
    })
}
