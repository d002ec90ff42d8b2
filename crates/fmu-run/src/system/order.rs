//! Determines the sequence in which values are passed from outputs to inputs at a communication point.

use crate::change::Change;
use crate::description::Dependencies;
use crate::error::{Error, request};
use crate::instance::Instance;
use crate::lookup::Found;
use crate::selection::Selection;
use fmi_abi::client::Rejection;
use fmi_abi::shown;
use std::collections::HashMap;
use std::ops::Range;

/// Determines when outputs are passed to the connected inputs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Order {
    /// Outputs are passed at each communication point, so that all values are consistent. An output is read after the inputs on which
    /// it depends directly, according to the model description, have been set. Circular dependencies are an algebraic loop, which is
    /// an error.
    #[default]
    Dependencies,
    /// All outputs are read after a step, and all inputs are set before the next step, as in FMPy and libcosim. Outputs that depend
    /// directly on inputs lag by one step, so there are no algebraic loops.
    Jacobi,
}

/// Stages of the data exchange. All outputs of a stage are read and all of its inputs are set before the next stage begins.
#[derive(Debug, Default)]
pub(crate) struct Exchange {
    pub order: Order,
    pub stages: Vec<Stage>,
}

/// Outputs and the inputs that are connected to them, in the same order.
#[derive(Debug, Default)]
pub(crate) struct Stage {
    pub outputs: Selection,
    pub inputs: Selection,
    /// Changes of values between an output and its input, each with its index in a row.
    changes: Vec<(usize, Change)>,
}

impl Stage {
    /// Reads the outputs, and changes the values for the inputs.
    pub fn get(
        &self,
        components: &mut [Instance],
        buffer: &mut Vec<f64>,
        row: &mut [f64],
    ) -> Result<(), Rejection> {
        self.outputs.get(components, buffer, row)?;
        for (index, change) in &self.changes {
            row[*index] = change.apply(row[*index]);
        }
        Ok(())
    }
}

/// A connection: an output of a component and the connected input.
type Ends<'a> = (Found<'a>, Found<'a>);

/// Returns the stages, sorted so that each stage follows the stages on which it depends. `changes` has a change for each connection, or
/// is empty.
pub(super) fn stages(
    names: &[(String, String)],
    ends: &[Ends],
    changes: &[Change],
    order: Order,
) -> Result<Vec<Stage>, Error> {
    let levels = match order {
        Order::Jacobi => vec![0; ends.len()],
        Order::Dependencies => levels(names, ends)?,
    };
    let count = levels.iter().max().map_or(0, |last| last + 1);
    let mut stages: Vec<Stage> = (0..count).map(|_| Stage::default()).collect();
    // For each stage, the groups of its outputs and of its inputs, see `Selection::push_to`.
    let mut known: Vec<[HashMap<_, _>; 2]> = (0..count).map(|_| Default::default()).collect();
    for (index, (((from, to), (output, input)), level)) in names.iter().zip(ends).zip(levels).enumerate() {
        let [of_outputs, of_inputs] = &mut known[level];
        if let Some(change) = changes.get(index).filter(|change| !change.is_identity()) {
            let number = stages[level].outputs.len();
            stages[level].changes.push((number, change.clone()));
        }
        stages[level].outputs.push_to(of_outputs, from, &[*output]);
        stages[level].inputs.push_to(of_inputs, to, &[*input]);
    }
    Ok(stages)
}

/// The direct dependencies of outputs of a component. Outputs with the same dependencies share a set.
struct Set {
    /// Connections to the inputs on which the outputs depend.
    before: Vec<usize>,
    /// Length of the longest chain of connections whose values must be passed before the outputs are read; `None` until it is
    /// known.
    level: Option<usize>,
    /// Whether the search for the level has begun but not ended.
    is_open: bool,
}

