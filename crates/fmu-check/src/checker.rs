//! What all checks share: it plays scripts, judges what came of them, and keeps what is found.

use crate::description::Description;
use crate::finding::{Finding, Grade, Judge, ending, step_name};
use crate::legal::first_illegal;
use crate::run::Workers;
use crate::script::{End, Numbered, Run, Script, Setting, Step, Written};
use crate::shrink::shrink;
use crate::writer::{Course, Point, Value, Writer, status_name};
use fmi_abi::{Interface, Standard};
use std::collections::HashMap;
use std::fmt;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// The time for all checks is over.
#[derive(Debug)]
pub struct TimeOver;

impl fmt::Display for TimeOver {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the time was over")
    }
}

impl std::error::Error for TimeOver {}

/// What an event did.
#[derive(Clone, Copy, Debug)]
pub struct Event {
    /// Another update is needed.
    pub again: bool,
    /// The model wants to end.
    pub terminate: bool,
    /// Continuous states have changed.
    pub states_changed: bool,
    /// The next time event.
    pub next: Option<f64>,
}

/// An FMU under attack.
pub struct Checker {
    /// What it promises.
    pub description: Description,
    /// Where its library is.
    pub setting: Setting,
    /// Play the scripts.
    pub workers: Workers,
    /// A simulation that goes well, by Co-Simulation and by Model Exchange.
    pub courses: Vec<Course>,
    /// Chooses what is chosen at random.
    pub seed: u64,
    /// Seconds for one script.
    pub limit: f64,
    /// When all must be over.
    pub deadline: Instant,
    found: Mutex<Vec<Finding>>,
    unreached: Mutex<Vec<String>>,
    played: Mutex<u64>,
}

fn locked<T>(of: &Mutex<T>) -> MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Keeps one finding of each name: the gravest, and of several such the one with the shortest call sequence, whichever
/// check is first. Its `more` lists the observations of the others.
fn keep(found: &mut Vec<Finding>, mut finding: Finding) {
    let Some(kept) = found.iter_mut().find(|kept| kept.name == finding.name) else {
        found.push(finding);
        return;
    };
    let rank = |finding: &Finding| (finding.grade, std::cmp::Reverse(finding.script.len()));
    if rank(&finding) > rank(kept) {
        std::mem::swap(kept, &mut finding);
    }
    for seen in std::iter::once(finding.seen).chain(finding.more) {
        if seen != kept.seen && !kept.more.contains(&seen) {
            kept.more.push(seen);
        }
    }
}

impl Checker {
    /// An FMU whose courses are not yet known.
    pub fn new(
        description: Description,
        setting: Setting,
        workers: Workers,
        seed: u64,
        limit: f64,
        deadline: Instant,
    ) -> Self {
        Self {
            description,
            setting,
            workers,
            courses: Vec::new(),
            seed,
            limit,
            deadline,
            found: Mutex::default(),
            unreached: Mutex::default(),
            played: Mutex::default(),
        }
    }

