//! Event iteration: an update of the discrete states is repeated while the FMU needs another one, because an importer must not
//! leave Event Mode earlier.

use super::arrays::{Content, PassedArray};
use crate::call_sequence::Values;

/// Maximum number of updates in an event.
pub const MOST_UPDATES: usize = 100;

/// Number of flags of an update. In both FMI versions their order is: another update is needed, the simulation ends, the nominal
/// values have changed, the values of the continuous states have changed, the next event time is defined.
const FLAGS: usize = 5;

/// Repeats an update of the discrete states that has returned `status`, until no further one is needed, one fails, or there were
/// `MOST_UPDATES`; returns the last status. The flags that report the end of the simulation or a change remain set if any of the
/// updates has set them.
pub fn iterate(
    function: &str,
    mut status: i32,
    arrays: &[PassedArray],
    mut again: impl FnMut() -> i32,
) -> i32 {
    // fmi2EventInfo has five flags of four bytes. FMI 3.0 has a separate array of one byte for each flag.
    let flags: Vec<(&PassedArray, usize)> = match (function, arrays) {
        ("fmi2NewDiscreteStates", [info]) => (0..FLAGS).map(|flag| (info, 4 * flag)).collect(),
        ("fmi3UpdateDiscreteStates", [flags @ .., _]) => flags.iter().map(|flag| (flag, 0)).collect(),
        _ => return status,
    };
    let is_output = |array: &PassedArray| matches!(array.content, Content::Output(..));
    if flags.len() != FLAGS || !arrays.iter().all(is_output) {
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

/// Returns the time of the next event from the results of an update; `None` if it is not defined.
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
