//! Writes calls that are repeated only once, because threads repeat whole simulations: a report with every call in full would have
//! tens of thousands of lines.

use super::{CallSequence, Numbered, Step};

/// Number of steps that copies must save; fewer are easier to read in full.
const LEAST_SAVED: usize = 16;

/// Maximum number of steps of a copy.
const LONGEST: usize = 2000;

/// Returns a sequence in which copies of steps are replaced by `Step::Copies`, also within its threads.
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
                let copies = Step::Copies(times, rest[length].id - first.id, fold(&rest[..length]));
                folded.push(Numbered { id: first.id, forbidden: false, step: copies });
                begin += length * times;
            }
            _ => {
                let step = match &first.step {
                    Step::Parallel(sequences) => {
                        Step::Parallel(sequences.iter().map(|sequence| fold(sequence)).collect())
                    }
                    step => step.clone(),
                };
                folded.push(Numbered { step, ..first.clone() });
                begin += 1;
            }
        }
    }
    folded
}

/// Returns the number of copies of the first `length` steps at the beginning of a sequence; `None` if there is only one. The
/// numbers of the steps increase by the same difference from copy to copy.
fn copies(sequence: &[Numbered], length: usize) -> Option<usize> {
    let stride = sequence[length].id.checked_sub(sequence[0].id)?;
    let same = |(one, other): &(&Numbered, &Numbered)| {
        Some(other.id) == one.id.checked_add(stride)
            && one.forbidden == other.forbidden
            && one.step == other.step
            && !matches!(one.step, Step::Parallel(_) | Step::Repeat(..))
    };
    let equal = sequence.iter().zip(&sequence[length..]).take_while(same).count();
    (equal >= length).then_some(1 + equal / length)
}

/// Returns a sequence with all copies in full.
pub fn unfold(sequence: &[Numbered]) -> CallSequence {
    let mut all = Vec::new();
    for numbered in sequence {
        match &numbered.step {
            Step::Copies(times, stride, steps) => {
                let steps = unfold(steps);
                for copy in 0..*times {
                    let by = stride.saturating_mul(u32::try_from(copy).unwrap_or(u32::MAX));
                    all.extend(
                        steps.iter().map(|step| Numbered { id: step.id.saturating_add(by), ..step.clone() }),
                    );
                }
            }
            Step::Parallel(sequences) => {
                let step = Step::Parallel(sequences.iter().map(|sequence| unfold(sequence)).collect());
                all.push(Numbered { step, ..numbered.clone() });
            }
            _ => all.push(numbered.clone()),
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::{fold, unfold};
    use crate::call_sequence::{Numbered, Step};

    /// Checks that repeated simulations on threads are folded, that a single call within them stays, and that nothing is lost.
    #[test]
    fn copies_are_written_once() {
        let numbered = |id: u32, step: Step| Numbered { id, forbidden: false, step };
        let simulation = |id: u32| -> Vec<Numbered> {
            (0..5).map(|index| numbered(id + index, Step::Free(index as usize))).collect()
        };
        let thread: Vec<Numbered> = (0..20)
            .flat_map(|copy| simulation(10 + 5 * copy))
            .chain([numbered(500, Step::Measure)])
            .collect();
        let sequence = vec![numbered(0, Step::Unload), numbered(1, Step::Parallel(vec![thread]))];
        let folded = fold(&sequence);
        let Step::Parallel(threads) = &folded[1].step else { panic!("{folded:?}") };
        let [copies, last] = &threads[0][..] else { panic!("{threads:?}") };
        assert_eq!(copies.step, Step::Copies(20, 5, simulation(10)));
        assert_eq!(last.id, 500);
        assert_eq!(unfold(&folded), sequence);
    }
}