    /// A writer of scripts.
    pub fn writer(&self) -> Writer<'_> {
        Writer::new(&self.description)
    }

    /// Whether the standard is 3.0.
    pub fn fmi3(&self) -> bool {
        self.description.standard == Standard::Fmi3
    }

    /// The section of the standard at hand.
    pub fn section(&self, of_fmi2: &'static str, of_fmi3: &'static str) -> &'static str {
        self.description.section(of_fmi2, of_fmi3)
    }

    /// Whether a capability is declared for an interface.
    pub fn can(&self, interface: Interface, names: &[&str]) -> bool {
        self.description.offer(interface).is_some_and(|offer| offer.can(names))
    }

    /// Whether it saves states.
    pub fn saves(&self, interface: Interface) -> bool {
        self.can(interface, &["canGetAndSetFMUstate", "canGetAndSetFMUState"])
    }

    /// Whether it serializes states.
    pub fn serializes(&self, interface: Interface) -> bool {
        self.saves(interface) && self.can(interface, &["canSerializeFMUstate", "canSerializeFMUState"])
    }

    /// Whether there may be two instances in a process.
    pub fn several(&self, interface: Interface) -> bool {
        !self.can(interface, &["canBeInstantiatedOnlyOncePerProcess"])
    }

    /// Plays a script.
    pub fn play(&self, script: &Script) -> anyhow::Result<Run> {
        self.play_for(script, self.limit)
    }

    /// Plays a script for so many seconds at most.
    pub fn play_for(&self, script: &Script, limit: f64) -> anyhow::Result<Run> {
        debug_assert_eq!(self.illegal(script), None);
        let left = self.deadline.saturating_duration_since(Instant::now()).as_secs_f64();
        if left <= 0.0 {
            return Err(TimeOver.into());
        }
        *locked(&self.played) += 1;
        let run = self.workers.play(&self.setting, script, limit.min(left.max(0.5)))?;
        if matches!(run.end, End::Hang(seconds) if seconds < limit) {
            return Err(TimeOver.into());
        }
        Ok(run)
    }

    /// What a script has wrong by itself, for those who work on this tool.
    fn illegal(&self, script: &Script) -> Option<String> {
        let id = first_illegal(&self.description, script)?;
        let at = script.iter().find(|numbered| numbered.id == id)?;
        Some(format!("{id} {:?}", at.step))
    }

    /// How many scripts were played.
    pub fn played(&self) -> u64 {
        *locked(&self.played)
    }

    /// What was found.
    pub fn take(&self) -> Vec<Finding> {
        std::mem::take(&mut locked(&self.found))
    }

    /// What was not reached.
    pub fn take_unreached(&self) -> Vec<String> {
        std::mem::take(&mut locked(&self.unreached))
    }

    /// Notes what was not checked, and why.
    pub fn unreached(&self, what: String) {
        let mut unreached = locked(&self.unreached);
        if !unreached.contains(&what) {
            unreached.push(what);
        }
    }

    /// Keeps a finding.
    pub fn add(&self, finding: Finding) {
        keep(&mut locked(&self.found), finding);
    }

    /// Whether something of this name was found.
    pub fn has(&self, name: &str) -> bool {
        locked(&self.found).iter().any(|finding| finding.name == name)
    }

    /// Plays a script that keeps to the standard but for forbidden calls, and judges: first how it ended, then what holds
    /// of every run, then `judge`.
    pub fn judge(&self, claim: &Claim, script: Script, judge: Judge) -> anyhow::Result<Run> {
        let hostile = script.iter().any(|numbered| numbered.forbidden);
        let limit = if hostile { self.limit.min(3.0) } else { self.limit };
        let run = self.play_for(&script, limit)?;
        if run.end != End::Done {
            self.ended(claim, &script, &run, hostile)?;
            return Ok(run);
        }
        self.always(&script, &run);
        if let Some(seen) = judge(&run) {
            self.add(claim.finding(seen, script, judge));
        }
        Ok(run)
    }

    /// A run that did not come to its end.
    fn ended(&self, claim: &Claim, script: &Script, run: &Run, hostile: bool) -> anyhow::Result<()> {
        let Some(seen) = ending(run, script) else { return Ok(()) };
        let ends: Judge = {
            let (script, kind) = (script.clone(), std::mem::discriminant(&run.end));
            let at = run
                .at
                .and_then(|id| script.iter().find(|numbered| numbered.id == id))
                .map(|at| step_name(&at.step));
            Arc::new(move |run: &Run| {
                let here = run
                    .at
                    .and_then(|id| script.iter().find(|numbered| numbered.id == id))
                    .map(|at| step_name(&at.step));
                (std::mem::discriminant(&run.end) == kind && here == at).then(|| ending(run, &script))?
            })
        };
        if let End::Unloadable(_) = run.end {
            let section = self.section("2.3", "2.5.1");
            let promise = "The library for this platform can be loaded.";
            let claim = Claim::new("package.unloadable", Grade::Violation, section, promise);
            self.add(claim.finding(seen, script.clone(), ends));
            return Ok(());
        }
        // Whether memory beyond an array was touched: with room after it, it shows.
        if matches!(run.end, End::Crash(_)) && cfg!(unix) && !hostile {
            let soft = Setting { soft: true, ..self.setting.clone() };
            let again = self.workers.play(&soft, script, self.limit)?;
            let wrote = again.outcomes.values().any(|outcome| !outcome.damage.is_empty());
            if wrote {
                let claim = Claim::new(
                    "arrays.written-beyond",
                    Grade::Violation,
                    self.section("2.1.7", "2.2.7"),
                    "Nothing is written beyond the array that the importer passes with its size.",
                );
                self.add(claim.finding(format!("{seen}: it writes beyond an array"), script.clone(), ends));
                return Ok(());
            }
            if again.end == End::Done {
                let claim = Claim::new(
                    "arrays.read-beyond",
                    Grade::Violation,
                    self.section("2.1.7", "2.2.7"),
                    "Nothing is read beyond the array that the importer passes with its size.",
                );
                self.add(claim.finding(
                    format!("{seen}: it reads beyond an array, or memory that is gone"),
                    script.clone(),
                    ends,
                ));
                return Ok(());
            }
        }
        if let End::Flood(_) = run.end {
            let section = self.section("2.1", "2.2.1");
            let promise = "Processes that an FMU starts end with the instance that they were started for.";
            let claim = Claim::new("resources.processes", Grade::Violation, section, promise);
            self.add(claim.finding(seen, script.clone(), ends));
            return Ok(());
        }
        let what = match run.end {
            End::Hang(_) => "hang",
            End::Exit(_) => "exit",
            _ => "crash",
        };
        let claim = if hostile {
            let name =
                format!("{}.{what}", claim.name.trim_end_matches(".changed").trim_end_matches(".accepted"));
            let promise = "Whatever it is given, the FMU answers with a status and leaves the process alive.";
            Claim::new(&name, claim.ends.unwrap_or(Grade::Fragile), claim.section, promise)
        } else {
            // What only a fresh process shows has its own name; other crashes are the same in many checks.
            let own = ["fresh-process", "unload", "exit"].iter().any(|name| claim.name.ends_with(name));
            let name = format!("{}.{what}", if own { &claim.name } else { claim.topic() });
            let section = self.section("2.1.3", "2.2.4");
            let promise = "A call that the standard allows there returns with a status.";
            // Whether a call would return in the end cannot be known.
            let grade = if what == "hang" { Grade::Fragile } else { Grade::Violation };
            Claim::new(&name, grade, section, promise)
        };
        self.add(claim.finding(seen, script.clone(), ends));
        Ok(())
    }

    /// What holds of every run: nothing is written where it does not belong, statuses are those of the standard, messages
    /// are what importers can show.
    pub fn always(&self, script: &Script, run: &Run) {
        fn walk<'s>(script: &'s [Numbered], all: &mut Vec<&'s Numbered>) {
            for numbered in script {
                all.push(numbered);
                match &numbered.step {
                    Step::Repeat(_, steps) => walk(steps, all),
                    Step::Parallel(scripts) => scripts.iter().for_each(|script| walk(script, all)),
                    _ => {}
                }
            }
        }
        let mut all = Vec::new();
        walk(script, &mut all);
        if let Some(pairs) = lives(&all).filter(|_| !run.left.is_empty()) {
            let section = self.section("2.1", "2.2.1");
            let promise = "Processes that an FMU starts end with the instance that they were started for.";
            let claim = Claim::new("resources.processes", Grade::Violation, section, promise);
            let judge: Judge = Arc::new(move |run| {
                let (count, first) = (run.left.len(), run.left.first()?);
                let freed = |(make, free): &(u32, u32)| run.of(*make).is_none() || run.of(*free).is_some();
                let processes = if count == 1 { "process is" } else { "processes are" };
                pairs.iter().all(freed).then(|| {
                    format!("{count} {processes} left after all instances were freed, the first is {first:?}")
                })
            });
            if let Some(seen) = judge(run) {
                self.add(claim.finding(seen, script.clone(), judge));
            }
        }
        for numbered in all {
            let id = numbered.id;
            let Some(outcome) = run.of(id) else { continue };
            let name = step_name(&numbered.step);
            if let Some(damage) = outcome.damage.first() {
                let constant = damage.contains("const");
                let claim = Claim::new(
                    if constant { "arrays.const" } else { "arrays.written-beyond" },
                    Grade::Violation,
                    self.section("2.1.7", "2.2.7"),
                    "Nothing is written but to the array that the importer passes for it, with its size.",
                );
                let judge: Judge = Arc::new(move |run| {
                    run.of(id)?.damage.first().map(|damage| format!("{name} writes {damage}"))
                });
                let seen = judge(run).unwrap_or_default();
                self.add(claim.finding(seen, script.clone(), judge));
                continue;
            }
            if let (Some(status), Step::Call { function, .. }) = (outcome.status, &numbered.step)
                && !(0..=4).contains(&status)
                && !(status == 5 && function == "fmi2DoStep")
            {
                let claim = Claim::new(
                    "functions.status",
                    Grade::Violation,
                    self.section("2.1.3", "2.2.4"),
                    "A function answers with a status that the standard has for it.",
                );
                let function = function.clone();
                let judge: Judge = Arc::new(move |run| {
                    let status = run.status(id).filter(|status| !(0..=4).contains(status))?;
                    Some(format!("{function} answers {status}"))
                });
                let seen = judge(run).unwrap_or_default();
                self.add(claim.finding(seen, script.clone(), judge));
            }
            crate::checks::logs::look(self, script, run, numbered, outcome);
        }
        for outcome in run.outcomes.values() {
            if let Some(Written::Texts(texts)) = outcome.written.first()
                && let Some(text) = texts.iter().flatten().find(|text| std::str::from_utf8(text).is_err())
                && script.iter().any(|numbered| matches!(&numbered.step, Step::Call { function, .. } if function.ends_with("GetString") && numbered.id == outcome.id))
                && !script.iter().any(|numbered| numbered.forbidden)
            {
                let seen = format!("the text {:?} is no UTF-8", String::from_utf8_lossy(text));
                let section = self.section("2.1.2", "2.2.3");
                let id = outcome.id;
                let judge: Judge = Arc::new(move |run| match run.written(id)? {
                    Written::Texts(texts) => texts
                        .iter()
                        .flatten()
                        .find(|text| std::str::from_utf8(text).is_err())
                        .map(|text| format!("the text {:?} is no UTF-8", String::from_utf8_lossy(text))),
                    Written::Numbers(..) => None,
                });
                let claim = Claim::new("start_values.utf8", Grade::Violation, section, "Texts are UTF-8.");
                self.add(claim.finding(seen, script.clone(), judge));
            }
        }
    }

    /// The result of a successful update of the discrete states.
    pub fn event(&self, run: &Run, id: u32) -> Option<Event> {
        event(run, id, self.fmi3())
    }

    /// A shorter script for each finding, as long as there is time.
    pub fn shorten(&self, finding: &mut Finding) {
        finding.steps = (finding.script.len(), finding.script.len());
        let Some(judge) = finding.judge.clone() else { return };
        let hangs = finding.name.ends_with("hang");
        let limit = if hangs { self.limit.min(1.5) } else { self.limit };
        let mut left = match finding.topic() {
            _ if hangs => 12,
            "resources" => 15,
            _ => 400,
        };
        // What is compared must be what was to be compared: without these calls there are other differences.
        let ends = ["crash", "hang", "exit"].iter().any(|end| finding.name.ends_with(end));
        let pinned: &[&str] = match finding.topic() {
            _ if ends => &[],
            "states" | "reset" => &[
                "Reset",
                "GetFMUState",
                "SetFMUState",
                "FreeFMUState",
                "SerializedFMUStateSize",
                "SerializeFMUState",
                "DeserializeFMUState",
                "EnterInitializationMode",
            ],
            "derivatives" => &["SetReal", "SetFloat64", "SetContinuousStates"],
            "results" | "life_cycle" => &["SetTime", "DoStep", "CompletedIntegratorStep"],
            _ => &[],
        };
        // Where nothing is compared, one call shows it.
        let alone = [
            "life_cycle.refused",
            "life_cycle.states-changed",
            "results.early-return",
            "results.early-unsaid",
            "start_values.inputs",
        ]
        .contains(&finding.name.as_str());
        let pinned = if alone { &[] } else { pinned };
        // With the first script that is shorter the sentence may tell other numbers.
        let mut seen = finding.seen.clone();
        let short = shrink(&self.description, &finding.script, pinned, !alone, |tried| {
            left -= 1;
            if left < 0 || Instant::now() > self.deadline {
                return false;
            }
            let Ok(run) = self.workers.play(&self.setting, tried, limit) else { return false };
            match judge(&run) {
                Some(now) => {
                    seen = now;
                    true
                }
                None => false,
            }
        });
        finding.seen = seen;
        finding.steps.1 = short.len();
        finding.script = short;
    }
}