/// Returns the index of the set for the output of each connection, and the sets.
fn sets(ends: &[Ends]) -> (Vec<usize>, Vec<Set>) {
    let mut inputs: HashMap<usize, Vec<(u64, usize)>> = HashMap::new();
    for (index, (_, to)) in ends.iter().enumerate() {
        inputs.entry(to.component).or_default().push((to.variable.key(), index));
    }
    inputs.values_mut().for_each(|inputs| inputs.sort_unstable());
    let mut known: HashMap<(usize, Option<*const Dependencies>), usize> = HashMap::new();
    let mut sets = Vec::new();
    let set = |(from, _): &Ends| {
        let depends_on = from.variable.depends_on.as_ref();
        *known.entry((from.component, depends_on.map(std::ptr::from_ref))).or_insert_with(|| {
            let inputs = inputs.get(&from.component).map_or(&[][..], Vec::as_slice);
            let before = match depends_on {
                None => inputs.iter().map(|(_, index)| *index).collect(),
                Some(depends_on) => {
                    depends_on.ranges().iter().flat_map(|range| within(inputs, range)).collect()
                }
            };
            sets.push(Set { before, level: None, is_open: false });
            sets.len() - 1
        })
    };
    (ends.iter().map(set).collect(), sets)
}

/// Returns the connections to inputs whose keys are in the range. `inputs` is sorted.
fn within<'a>(inputs: &'a [(u64, usize)], range: &Range<u64>) -> impl Iterator<Item = usize> + use<'a> {
    let [begin, end] = [range.start, range.end].map(|limit| inputs.partition_point(|(key, _)| *key < limit));
    inputs[begin..end].iter().map(|(_, index)| *index)
}

/// Returns the level of each connection: the length of the longest chain of connections whose values must be passed before its own
/// value. Searches depth first, without recursion, because chains may be long.
fn levels(names: &[(String, String)], ends: &[Ends]) -> Result<Vec<usize>, Error> {
    let (set_of, mut sets) = sets(ends);
    for first in 0..ends.len() {
        // The connections on the current path, each with the number of its predecessors that have been visited.
        let mut path = vec![(first, 0)];
        while let Some((connection, visited)) = path.last_mut() {
            let set = &mut sets[set_of[*connection]];
            if set.level.is_some() {
                path.pop();
                continue;
            }
            set.is_open = true;
            if let Some(before) = set.before.get(*visited).copied() {
                *visited += 1;
                let other = &sets[set_of[before]];
                if other.is_open {
                    let begin =
                        path.iter().position(|(open, _)| set_of[*open] == set_of[before]).unwrap_or_default();
                    let cycle = path[begin + 1..].iter().rev().map(|(open, _)| *open).chain([before]);
                    return request(algebraic_loop(names, &cycle.collect::<Vec<_>>()));
                }
                if other.level.is_none() {
                    path.push((before, 0));
                }
                continue;
            }
            let index = set_of[*connection];
            let before = sets[index]
                .before
                .iter()
                .map(|before| sets[set_of[*before]].level.map_or(1, |level| level + 1));
            let level = before.max().unwrap_or(0);
            (sets[index].level, sets[index].is_open) = (Some(level), false);
            path.pop();
        }
    }
    Ok(set_of.iter().map(|set| sets[*set].level.unwrap_or_default()).collect())
}

/// Returns the message for a cycle of connections.
fn algebraic_loop(names: &[(String, String)], cycle: &[usize]) -> String {
    /// Maximum number of connections in the message.
    const LISTED: usize = 10;
    let listed = cycle
        .iter()
        .take(LISTED)
        .map(|index| format!("{} -> {}", shown(&names[*index].0), shown(&names[*index].1)));
    let more = match cycle.len().saturating_sub(LISTED) {
        0 => String::new(),
        more => format!(", and {more} more"),
    };
    format!(
        "there is an algebraic loop: {}{more}; each of these outputs depends on its FMU's input without a step (or its FMU does \
        not declare its dependencies), so that no order passes all values on. Order Jacobi passes them on a step later",
        listed.collect::<Vec<_>>().join(", ")
    )
}
