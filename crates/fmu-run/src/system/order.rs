//! Sequence in which values are passed at a communication point.

use super::{Found, Order, Stage, Whole};
use crate::error::{Error, request};
use crate::selection::Selection;

/// A connection from an output of a component to an input.
struct Wire<'a> {
    from: Found<'a>,
    to: Found<'a>,
}

impl Wire<'_> {
    /// Returns whether the output of this connection depends directly on the input of the other one.
    fn follows(&self, other: &Wire) -> bool {
        let depends_on = self.from.of.depends_on.as_ref();
        other.to.part == self.from.part
            && depends_on.is_none_or(|inputs| inputs.contains(&other.to.of.reference))
    }
}

/// Returns the stages, each after the stages that it depends on.
pub(super) fn stages(whole: &Whole, order: Order) -> Result<Vec<Stage>, Error> {
    let end = |name: &str| whole.find(name).map(|found| found[0]);
    let wires = whole.connections.iter().map(|(from, to)| Ok(Wire { from: end(from)?, to: end(to)? }));
    let wires: Vec<Wire> = wires.collect::<Result<_, Error>>()?;
    let levels = match order {
        Order::Jacobi => vec![0; wires.len()],
        Order::Dependencies => levels(whole, &wires)?,
    };
    let count = levels.iter().max().map_or(0, |last| last + 1);
    let stage = |number| {
        let mut stage = Stage { outputs: Selection::default(), inputs: Selection::default() };
        let of_stage = levels.iter().enumerate().filter(|(_, level)| **level == number);
        for (place, _) in of_stage {
            let (from, to) = &whole.connections[place];
            stage.outputs.push(from, &[wires[place].from]);
            stage.inputs.push(to, &[wires[place].to]);
        }
        stage
    };
    Ok((0..count).map(stage).collect())
}

/// Returns the level of each connection: the length of the longest chain of connections that must precede it.
fn levels(whole: &Whole, wires: &[Wire]) -> Result<Vec<usize>, Error> {
    let mut levels: Vec<Option<usize>> = vec![None; wires.len()];
    for first in 0..wires.len() {
        level(whole, wires, first, &mut levels, &mut Vec::new())?;
    }
    Ok(levels.into_iter().map(Option::unwrap_or_default).collect())
}

fn level(
    whole: &Whole,
    wires: &[Wire],
    place: usize,
    levels: &mut [Option<usize>],
    path: &mut Vec<usize>,
) -> Result<usize, Error> {
    if let Some(level) = levels[place] {
        return Ok(level);
    }
    if let Some(begin) = path.iter().position(|before| *before == place) {
        let names = path[begin..].iter().rev().map(|place| {
            let (from, to) = &whole.connections[*place];
            format!("{from} -> {to}")
        });
        return request(format!(
            "there is an algebraic loop: {}; each of these outputs depends on its FMU's input without a step (or its FMU does \
            not say on what it depends), so that no order passes all values on. Order Jacobi passes them on a step later",
            names.collect::<Vec<_>>().join(", ")
        ));
    }
    path.push(place);
    let mut own = 0;
    for before in (0..wires.len()).filter(|before| wires[place].follows(&wires[*before])) {
        own = own.max(1 + level(whole, wires, before, levels, path)?);
    }
    path.pop();
    levels[place] = Some(own);
    Ok(own)
}