/// The instantiations of a script, each with the call that frees the instance; none if an instance is not freed.
fn lives(all: &[&Numbered]) -> Option<Vec<(u32, u32)>> {
    let mut alive = HashMap::new();
    let mut pairs = Vec::new();
    for numbered in all {
        match &numbered.step {
            Step::Make(place, _) if alive.insert(*place, numbered.id).is_some() => return None,
            Step::Free(place) => {
                pairs.extend(alive.remove(place).map(|make| (make, numbered.id)));
            }
            _ => {}
        }
    }
    alive.is_empty().then_some(pairs)
}

/// What a check claims.
#[derive(Clone, Debug)]
pub struct Claim {
    /// The name of the finding if it does not hold.
    pub name: String,
    /// Its grade.
    pub grade: Grade,
    /// The section that says so.
    pub section: &'static str,
    /// What is promised.
    pub promise: String,
    /// The grade of a crash or a hang, where it is not fragile.
    pub ends: Option<Grade>,
}

impl Claim {
    /// A claim.
    pub fn new(name: &str, grade: Grade, section: &'static str, promise: &str) -> Self {
        Self { name: name.to_owned(), grade, section, promise: promise.to_owned(), ends: None }
    }

    /// Its topic.
    pub fn topic(&self) -> &str {
        self.name.split('.').next().unwrap_or_default()
    }

