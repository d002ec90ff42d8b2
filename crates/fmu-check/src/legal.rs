//! Checks that the standard allows all calls of a sequence, except for the calls that are marked as forbidden. So a forbidden
//! call that a check makes by mistake never causes a finding.

use crate::call_sequence::{Action, Arg, Make, NULL_INSTANCE, Numbered};
use crate::description::Description;
use crate::values::is_other_time;
use fmi_abi::calls::signature;
use fmi_abi::{Interface, Mode, Standard};
use std::collections::HashMap;

/// State of an instance.
#[derive(Clone, Copy)]
struct State {
    interface: Interface,
    mode: Mode,
    time: f64,
    /// Values of `eventModeUsed` and `earlyReturnAllowed`.
    event_mode: bool,
    early_return: bool,
    /// Whether fmi2SetupExperiment was called; true for FMI 3.0, which does not have it.
    set_up: bool,
    /// Whether the discrete states were updated since Event Mode was entered.
    updated: bool,
}

/// Returns the number of the first action that the standard does not allow. Actions that are marked as forbidden are skipped.
pub fn first_illegal(description: &Description, sequence: &[Numbered]) -> Option<u32> {
    walk(description, sequence, &mut Objects::default())
}

/// States of the instances while the actions of a call sequence are added one after another.
#[derive(Default)]
pub struct Modes(Objects);

impl Modes {
    /// Updates the states for the next action, unless that action repeats other actions or starts threads.
    pub fn add(&mut self, description: &Description, next: &Numbered) {
        if !matches!(next.action, Action::Repeat(..) | Action::Parallel(_)) {
            walk(description, std::slice::from_ref(next), &mut self.0);
        }
    }

    /// Returns whether an instance is in Initialization Mode.
    pub fn is_initializing(&self, instance: usize) -> bool {
        self.0.instances.get(&instance).is_some_and(|state| state.mode == Mode::Initialization)
    }
}

/// Index of the instance that saved a state, and the state.
type SavedState = (usize, State);

/// States of the instances, saved states and serialized states, by index.
#[derive(Default)]
struct Objects {
    instances: HashMap<usize, State>,
    slots: HashMap<usize, SavedState>,
    bytes: HashMap<usize, State>,
}

/// Returns the number of the first illegal action, and updates the objects up to and including that action.
fn walk(description: &Description, sequence: &[Numbered], objects: &mut Objects) -> Option<u32> {
    for Numbered { action, id, .. } in sequence.iter().filter(|numbered| !numbered.forbidden) {
        let is_legal = match action {
            Action::Make(index, make) => objects.make(description, *index, make),
            Action::Free(index) if *index == NULL_INSTANCE => true,
            Action::Free(index) => {
                objects.slots.retain(|_, (owner, _)| owner != index);
                objects.instances.remove(index).is_some()
            }
            Action::Call { instance, function, args } => {
                instance.is_some_and(|index| objects.call(description.standard, index, function, args))
            }
            // If the actions are allowed twice in a row, they are allowed any number of times.
            Action::Repeat(_, actions) => (0..2).all(|_| walk(description, actions, objects).is_none()),
            // Threads that run at the same time do not share instances, so one sequence may be checked after another.
            Action::Parallel(sequences) => {
                sequences.iter().all(|sequence| walk(description, sequence, objects).is_none())
            }
            Action::FreshProcess => {
                objects.instances.clear();
                objects.slots.clear();
                true
            }
            Action::Integrate(index, how) => objects.instances.get_mut(index).is_some_and(|state| {
                let is_here = !is_other_time(how.begin, state.time);
                state.time = how.end;
                is_here && state.mode == Mode::ContinuousTime
            }),
            Action::Unload | Action::Quit => objects.instances.is_empty(),
            Action::Version(_) | Action::Measure | Action::Copies(..) => true,
            Action::Elsewhere(_) | Action::Environment => true,
        };
        if !is_legal {
            return Some(*id);
        }
    }
    None
}

impl Objects {
    /// Adds an instance; returns whether it may be made.
    fn make(&mut self, description: &Description, index: usize, make: &Make) -> bool {
        let interface = if make.co_simulation { Interface::CoSimulation } else { Interface::ModelExchange };
        let once = description
            .offer(interface)
            .is_some_and(|offer| offer.can(&["canBeInstantiatedOnlyOncePerProcess"]));
        let is_free = !self.instances.contains_key(&index) && (!once || self.instances.is_empty());
        let state = State {
            interface,
            mode: Mode::Instantiated,
            time: 0.0,
            event_mode: make.event_mode,
            early_return: make.early_return,
            set_up: description.standard == Standard::Fmi3,
            updated: false,
        };
        self.instances.insert(index, state);
        is_free
    }

