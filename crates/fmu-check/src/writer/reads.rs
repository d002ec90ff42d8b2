//! Calls that read variables, and comparisons of their results.

use crate::call_sequence::{Run, Values};
use crate::description::Description;
use crate::finding::status_name;
use fmi_abi::Causality;

/// Call that reads variables or a vector. `variables` has the index and the number of values of each variable; it is empty for a
/// vector.
#[derive(Clone, Debug)]
pub struct Read {
    pub id: u32,
    pub variables: Vec<(usize, usize)>,
}

impl Read {
    /// Returns each variable with the index of its first value and the number of its values.
    pub fn parts(&self) -> impl Iterator<Item = (usize, usize, usize)> {
        self.variables.iter().scan(0, |end, (variable, size)| {
            *end += size;
            Some((*variable, *end - size, *size))
        })
    }
}

/// Maximum number of variables that most checks read.
pub const MAX_READ: usize = 1000;

/// Returns the indices of at most `max_count` variables to read. Clocks and variables of unknown size are left out, and so are
/// clocked variables, because they can only be read while their clock is active (section 2.2.7 of FMI 3.0.2). If there are more
/// variables, at most half of the sample are inputs, outputs, derivatives and the independent variable. In both parts of the
/// sample, the variables are equally spaced.
pub fn sample(description: &Description, max_count: usize) -> Vec<usize> {
    let known = |index: &usize| {
        let variable = &description.variables[*index];
        variable.base.is_some() && variable.size.is_some() && !variable.clocked
    };
    let all: Vec<usize> = (0..description.variables.len()).filter(known).collect();
    if all.len() <= max_count {
        return all;
    }
    let first = |index: &usize| {
        let variable = &description.variables[*index];
        [Causality::Input, Causality::Output, Causality::Independent].contains(&variable.causality)
            || variable.derivative_of.is_some()
    };
    let (first, others): (Vec<usize>, Vec<usize>) = all.into_iter().partition(first);
    let evenly = |indices: Vec<usize>, count: usize| -> Vec<usize> {
        let step = indices.len().div_ceil(count.max(1)).max(1);
        indices.into_iter().step_by(step).collect()
    };
    let mut found = evenly(first, max_count / 2);
    found.extend(evenly(others, max_count - found.len()));
    found.sort_unstable();
    found
}

/// Returns the first difference between corresponding reads: the name of the variable and both values, or `a call` and both
/// statuses if the statuses differ. Floating-point numbers differ if their difference exceeds the tolerance, relative to the
/// larger magnitude or the nominal value.
pub fn difference(
    description: &Description,
    run: &Run,
    one: &[Read],
    other: &[Read],
    tolerance: f64,
) -> Option<[String; 3]> {
    one.iter().zip(other).find_map(|(one, other)| {
        let (of_one, of_other) = (run.outcome(one.id)?, run.outcome(other.id)?);
        if of_one.status != of_other.status {
            let show =
                |status: Option<i32>| format!("status {}", status.map_or("none".to_owned(), status_name));
            return Some(["a call".to_owned(), show(of_one.status), show(of_other.status)]);
        }
        // After an error, the standard does not define the values.
        let pairs = of_one.written.iter().zip(&of_other.written).filter(|_| run.succeeds(one.id));
        let of_pair = |(first, second): (&Values, &Values)| {
            let nominal = |index| {
                variable_at(one, index)
                    .map_or(1.0, |(variable, ..)| description.variables[variable].nominal())
            };
            let index = first.differ_beyond(second, tolerance, nominal)?;
            Some([name_at(description, one, index), first.show(index), second.show(index)])
        };
        pairs.into_iter().find_map(of_pair)
    })
}

/// Returns the name of the variable whose value is at an index of a read.
fn name_at(description: &Description, read: &Read, index: usize) -> String {
    variable_at(read, index).map_or_else(
        || format!("number {}", index + 1),
        |(variable, begin, size)| {
            let name = &description.variables[variable].name;
            if size == 1 { name.clone() } else { format!("{name}[{}]", index - begin) }
        },
    )
}

/// Returns the variable whose value is at an index of a read, the index of its first value, and the number of its values.
fn variable_at(read: &Read, index: usize) -> Option<(usize, usize, usize)> {
    read.parts().find(|(_, begin, size)| (*begin..begin + size).contains(&index))
}

/// Returns the values of the variables of all successful reads.
pub fn values_of<'r>(run: &'r Run, reads: &'r [Read]) -> impl Iterator<Item = (usize, Values)> {
    reads.iter().filter(|read| run.succeeds(read.id)).flat_map(move |read| {
        let value = move |(variable, begin, size)| Some((variable, run.written(read.id)?.part(begin, size)?));
        read.parts().filter_map(value)
    })
}

/// Returns the variable and the value of the first floating-point number that is not finite.
pub fn not_finite(run: &Run, reads: &[Read], description: &Description) -> Option<(usize, f64)> {
    values_of(run, reads).filter(|(index, _)| description.variables[*index].is_float()).find_map(
        |(index, value)| Some((index, value.numbers().into_iter().find(|number| !number.is_finite())?)),
    )
}

/// Returns the first number of a variable in the first successful read that contains it.
pub fn number_of(run: &Run, reads: &[Read], variable: usize) -> Option<f64> {
    value_of(run, reads, variable)?.numbers().first().copied()
}

/// Returns the value of a variable in the first successful read that contains it.
pub fn value_of(run: &Run, reads: &[Read], variable: usize) -> Option<Values> {
    reads.iter().find_map(|read| {
        let (_, begin, size) = read.parts().find(|(index, ..)| *index == variable)?;
        run.written(read.id).filter(|_| run.succeeds(read.id))?.part(begin, size)
    })
}