    /// That it does not hold.
    pub fn finding(&self, seen: String, script: Script, judge: Judge) -> Finding {
        let mut finding = Finding::of_files(&self.name, self.grade, self.section, &self.promise, seen);
        finding.script = script;
        finding.judge = Some(judge);
        finding
    }
}

/// The result of a successful update of the discrete states.
pub fn event(run: &Run, id: u32, fmi3: bool) -> Option<Event> {
    let outcome = run.of(id).filter(|of| of.status.is_some_and(|status| status <= 1))?;
    let (flags, time) = if fmi3 {
        let number = |place: usize| outcome.written.get(place)?.numbers().first().copied();
        ([0, 1, 3, 4].map(|place| number(place) == Some(1.0)), number(5)?)
    } else {
        // fmi2EventInfo has five flags, two to a word, and the time.
        let Written::Numbers(_, words) = outcome.written.first()? else { return None };
        let [first, changed, defined, time] = words[..] else { return None };
        let flags = [first as u32 != 0, first >> 32 != 0, changed >> 32 != 0, defined as u32 != 0];
        (flags, f64::from_bits(time))
    };
    let [again, terminate, states_changed, defined] = flags;
    Some(Event { again, terminate, states_changed, next: defined.then_some(time) })
}

/// A sentence on a call that answered otherwise than OK.
pub fn refused(script: &Script, run: &Run, ids: &[u32]) -> Option<String> {
    let id = ids
        .iter()
        .find(|id| run.of(**id).is_some_and(|of| of.missing || of.status.is_some_and(|status| status > 1)))?;
    refused_one(script, run, *id)
}

