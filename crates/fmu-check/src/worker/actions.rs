//! Executes the actions of a call sequence.

use super::executor::{Executor, Instance, THREADS};
use super::job::{EVALUATED, EXECUTED, Last};
use super::logger::{messages, text_at};
use super::memory::{self, in_fmu};
use super::work::wait_for_debugger;
use super::{integrate, locked, measure};
use crate::call_sequence::{Action, NULL_INSTANCE, Numbered, Outcome, action_name};
use fmi_abi::c_types::c_void;
use std::collections::HashMap;
use std::sync::Barrier;
use std::sync::atomic::Ordering;
use std::time::Instant;

impl Executor {
    /// Executes actions. Writes their outcomes to the file if `report` is set, otherwise returns them. Of repeated actions, only the
    /// outcomes of the last repetition are written.
    pub fn execute(&self, sequence: &[Numbered], report: bool) -> Vec<Outcome> {
        let mut outcomes = Vec::new();
        for numbered in sequence {
            let mut outcome = Outcome { id: numbered.id, ..Outcome::default() };
            if report && self.stop_before == Some(numbered.id) {
                wait_for_debugger(&action_name(&numbered.action));
            }
            match &numbered.action {
                Action::Repeat(times, actions) => {
                    let begin = Instant::now();
                    memory::KEEP.store(true, Ordering::Relaxed);
                    let (mut done, mut last) = (0, Vec::new());
                    // Until there are enough repetitions for an evaluation, four times as much time is allowed, because the
                    // machine may be busy.
                    let patience = |done: usize| if done < EVALUATED { 4.0 } else { 1.0 };
                    let seconds = || begin.elapsed().as_secs_f64();
                    while done < *times && seconds() < patience(done) * self.setting.repetitions {
                        last = self.execute(actions, false);
                        done += 1;
                        if last.iter().any(|outcome| outcome.status.is_some_and(|status| status > 2)) {
                            break;
                        }
                    }
                    memory::KEEP.store(false, Ordering::Relaxed);
                    outcome.measured =
                        Some(crate::call_sequence::Measured { times: done, ..Default::default() });
                    if report {
                        last.iter().for_each(|outcome| self.write(outcome));
                    }
                }
                Action::Parallel(sequences) => {
                    memory::KEEP.store(true, Ordering::Relaxed);
                    THREADS.store(true, Ordering::Relaxed);
                    // On a busy machine, a thread could otherwise end before the next one begins.
                    let begin = Barrier::new(sequences.len());
                    std::thread::scope(|scope| {
                        for sequence in sequences {
                            scope.spawn(|| {
                                begin.wait();
                                self.execute(sequence, report);
                            });
                        }
                    });
                    THREADS.store(false, Ordering::Relaxed);
                    memory::KEEP.store(false, Ordering::Relaxed);
                }
                action => self.execute_action(action, &mut outcome),
            }
            if report {
                self.write(&outcome);
            } else {
                outcomes.push(outcome);
            }
        }
        outcomes
    }

    /// Executes an action that contains no other actions.
    fn execute_action(&self, action: &Action, outcome: &mut Outcome) {
        match action {
            Action::Make(index, make) => self.make(*index, make, outcome),
            Action::Free(index) => {
                let null = (*index == NULL_INSTANCE).then_some(Instance {
                    handle: 0,
                    environment: 0,
                    co_simulation: self.setting.libraries[0].is_some(),
                    next_event: f64::INFINITY,
                    _callbacks: None,
                });
                let Some(instance) = null.or_else(|| locked(&self.instances).remove(index)) else { return };
                let name = self.named("FreeInstance");
                let functions = self.find(instance.co_simulation, &name);
                outcome.missing = functions.is_none();
                outcome.status = functions.map(|functions| {
                    // SAFETY: the handle is NULL, or an instance that has not been freed.
                    in_fmu(|| unsafe { functions.free(instance.handle as *mut c_void) });
                    0
                });
                (outcome.log, outcome.strays) = messages(instance.environment);
            }
            Action::Version(name) => {
                let functions = self.find(self.setting.libraries[0].is_some(), name);
                outcome.missing = functions.is_none();
                // SAFETY: these functions have no arguments and return a string.
                outcome.text =
                    functions.and_then(|functions| unsafe { text_at(in_fmu(|| functions.version(name))) });
            }
            Action::Call { instance, function, args } => self.call(*instance, function, args, outcome),
            Action::Integrate(instance, how) => {
                memory::KEEP.store(true, Ordering::Relaxed);
                integrate::integrate(self, *instance, how, outcome);
                memory::KEEP.store(false, Ordering::Relaxed);
            }
            Action::Measure => outcome.measured = Some(measure::now()),
            Action::Unload => {
                let mut loaded: Vec<_> =
                    locked(&self.libraries).iter_mut().filter_map(Option::take).collect();
                loaded.dedup_by_key(|library| std::ptr::from_ref(*library));
                for library in loaded {
                    // SAFETY: made by Box::leak, and nothing else refers to it.
                    in_fmu(|| drop(unsafe { Box::from_raw(std::ptr::from_ref(library).cast_mut()) }));
                }
                // This output crashes if the library has set a buffer of the standard output that was unloaded with it.
                #[cfg(unix)]
                // SAFETY: writes an empty line, and the buffers of the C library.
                in_fmu(|| unsafe {
                    libc::puts(c"".as_ptr());
                    libc::fflush(std::ptr::null_mut());
                });
            }
            Action::Quit => {
                self.write(&Last { bytes: HashMap::new() });
                in_fmu(|| std::process::exit(EXECUTED))
            }
            Action::Repeat(..)
            | Action::Parallel(_)
            | Action::FreshProcess
            | Action::Elsewhere(_)
            | Action::Environment
            | Action::Copies(..) => {}
        }
    }
}