    /// Updates the state of an instance for a call; returns whether the call is allowed.
    fn call(&mut self, standard: Standard, index: usize, function: &str, args: &[Arg]) -> bool {
        let Some(state) = self.instances.get_mut(&index) else { return false };
        let is_allowed = signature(function)
            .is_some_and(|signature| signature.rule.standard.contains(standard, state.interface, state.mode));
        let is_legal = match function[4..].to_lowercase().contains("fmustate") {
            true => saved_states(&mut self.slots, &mut self.bytes, index, state, function, args),
            false => state.call(standard, function, args),
        };
        is_allowed && is_legal
    }
}

impl State {
    /// Updates the state for a call; returns whether its arguments are allowed and the calls that it requires have been made
    /// before.
    fn call(&mut self, standard: Standard, function: &str, args: &[Arg]) -> bool {
        let real = |index: usize| match args.get(index) {
            Some(Arg::Real(bits)) => f64::from_bits(*bits),
            _ => 0.0,
        };
        match &function[4..] {
            "SetupExperiment" => {
                self.set_up = true;
                self.time = real(2);
            }
            "EnterInitializationMode" => {
                self.mode = Mode::Initialization;
                if standard == Standard::Fmi3 {
                    self.time = real(2);
                }
                return self.set_up;
            }
            "ExitInitializationMode" => {
                self.updated = false;
                let has_event = self.interface == Interface::ModelExchange || self.event_mode;
                self.mode = if has_event { Mode::Event } else { Mode::StepComplete };
            }
            "UpdateDiscreteStates" | "NewDiscreteStates" => self.updated = true,
            "EnterEventMode" => {
                self.updated = false;
                self.mode = Mode::Event;
            }
            "EnterContinuousTimeMode" => {
                self.mode = Mode::ContinuousTime;
                return self.updated;
            }
            "EnterStepMode" => {
                self.mode = Mode::StepComplete;
                return self.updated;
            }
            "DoStep" => {
                // A step that returns early ends at a time that is not known before the run.
                let here = !is_other_time(real(0), self.time) || self.early_return && real(0) < self.time;
                self.time = real(0) + real(1);
                return here && real(1) > 0.0;
            }
            "SetTime" => {
                let is_later = real(0) >= self.time || !is_other_time(real(0), self.time);
                self.time = real(0);
                return is_later;
            }
            "Terminate" => self.mode = Mode::Terminated,
            "Reset" => {
                self.mode = Mode::Instantiated;
                self.set_up = standard == Standard::Fmi3;
            }
            _ => {}
        }
        true
    }
}

/// Updates the saved and serialized states for a call; returns whether the states that it uses exist, and whether a state that it
/// restores was saved by the same instance.
fn saved_states(
    slots: &mut HashMap<usize, SavedState>,
    bytes: &mut HashMap<usize, State>,
    index: usize,
    state: &mut State,
    function: &str,
    args: &[Arg],
) -> bool {
    match (function[4..].to_lowercase().as_str(), args.first()) {
        ("getfmustate", Some(Arg::StateOut(slot))) => {
            slots.insert(*slot, (index, *state));
        }
        ("setfmustate", Some(Arg::State(slot))) => match slots.get(slot) {
            Some((owner, saved)) if *owner == index => *state = *saved,
            _ => return false,
        },
        ("freefmustate", Some(Arg::StateOut(slot))) => drop(slots.remove(slot)),
        ("serializedfmustatesize" | "serializefmustate", Some(Arg::State(slot))) => {
            let Some((_, saved)) = slots.get(slot) else { return false };
            if let Some(Arg::SavedOut(to)) = args.get(1) {
                bytes.insert(*to, *saved);
            }
        }
        ("deserializefmustate", Some(Arg::Saved(from))) => match (bytes.get(from), args.get(2)) {
            (Some(saved), Some(Arg::StateOut(slot))) => drop(slots.insert(*slot, (index, *saved))),
            _ => return false,
        },
        ("getfmustate" | "freefmustate", _) => {}
        _ => return false,
    }
    true
}