/// A sentence on this call, if it did not answer OK.
pub fn refused_one(script: &Script, run: &Run, id: u32) -> Option<String> {
    let outcome = run.of(id)?;
    let name = script
        .iter()
        .find(|numbered| numbered.id == id)
        .map(|numbered| (step_name(&numbered.step), &numbered.step));
    let (name, step) = name?;
    if outcome.missing {
        return Some(format!("{name} is not in the library"));
    }
    let status = outcome.status?;
    let failed = if matches!(step, Step::Make(..)) { status == 0 } else { status > 1 };
    let why = outcome.log.iter().rev().find_map(|message| message.text.as_ref());
    let why = why.map_or(String::new(), |text| format!(": {:?}", String::from_utf8_lossy(text)));
    failed.then(|| {
        let answer = if matches!(step, Step::Make(..)) { "NULL".to_owned() } else { status_name(status) };
        format!("{name} answers {answer}{why}")
    })
}

/// Values for inputs: near their start values, within their ranges.
pub fn input_values(description: &Description, phase: usize, discrete: bool) -> Vec<(usize, Value)> {
    let mut values = Vec::new();
    for (place, variable) in description.variables.iter().enumerate() {
        let (Some(size), true) = (variable.size, variable.causality == "input" && !variable.clocked) else {
            continue;
        };
        if variable.once_per_instant {
            continue;
        }
        let starts = variable.starts();
        if variable.is_float() && variable.variability != "discrete" {
            let numbers = (0..size).map(|element| {
                let start = starts.get(element).copied().unwrap_or(0.0);
                near(variable, start, 0.1 * ((phase * 7 + place * 3 + element) as f64 * 0.7).sin())
            });
            values.push((place, Value::Numbers(numbers.collect())));
        } else if discrete && variable.base == Some(fmi_abi::BaseType::Boolean) {
            let on = f64::from(u8::from(phase / 4 % 2 == 1));
            let numbers = (0..size).map(|element| (starts.get(element).copied().unwrap_or(0.0) - on).abs());
            values.push((place, Value::Numbers(numbers.collect())));
        }
    }
    values
}

