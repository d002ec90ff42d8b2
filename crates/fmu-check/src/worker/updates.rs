//! Event iteration: an update of the discrete states is repeated while the FMU needs another one, because no importer may leave
//! Event Mode before.

use super::arrays::{Content, Kept};
use crate::call_sequence::Values;

/// Maximum number of updates in an event.
pub const MOST_UPDATES: usize = 100;

/// Flags of an update, in the order of both FMI versions: another update is needed, the simulation ends, the nominal values and the
/// values of the continuous states have changed, the next event time is defined.
const FLAGS: usize = 5;

/// Repeats an update of the discrete states that has returned `status`, until none is needed. The flags that report the end of the
/// simulation or a change remain set if any of the updates has set them.
pub fn iterate(function: &str, mut status: i32, kept: &[Kept], mut again: impl FnMut() -> i32) -> i32 {
    // fmi2EventInfo has five flags of four bytes, FMI 3.0 has an array of a byte for each.
    let flags: Vec<(&Kept, usize)> = match (function, kept) {
        ("fmi2NewDiscreteStates", [info]) => (0..FLAGS).map(|flag| (info, 4 * flag)).collect(),
        ("fmi3UpdateDiscreteStates", [flags @ .., _]) => flags.iter().map(|flag| (flag, 0)).collect(),
        _ => return status,
    };
    let is_output = |kept: &Kept| matches!(kept.content, Content::Output(..));
    if flags.len() != FLAGS || !kept.iter().all(is_output) {
        return status;
    }
    let is_set = |flag: usize| flags[flag].0.array.bytes().get(flags[flag].1).is_some_and(|byte| *byte != 0);
    let mut seen = [false; FLAGS];
    for _ in 1..MOST_UPDATES {
        if status > 1 || !is_set(0) {
            break;
        }
        (1..4).for_each(|flag| seen[flag] |= is_set(flag));
        status = again();
    }
    for flag in (1..4).filter(|flag| status <= 1 && seen[*flag]) {
        flags[flag].0.array.set(flags[flag].1, 1);
    }
    status
}

/// Returns the time of the next event from the results of an update, if it is defined.
pub fn next_event(written: &[Values]) -> Option<f64> {
    match written {
        // fmi2EventInfo: the fifth flag is in the third word, the time is the fourth.
        [Values::Numbers(_, words)] => {
            let [_, _, defined, time] = words[..] else { return None };
            (defined as u32 != 0).then_some(f64::from_bits(time))
        }
        [.., defined, time] => time.numbers().first().copied().filter(|_| defined.numbers() == [1.0]),
        _ => None,
    }
}
