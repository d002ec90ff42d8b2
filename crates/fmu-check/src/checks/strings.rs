//! Checks that strings belong to their variable and their instance: several are set to different values and read in turns and on
//! threads.

use super::start_values::{settable, values_are_kept};
use crate::call_sequence::{Numbered, Step, Values};
use crate::checker::Checker;
use crate::finding::{any, failure};
use crate::writer::Part::{Enter, Free, Leave, Make, Points};
use crate::writer::{Part, Trajectory, Writer};
use fmi_abi::BaseType;

/// Number of reads on each thread, so that reads overlap.
const READS: usize = 40;

/// Returns different strings for the variables of an instance, longer than usual buffers in structures.
fn strings(checker: &Checker, instance: usize) -> Vec<(usize, Values)> {
    let variables = &checker.description.variables;
    let mut indices = settable(checker);
    indices.retain(|index| variables[*index].base == Some(BaseType::String));
    let text = |index: usize| format!("string {index} of instance {instance} {}", "xyz".repeat(instance));
    let values = indices.into_iter().take(100);
    values
        .map(|index| (index, Values::strings(text(index).as_bytes(), variables[index].starts_count())))
        .collect()
}

/// Checks that a simulation with these strings succeeds and that each is read as it was set, from two instances in turns: after the
/// strings of the other one were set and read, after its initialization and steps, and after it was freed.
pub fn instances(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let of = [1, 2].map(|instance| strings(checker, instance));
    if of[0].is_empty() {
        return Ok(());
    }
    let indices: Vec<usize> = of[0].iter().map(|(index, _)| *index).collect();
    let mut writer = checker.writer(trajectory);
    let mut sets = Vec::new();
    let mut reads = [Vec::new(), Vec::new()];
    let mut read = |writer: &mut Writer, instance: usize| {
        reads[instance - 1].push(writer.read_anyway(instance, &indices));
    };
    for instance in [1, 2] {
        writer.make(instance);
        sets.extend(writer.set(instance, &of[instance - 1]));
    }
    let parts: [&[Part]; 3] = [&[Enter], &[Leave], &[Points(2)]];
    for part in parts {
        for instance in [1, 2] {
            sets.extend(writer.write(instance, part).ids);
        }
        [1, 2, 1].into_iter().for_each(|instance| read(&mut writer, instance));
    }
    writer.write(2, &[Free]);
    read(&mut writer, 1);
    let kept = |instance: usize| {
        let reads = reads[instance - 1].clone();
        let (sets, values) = (sets.clone(), of[instance - 1].clone());
        let has = "reads, next to another instance,";
        let each = move |reads| values_are_kept(checker, sets.clone(), reads, values.clone(), has);
        reads.into_iter().map(each)
    };
    let criteria = any(kept(1).chain(kept(2)).collect::<Vec<_>>());
    let sequence = writer.sequence.clone();
    let sets = sets.clone();
    checker.check("results.instances", writer.sequence, move |run| {
        // A model may reject the strings.
        failure(&sequence, run, &sets).is_none().then(|| criteria(run))?
    })
}

/// Checks that two instances on different threads return their own strings, if each string is copied immediately, as importers do.
pub fn threads(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let of = [1, 2].map(|instance| strings(checker, instance));
    let Some((index, _)) = of[0].first().cloned() else { return Ok(()) };
    let mut writer = checker.writer(trajectory);
    let begin = |writer: &mut Writer, instance: usize, reads: usize| {
        writer.write(instance, &[Make]);
        let mut ids = writer.set(instance, &of[instance - 1]);
        ids.extend(writer.write(instance, &[Enter, Leave]).ids);
        let reads: Vec<_> = (0..reads).map(|_| writer.read_these(instance, &[index])).collect();
        writer.free(instance);
        (ids, reads)
    };
    let mut criteria = Vec::new();
    let mut kept = |(ids, reads): (Vec<u32>, Vec<Vec<_>>), instance: usize| {
        let has = "reads, next to an instance on another thread,";
        let values = vec![of[instance - 1][0].clone()];
        criteria.extend(
            reads.into_iter().map(|read| values_are_kept(checker, ids.clone(), read, values.clone(), has)),
        );
    };
    for instance in [1, 2] {
        begin(&mut writer, instance, 1);
    }
    let mut sequences: Vec<Vec<Numbered>> = Vec::new();
    for instance in [1, 2] {
        let mut thread = Writer { next: writer.next, ..checker.writer(trajectory) };
        kept(begin(&mut thread, instance, READS), instance);
        writer.next = thread.next;
        sequences.push(thread.sequence);
    }
    writer.add(Step::Parallel(sequences));
    checker.check("results.threads", writer.sequence, any(criteria))
}
