//! Whether a sequence keeps to the standard: a finding must not come from a call that may not be made there.

use crate::call_sequence::{Arg, NOBODY, Numbered, Step};
use crate::description::Description;
use fmi_abi::calls::signature;
use fmi_abi::{Interface, Mode, Standard};
use std::collections::HashMap;

#[derive(Clone, Copy)]
struct State {
    interface: Interface,
    mode: Mode,
    time: f64,
    event_mode: bool,
    early_return: bool,
    set_up: bool,
    updated: bool,
}

/// The first call that may not be made where it is, by its number; forbidden calls apart, which change nothing.
pub fn first_illegal(description: &Description, sequence: &[Numbered]) -> Option<u32> {
    walk(description, sequence, &mut Trajectory::default())
}

/// State of all instances, saved states and byte buffers.
#[derive(Default)]
struct Trajectory {
    instances: HashMap<usize, State>,
    slots: HashMap<usize, (usize, State)>,
    bytes: HashMap<usize, State>,
}

fn walk(description: &Description, sequence: &[Numbered], trajectory: &mut Trajectory) -> Option<u32> {
    let standard = description.standard;
    for Numbered { id, forbidden, step } in sequence {
        let Trajectory { instances, slots, bytes } = &mut *trajectory;
        if *forbidden {
            continue;
        }
        let good = match step {
            Step::Make(index, make) => {
                let interface =
                    if make.co_simulation { Interface::CoSimulation } else { Interface::ModelExchange };
                let once = description
                    .offer(interface)
                    .is_some_and(|offer| offer.can(&["canBeInstantiatedOnlyOncePerProcess"]));
                let state = State {
                    interface,
                    mode: Mode::Instantiated,
                    time: 0.0,
                    event_mode: make.event_mode,
                    early_return: make.early_return,
                    set_up: standard == Standard::Fmi3,
                    updated: false,
                };
                let free = !instances.contains_key(index) && (!once || instances.is_empty());
                instances.insert(*index, state);
                free
            }
            Step::Free(index) if *index == NOBODY => true,
            Step::Free(index) => {
                slots.retain(|_, (owner, _)| owner != index);
                instances.remove(index).is_some()
            }
            Step::Call { of, function, args } => {
                let Some((index, state)) = of.and_then(|index| Some((index, instances.get_mut(&index)?)))
                else {
                    return Some(*id);
                };
                let allowed = signature(function)
                    .is_some_and(|of| of.rule.standard.contain(standard, state.interface, state.mode));
                let real = |index: usize| match args.get(index) {
                    Some(Arg::Real(bits)) => f64::from_bits(*bits),
                    _ => 0.0,
                };
                let mut good = allowed;
                match &function[4..] {
                    "SetupExperiment" => {
                        state.set_up = true;
                        state.time = real(2);
                    }
                    "EnterInitializationMode" => {
                        good &= state.set_up;
                        state.mode = Mode::Initialization;
                        if standard == Standard::Fmi3 {
                            state.time = real(2);
                        }
                    }
                    "ExitInitializationMode" => {
                        state.updated = false;
                        state.mode = if state.interface == Interface::ModelExchange || state.event_mode {
                            Mode::Event
                        } else {
                            Mode::StepComplete
                        };
                    }
                    "UpdateDiscreteStates" | "NewDiscreteStates" => state.updated = true,
                    "EnterEventMode" => {
                        state.updated = false;
                        state.mode = Mode::Event;
                    }
                    "EnterContinuousTimeMode" => {
                        good &= state.updated;
                        state.mode = Mode::ContinuousTime;
                    }
                    "EnterStepMode" => {
                        good &= state.updated;
                        state.mode = Mode::StepComplete;
                    }
                    "DoStep" => {
                        let off = real(0) - state.time;
                        // After an early return, only the run knows the time.
                        let here =
                            off.abs() <= 1e-9 * (1.0 + state.time.abs()) || state.early_return && off < 0.0;
                        good &= here && real(1) > 0.0;
                        state.time = real(0) + real(1);
                    }
                    "SetTime" => {
                        good &= real(0) >= state.time - 1e-12;
                        state.time = real(0);
                    }
                    "Terminate" => state.mode = Mode::Terminated,
                    "Reset" => {
                        state.mode = Mode::Instantiated;
                        state.set_up = standard == Standard::Fmi3;
                    }
                    "GetFMUstate" | "GetFMUState" => {
                        if let Some(Arg::StateOut(slot)) = args.first() {
                            slots.insert(*slot, (index, *state));
                        }
                    }
                    "SetFMUstate" | "SetFMUState" => match args.first() {
                        Some(Arg::State(slot)) => match slots.get(slot) {
                            Some((owner, saved)) if *owner == index => *state = *saved,
                            _ => good = false,
                        },
                        _ => good = false,
                    },
                    "FreeFMUstate" | "FreeFMUState" => {
                        if let Some(Arg::StateOut(slot)) = args.first() {
                            slots.remove(slot);
                        }
                    }
                    "SerializedFMUstateSize"
                    | "SerializedFMUStateSize"
                    | "SerializeFMUstate"
                    | "SerializeFMUState" => match args.first() {
                        Some(Arg::State(slot)) if slots.contains_key(slot) => {
                            if let Some(Arg::SavedOut(to)) = args.get(1) {
                                bytes.insert(*to, slots[slot].1);
                            }
                        }
                        _ => good = false,
                    },
                    "DeSerializeFMUstate" | "DeserializeFMUState" => match (args.first(), args.get(2)) {
                        (Some(Arg::Saved(from)), Some(Arg::StateOut(slot))) if bytes.contains_key(from) => {
                            slots.insert(*slot, (index, bytes[from]));
                        }
                        _ => good = false,
                    },
                    _ => {}
                }
                good
            }
            // A call that is allowed twice is allowed any number of times.
            Step::Repeat(_, steps) => {
                walk(description, steps, trajectory).is_none()
                    && walk(description, steps, trajectory).is_none()
            }
            Step::Parallel(sequences) => {
                // Each thread has instances of its own.
                sequences.iter().all(|sequence| first_illegal(description, sequence).is_none())
            }
            Step::FreshProcess => {
                instances.clear();
                slots.clear();
                true
            }
            Step::Unload | Step::Quit => instances.is_empty(),
            Step::Version(_) | Step::Measure => true,
        };
        if !good {
            return Some(*id);
        }
    }
    None
}