/// A number near another one, by so much of what is usual for the variable, within its range.
pub fn near(variable: &crate::description::Variable, start: f64, by: f64) -> f64 {
    let range = variable.min.zip(variable.max).map(|(min, max)| max - min).filter(|range| range.is_finite());
    let scale = range.unwrap_or(f64::INFINITY).min(variable.nominal.max(start.abs().min(1e6)));
    let number = start + by * scale;
    let number = variable.min.map_or(number, |min| number.max(min));
    variable.max.map_or(number, |max| number.min(max))
}

/// A course that takes longer is played too often.
const LONG: Duration = Duration::from_millis(250);

/// A simulation that goes well: in Co-Simulation steps with changing inputs, in Model Exchange an integration by Euler's
/// method with its events, found by playing it point by point.
pub fn find_course(
    checker: &Checker,
    interface: Interface,
) -> anyhow::Result<Result<Course, (String, Script)>> {
    let description = &checker.description;
    let start = description.start_time;
    let range = description.stop_time.map_or(1.0, |stop| stop - start).max(1e-6);
    let mut course = Course { interface, updates: 1, points: Vec::new(), end: start };
    if interface == Interface::CoSimulation {
        let size = description.step_size.unwrap_or(range / 100.0);
        // Section 4.4.1 of FMI 3.0: steps are multiples of the solver's.
        let internal =
            description.co_simulation.as_ref().and_then(|offer| offer.number("fixedInternalStepSize"));
        let size = internal.map_or(size, |internal| internal * (size / internal).round().clamp(1.0, 100.0));
        // To the end of the default experiment, where steps may have several sizes and that takes no time.
        let times = ((range / size - 4.0) / 8.0).round();
        let far = checker.can(interface, &["canHandleVariableCommunicationStepSize"]) && times > 1.0;
        for (reach, discrete) in [(times, true), (times, false), (1.0, true), (1.0, false)] {
            if reach > 1.0 && !far {
                continue;
            }
            let sizes: Vec<f64> =
                (0..12).map(|number| if number < 4 { size } else { reach * size }).collect();
            course.points = steps(description, start, &sizes, discrete);
            let mut writer = checker.writer();
            let mut ids = writer.begin(0, &course);
            let mut good = 0;
            for point in &course.points {
                ids.extend(writer.point(0, &course, point));
            }
            let begin = Instant::now();
            let run = checker.play(&writer.script)?;
            if reach > 1.0 && (run.end != End::Done || begin.elapsed() > LONG) {
                continue;
            }
            if run.end != End::Done {
                return Ok(Err((ending(&run, &writer.script).unwrap_or_default(), writer.script)));
            }
            let first_bad = refused(&writer.script, &run, &ids);
            if run.status(ids[0]) == Some(0) || run.of(ids[0]).is_some_and(|of| of.missing) {
                return Ok(Err((
                    refused_one(&writer.script, &run, ids[0]).unwrap_or_default(),
                    writer.script,
                )));
            }
            let steps: Vec<u32> = writer
                .script
                .iter()
                .filter(|numbered| matches!(&numbered.step, Step::Call { function, .. } if function.ends_with("DoStep")))
                .map(|numbered| numbered.id)
                .collect();
            for id in &steps {
                let terminates = checker.fmi3()
                    && run.of(*id).is_some_and(|of| {
                        of.written.iter().take(3).any(|flag| flag.numbers().first() == Some(&1.0))
                    });
                if run.status(*id).is_none_or(|status| status > 1) || terminates {
                    break;
                }
                good += 1;
            }
            let Some(why) = first_bad else {
                course.points.truncate(good);
                course.end = course.points.last().map_or(start, |point| point.time + point.size);
                return Ok(Ok(course));
            };
            // A model may end its simulation; what comes before is a course.
            let discarded = steps.get(good).and_then(|id| run.status(*id)) == Some(2);
            if discarded && good >= 2 {
                course.points.truncate(good);
                course.end = course.points.last().map_or(start, |point| point.time + point.size);
                return Ok(Ok(course));
            }
            if !discrete && reach == 1.0 {
                return Ok(Err((why, writer.script)));
            }
        }
        return Ok(Ok(course));
    }
    let count = description.states_count().unwrap_or(0);
    let indicators = description.event_indicators.unwrap_or(0);
    let small = if count > 0 {
        (range / 500.0).min(description.step_size.unwrap_or(f64::INFINITY))
    } else {
        range / 10.0
    };
    // First every point, then some on the way to the end of the default experiment, and those with events.
    let (near, far, most) = if count > 0 { (6, range / 160.0, 166) } else { (14, small, 14) };
    // How many updates the first event needs.
    let mut next_event = None;
    for updates in 1..=10 {
        course.updates = updates;
        let mut writer = checker.writer();
        let mut ids = vec![
            writer.make(0, interface),
            writer.enter(0),
            writer.call(0, "ExitInitializationMode", vec![]),
        ];
        let updated = writer.update(0, updates);
        ids.extend(&updated);
        let run = checker.play(&writer.script)?;
        if let Some(why) = ending(&run, &writer.script)
            .or_else(|| refused_one(&writer.script, &run, ids[0]))
            .or_else(|| refused(&writer.script, &run, &ids[1..]))
        {
            return Ok(Err((why, writer.script)));
        }
        match updated.last().and_then(|id| checker.event(&run, *id)) {
            Some(event) if event.again => {}
            Some(event) => {
                next_event = event.next;
                break;
            }
            None => break,
        }
    }
    let mut time = start;
    let mut before: Vec<f64> = Vec::new();
    let mut states: Vec<f64> = Vec::new();
    let mut slopes: Vec<f64> = Vec::new();
    let mut event_now = false;
    let begin = Instant::now();
    for number in 0..most {
        if course.points.len() > 20 || number >= near && begin.elapsed() > 16 * LONG {
            break;
        }
        // The first point is where the integration begins.
        let mut size = match number {
            0 => 0.0,
            _ if number < near => small,
            _ => far,
        };
        if let Some(next) = next_event.filter(|next| *next > time) {
            // Time events are reached at once where nothing is integrated.
            if next <= time + size || count == 0 && number > 0 && number % 3 == 0 {
                size = next - time;
                event_now = true;
            }
        }
        time += size;
        for (state, slope) in states.iter_mut().zip(&slopes) {
            *state += size * slope;
        }
        let mut point = Point {
            time,
            size,
            inputs: input_values(description, if number < near { number } else { near + number / 20 }, false),
            states: states.clone(),
            updates: 0,
        };
        // First without, then with as many updates as an event here needs.
        let mut updates = usize::from(event_now);
        let (run, asked, flags) = loop {
            point.updates = updates;
            let mut writer = checker.writer();
            let mut ids = writer.begin(0, &course);
            for other in &course.points {
                ids.extend(writer.point(0, &course, other));
            }
            let here = writer.point(0, &course, &point);
            ids.extend(&here);
            let asked = [
                (count > 0).then(|| writer.vector(0, "GetContinuousStates", count)),
                (count > 0).then(|| writer.derivatives(0, count)),
                (indicators > 0).then(|| writer.vector(0, "GetEventIndicators", indicators)),
            ];
            let run = checker.play(&writer.script)?;
            if let Some(why) = ending(&run, &writer.script) {
                return Ok(Err((why, writer.script)));
            }
            if let Some(why) = refused(&writer.script, &run, &ids[1..]) {
                if course.points.len() >= 3 {
                    return Ok(Ok(course));
                }
                return Ok(Err((why, writer.script)));
            }
            let completed = here.iter().find(|id| {
                writer.script.iter().any(|numbered| {
                    numbered.id == **id && step_name(&numbered.step).ends_with("CompletedIntegratorStep")
                })
            });
            let flags = completed.and_then(|id| run.of(*id)).map_or([false; 2], |outcome| {
                [0, 1].map(|place| {
                    outcome.written.get(place).is_some_and(|of| of.numbers().first() == Some(&1.0))
                })
            });
            if updates == 0 && flags[0] {
                updates = 1;
                continue;
            }
            if updates > 0 {
                let last = here.iter().rev().find_map(|id| {
                    let named = writer.script.iter().any(|numbered| {
                        numbered.id == *id && step_name(&numbered.step).ends_with("DiscreteStates")
                    });
                    named.then(|| checker.event(&run, *id)).flatten()
                });
                match last {
                    Some(event) if event.again && updates < 10 => {
                        updates += 1;
                        continue;
                    }
                    Some(event) => {
                        next_event = event.next;
                        if event.terminate {
                            return Ok(Ok(course));
                        }
                    }
                    None => {}
                }
            }
            break (run, asked, flags);
        };
        if flags[1] {
            break;
        }
        let vector = |place: usize| {
            asked[place].and_then(|id| run.written(id)).map(Written::numbers).unwrap_or_default()
        };
        (states, slopes) = (vector(0), vector(1));
        let now = vector(2);
        event_now = before.iter().zip(&now).any(|(before, now)| (*before > 0.0) != (*now > 0.0));
        before = now;
        if number < near || number % 20 == 0 || point.updates > 0 {
            course.points.push(point);
            course.end = time;
        }
        if states.iter().chain(&slopes).any(|number| !number.is_finite() || number.abs() > 1e100) {
            break;
        }
    }
    Ok(Ok(course))
}

