//! Writes calls that are repeated only once, because threads repeat whole simulations: a report with every call in full would have
//! tens of thousands of lines.

use super::{Action, CallSequence, Numbered};

/// Number of actions that copies must save; fewer are easier to read in full.
const LEAST_SAVED: usize = 16;

/// Maximum number of actions of a copy.
const LONGEST: usize = 2000;

/// Returns a sequence in which copies of actions are replaced by `Action::Copies`, also within its threads.
pub fn fold(sequence: &[Numbered]) -> CallSequence {
    let mut folded = Vec::new();
    let mut begin = 0;
    while let Some(first) = sequence.get(begin) {
        let rest = &sequence[begin..];
        let longest = LONGEST.min(rest.len() / 2);
        let best = (1..=longest)
            .filter_map(|length| Some((length, copies(rest, length)?)))
            .max_by_key(|(length, times)| length * (times - 1));
        match best {
            Some((length, times)) if length * (times - 1) >= LEAST_SAVED => {
                let copies = Action::Copies(times, rest[length].id - first.id, fold(&rest[..length]));
                folded.push(Numbered { id: first.id, forbidden: false, action: copies });
                begin += length * times;
            }
            _ => {
                let action = match &first.action {
                    Action::Parallel(sequences) => {
                        Action::Parallel(sequences.iter().map(|sequence| fold(sequence)).collect())
                    }
                    action => action.clone(),
                };
                folded.push(Numbered { action, ..first.clone() });
                begin += 1;
            }
        }
    }
    folded
}

/// Returns the number of copies of the first `length` actions at the beginning of a sequence; `None` if there is only one. The
/// numbers of the actions increase by the same difference from copy to copy.
fn copies(sequence: &[Numbered], length: usize) -> Option<usize> {
    let stride = sequence[length].id.checked_sub(sequence[0].id)?;
    let same = |(one, other): &(&Numbered, &Numbered)| {
        Some(other.id) == one.id.checked_add(stride)
            && one.forbidden == other.forbidden
            && one.action == other.action
            && !matches!(one.action, Action::Parallel(_) | Action::Repeat(..))
    };
    let equal = sequence.iter().zip(&sequence[length..]).take_while(same).count();
    (equal >= length).then_some(1 + equal / length)
}

/// Returns a sequence with all copies in full.
pub fn unfold(sequence: &[Numbered]) -> CallSequence {
    let mut all = Vec::new();
    for numbered in sequence {
        match &numbered.action {
            Action::Copies(times, stride, actions) => {
                let actions = unfold(actions);
                for copy in 0..*times {
                    let by = stride.saturating_mul(u32::try_from(copy).unwrap_or(u32::MAX));
                    all.extend(
                        actions
                            .iter()
                            .map(|action| Numbered { id: action.id.saturating_add(by), ..action.clone() }),
                    );
                }
            }
            Action::Parallel(sequences) => {
                let action = Action::Parallel(sequences.iter().map(|sequence| unfold(sequence)).collect());
                all.push(Numbered { action, ..numbered.clone() });
            }
            _ => all.push(numbered.clone()),
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::{fold, unfold};
    use crate::call_sequence::{Action, Numbered};

    /// Checks that repeated simulations on threads are folded, that a single call within them stays, and that nothing is lost.
    #[test]
    fn copies_are_written_once() {
        let numbered = |id: u32, action: Action| Numbered { id, forbidden: false, action };
        let simulation = |id: u32| -> Vec<Numbered> {
            (0..5).map(|index| numbered(id + index, Action::Free(index as usize))).collect()
        };
        let thread: Vec<Numbered> = (0..20)
            .flat_map(|copy| simulation(10 + 5 * copy))
            .chain([numbered(500, Action::Measure)])
            .collect();
        let sequence = vec![numbered(0, Action::Unload), numbered(1, Action::Parallel(vec![thread]))];
        let folded = fold(&sequence);
        let Action::Parallel(threads) = &folded[1].action else { panic!("{folded:?}") };
        let [copies, last] = &threads[0][..] else { panic!("{threads:?}") };
        assert_eq!(copies.action, Action::Copies(20, 5, simulation(10)));
        assert_eq!(last.id, 500);
        assert_eq!(unfold(&folded), sequence);
    }
}
