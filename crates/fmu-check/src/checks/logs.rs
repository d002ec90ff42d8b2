//! Messages: their status, category and text; none where logging is off.

use crate::checker::{Checker, Claim};
use crate::finding::{Grade, Judge};
use crate::script::{Arg, Message, Numbered, Outcome, Run, Script, Step};
use std::sync::Arc;

type Test = Arc<dyn Fn(&Message) -> Option<String> + Send + Sync>;

/// What holds of every message.
pub fn look(checker: &Checker, script: &Script, run: &Run, numbered: &Numbered, outcome: &Outcome) {
    let section = checker.section("2.1.5", "2.3.1");
    let categories = checker.description.log_categories.clone();
    let fmi3 = checker.fmi3();
    let show = |text: &[u8]| format!("{:?}", String::from_utf8_lossy(text));
    let tests: Vec<(&str, Grade, &str, Test)> = vec![
        (
            "logs.category",
            Grade::Violation,
            "The category of a message is one of LogCategories; NULL if there are none.",
            Arc::new(move |message| match &message.category {
                None if categories.is_empty() => None,
                None => Some("its category is NULL, and the description has categories".to_owned()),
                Some(category) => {
                    let known = categories.iter().any(|known| known.as_bytes() == category.as_slice());
                    (!known).then(|| match categories.is_empty() {
                        true => format!("its category is {}, and the description has none", show(category)),
                        false => {
                            format!("its category is {}, which is none of the description's", show(category))
                        }
                    })
                }
            }),
        ),
        (
            "logs.text",
            Grade::Violation,
            "A message is a text in UTF-8.",
            Arc::new(move |message| match &message.text {
                None => Some("its text is NULL".to_owned()),
                Some(text) if std::str::from_utf8(text).is_err() => {
                    Some(format!("{} is no UTF-8", show(text)))
                }
                Some(_) => None,
            }),
        ),
        (
            "logs.status",
            Grade::Violation,
            "The status of a message is one of the standard's.",
            Arc::new(|message| {
                (!(0..=5).contains(&message.status)).then(|| format!("its status is {}", message.status))
            }),
        ),
        (
            "logs.format",
            Grade::Note,
            "A message is a text, not a format of printf: conversions in it stay.",
            Arc::new(move |message| {
                // In FMI 2.0 it is such a format, and its arguments follow.
                if !fmi3 {
                    return None;
                }
                let text = String::from_utf8_lossy(message.text.as_deref()?).into_owned();
                let conversions =
                    ["%s", "%d", "%i", "%u", "%g", "%f", "%e", "%x", "%lf", "%ld", "%lu", "%zu", "%.", "%p"];
                conversions.iter().any(|conversion| text.contains(conversion)).then(|| format!("{text:?}"))
            }),
        ),
    ];
    for (name, grade, promise, test) in tests {
        if checker.has(name) {
            continue;
        }
        let id = numbered.id;
        let judge: Judge = {
            let test = Arc::clone(&test);
            Arc::new(move |run| {
                run.of(id)?.log.iter().find_map(|message| {
                    let text =
                        String::from_utf8_lossy(message.text.as_deref().unwrap_or_default()).into_owned();
                    Some(format!("message {text:?}: {}", test(message)?))
                })
            })
        };
        if let Some(seen) = judge(run) {
            checker.add(Claim::new(name, grade, section, promise).finding(seen, script.clone(), judge));
        }
    }
    // Whoever is refused is told why.
    let silent = outcome.status.is_some_and(|status| (2..=4).contains(&status))
        && outcome.log.is_empty()
        && matches!(&numbered.step, Step::Call { of: Some(_), .. });
    if silent && !checker.has("logs.silent") {
        let made_silent = script.iter().any(|numbered| {
            matches!(&numbered.step, Step::Make(_, make) if !make.logging)
                || matches!(&numbered.step, Step::Call { function, .. } if function.ends_with("SetDebugLogging"))
        });
        if made_silent {
            return;
        }
        let (id, name) = (numbered.id, crate::finding::step_name(&numbered.step));
        let judge: Judge = Arc::new(move |run| {
            let outcome = run.of(id)?;
            let status = outcome.status.filter(|status| (2..=4).contains(status))?;
            outcome
                .log
                .is_empty()
                .then(|| format!("{name} answers {} and says nothing", crate::writer::status_name(status)))
        });
        let seen = judge(run).unwrap_or_default();
        let grade = if fmi3 { Grade::Violation } else { Grade::Note };
        let promise = "A function that does not answer OK says why, where logging is on.";
        checker.add(Claim::new("logs.silent", grade, section, promise).finding(seen, script.clone(), judge));
    }
}

/// With logging off no message, and switched on and off at any time.
pub fn switches(checker: &Checker) -> anyhow::Result<()> {
    let section = checker.section("2.1.5", "2.3.1");
    let fmi3 = checker.fmi3();
    for course in &checker.courses {
        for by_call in [false, true] {
            let mut writer = checker.writer();
            let mut how = writer.how(course.interface);
            how.logging = by_call;
            let mut ids = vec![writer.add(Step::Make(0, how))];
            if by_call {
                writer.call(0, "SetDebugLogging", vec![Arg::Whole(0), Arg::Whole(0), Arg::Null]);
                ids.clear();
            }
            ids.push(writer.enter(0));
            ids.extend(writer.leave(0, course));
            for point in &course.points {
                ids.extend(writer.point(0, course, point));
            }
            ids.extend(writer.ask(0, course.interface).iter().map(|read| read.id));
            ids.push(writer.call(0, "Terminate", vec![]));
            ids.push(writer.free(0));
            let claim = Claim::new(
                "logs.off",
                if checker.fmi3() { Grade::Violation } else { Grade::Note },
                section,
                "With logging off there are no messages.",
            );
            let judge: Judge = Arc::new(move |run| {
                let message = ids.iter().find_map(|id| {
                    // Of a refusal, FMI 3.0 says both that there must be a message and that there must be none.
                    let of = run.of(*id).filter(|of| of.status.is_none_or(|status| status < 2))?;
                    // In FMI 2.0 it is debug messages that are off.
                    of.log.iter().find(|message| fmi3 || message.status < 2)
                })?;
                let text = String::from_utf8_lossy(message.text.as_deref().unwrap_or_default()).into_owned();
                Some(format!("{text:?}"))
            });
            checker.judge(&claim, writer.script, judge)?;
        }
    }
    Ok(())
}
