//! Sequence in which values are passed at a communication point.

use crate::error::{Error, request};
use crate::found::Found;
use crate::selection::Selection;

/// Time at which outputs are passed to the connected inputs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Order {
    /// At each communication point, until all values are consistent. An output is read after the inputs on
    /// which it depends directly, according to the model description. Circular dependencies are an algebraic
    /// loop, which is an error.
    #[default]
    Dependencies,
    /// After a step, all outputs are read; before the next step, all inputs are set, as in FMPy and libcosim.
    /// Outputs that depend directly on inputs lag by one step, so there are no algebraic loops.
    Jacobi,
}

/// Sequence of the exchange: all outputs of a stage are read and all its inputs are set, then the next stage
/// follows.
#[derive(Debug, Default)]
pub(crate) struct Exchange {
    pub order: Order,
    pub stages: Vec<Stage>,
}

/// Outputs and the connected inputs, in the same order.
#[derive(Debug)]
pub(crate) struct Stage {
    pub outputs: Selection,
    pub inputs: Selection,
}

/// A connection: an output of a component and the connected input.
type Ends<'a> = (Found<'a>, Found<'a>);

/// Returns whether the output of a connection depends directly on the input of another one.
fn follows((from, _): &Ends, (_, to): &Ends) -> bool {
    let depends_on = from.variable.depends_on.as_ref();
    to.component == from.component && depends_on.is_none_or(|inputs| inputs.contains(&to.variable.reference))
}

/// Returns the stages, each after the stages that it depends on.
pub(super) fn stages(names: &[(String, String)], ends: &[Ends], order: Order) -> Result<Vec<Stage>, Error> {
    let levels = match order {
        Order::Jacobi => vec![0; ends.len()],
        Order::Dependencies => levels(names, ends)?,
    };
    let count = levels.iter().max().map_or(0, |last| last + 1);
    let stage = |number| {
        let mut stage = Stage { outputs: Selection::default(), inputs: Selection::default() };
        let of_stage = levels.iter().enumerate().filter(|(_, level)| **level == number);
        for (index, _) in of_stage {
            let ((from, to), (output, input)) = (&names[index], ends[index]);
            stage.outputs.push(from, &[output]);
            stage.inputs.push(to, &[input]);
        }
        stage
    };
    Ok((0..count).map(stage).collect())
}

/// Returns the level of each connection: the length of the longest chain of connections that must precede it.
fn levels(names: &[(String, String)], ends: &[Ends]) -> Result<Vec<usize>, Error> {
    let mut levels: Vec<Option<usize>> = vec![None; ends.len()];
    for first in 0..ends.len() {
        level(names, ends, first, &mut levels, &mut Vec::new())?;
    }
    Ok(levels.into_iter().map(Option::unwrap_or_default).collect())
}

fn level(
    names: &[(String, String)],
    ends: &[Ends],
    index: usize,
    levels: &mut [Option<usize>],
    path: &mut Vec<usize>,
) -> Result<usize, Error> {
    if let Some(level) = levels[index] {
        return Ok(level);
    }
    if let Some(begin) = path.iter().position(|before| *before == index) {
        let cycle = path[begin..].iter().rev().map(|index| {
            let (from, to) = &names[*index];
            format!("{from} -> {to}")
        });
        return request(format!(
            "there is an algebraic loop: {}; each of these outputs depends on its FMU's input without a step (or its FMU does \
            not declare its dependencies), so that no order passes all values on. Order Jacobi passes them on a step later",
            cycle.collect::<Vec<_>>().join(", ")
        ));
    }
    path.push(index);
    let mut own = 0;
    for before in (0..ends.len()).filter(|before| follows(&ends[index], &ends[*before])) {
        own = own.max(1 + level(names, ends, before, levels, path)?);
    }
    path.pop();
    levels[index] = Some(own);
    Ok(own)
}
