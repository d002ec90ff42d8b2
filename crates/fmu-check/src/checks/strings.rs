//! Checks that each variable of each instance has a separate string. Two instances get different strings, which are read in turns and on
//! two threads.

use super::start_values::{settable, values_are_kept};
use crate::call_sequence::Values;
use crate::checker::Checker;
use crate::finding::{any, unless_fails};
use crate::writer::Part::{Enter, Free, Leave, Make, Points};
use crate::writer::{Part, Trajectory, Writer};
use fmi_abi::BaseType;

/// Number of reads on each thread. There are many, so that reads on different threads overlap.
const READS: usize = 40;

/// Returns a different string for each settable string variable of an instance.
fn strings(checker: &Checker, instance: usize) -> Vec<(usize, Values)> {
    let variables = &checker.description.variables;
    let mut indices = settable(checker);
    indices.retain(|index| variables[*index].base == Some(BaseType::String));
    let string = |index: usize| format!("string {index} of instance {instance} {}", "xyz".repeat(instance));
    let values = indices.into_iter().take(100);
    values
        .map(|index| (index, Values::strings(string(index).as_bytes(), variables[index].starts_count())))
        .collect()
}

/// Checks that getters return the strings that were set in two instances, which are called in turns. Both are read after each part of the
/// simulation, and instance 1 also after instance 2 was freed.
pub fn instances(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let values = [1, 2].map(|instance| strings(checker, instance));
    if values[0].is_empty() {
        return Ok(());
    }
    let indices: Vec<usize> = values[0].iter().map(|(index, _)| *index).collect();
    let mut writer = checker.writer(trajectory);
    let mut sets = Vec::new();
    let mut reads = [Vec::new(), Vec::new()];
    let mut read = |writer: &mut Writer, instance: usize| {
        reads[instance - 1].push(writer.read_anyway(instance, &indices));
    };
    for instance in [1, 2] {
        writer.make(instance);
        sets.extend(writer.set(instance, &values[instance - 1]));
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
    let are_kept = |instance: usize| {
        let reads = reads[instance - 1].clone();
        let (sets, values) = (sets.clone(), values[instance - 1].clone());
        let has = "reads, next to another instance,";
        let each = move |reads| values_are_kept(checker, sets.clone(), reads, values.clone(), has);
        reads.into_iter().map(each)
    };
    let criteria = any(are_kept(1).chain(are_kept(2)).collect::<Vec<_>>());
    // A model may reject the strings, which is not a finding.
    let criteria = unless_fails(&writer.sequence, sets, criteria);
    checker.check("results.instances", writer.sequence, criteria)
}

/// Checks that each of two instances on different threads returns the string that was set in it. The worker copies the string
/// immediately, as importers do.
pub fn threads(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let values = [1, 2].map(|instance| strings(checker, instance));
    let Some((index, _)) = values[0].first().cloned() else { return Ok(()) };
    let mut writer = checker.writer(trajectory);
    let write_instance = |writer: &mut Writer, instance: usize, reads: usize| {
        writer.write(instance, &[Make]);
        let mut ids = writer.set(instance, &values[instance - 1]);
        ids.extend(writer.write(instance, &[Enter, Leave]).ids);
        let reads: Vec<_> = (0..reads).map(|_| writer.read_these(instance, &[index])).collect();
        writer.free(instance);
        (ids, reads)
    };
    let mut criteria = Vec::new();
    let mut expect_kept = |(ids, reads): (Vec<u32>, Vec<Vec<_>>), instance: usize| {
        let has = "reads, next to an instance on another thread,";
        let values = vec![values[instance - 1][0].clone()];
        criteria.extend(
            reads.into_iter().map(|read| values_are_kept(checker, ids.clone(), read, values.clone(), has)),
        );
    };
    for instance in [1, 2] {
        write_instance(&mut writer, instance, 1);
    }
    let mut threads = Vec::new();
    for instance in [1, 2] {
        let mut thread = threads.last().unwrap_or(&writer).thread();
        expect_kept(write_instance(&mut thread, instance, READS), instance);
        threads.push(thread);
    }
    writer.join(threads);
    checker.check("results.threads", writer.sequence, any(criteria))
}