/// Steps of Co-Simulation.
pub fn steps(description: &Description, start: f64, sizes: &[f64], discrete: bool) -> Vec<Point> {
    let mut time = start;
    let points = sizes.iter().enumerate();
    points
        .map(|(number, &size)| {
            let point =
                Point { time, size, inputs: input_values(description, number, discrete), ..Point::default() };
            time += size;
            point
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::keep;
    use crate::finding::{Finding, Grade};

    /// A graver finding of a name takes the place of the one before, whose evidence is listed.
    #[test]
    fn no_evidence_is_lost() {
        let mut found = Vec::new();
        for (grade, seen) in [
            (Grade::Note, "a"),
            (Grade::Note, "b"),
            (Grade::Violation, "c"),
            (Grade::Fragile, "d"),
            (Grade::Violation, "c"),
            (Grade::Violation, "e"),
            (Grade::Note, "b"),
        ] {
            keep(&mut found, Finding::of_files("topic.name", grade, "", "", seen.to_owned()));
        }
        keep(&mut found, Finding::of_files("topic.other", Grade::Note, "", "", "a".to_owned()));
        let [one, other] = &found[..] else { panic!("{} findings", found.len()) };
        assert_eq!((one.grade, one.seen.as_str()), (Grade::Violation, "c"));
        assert_eq!(one.more, ["a", "b", "d", "e"]);
        assert_eq!((other.grade, other.seen.as_str(), other.more.len()), (Grade::Note, "a", 0));
    }
}
