//! The library loaded, used and unloaded again and again, beside another FMU: tests/c/reload.c.
#![cfg(target_os = "linux")]

use crate::c::{command, library, output, program};

const ROUNDS: i64 = 1000;

/// The memory grows by less than 100 bytes a round over the last nine tenths of the rounds, which is the
/// noise of counting pages. An instance forgotten in each would be 50 times as much; `make sanitize` has
/// valgrind look for every byte.
#[test]
fn loading_and_unloading_leaves_nothing_behind() {
    let program = program("reload");
    for names in [&["prw_testbed"][..], &["prw_testbed", "prw_controller"]] {
        let mut command = command(&program);
        command.arg(ROUNDS.to_string()).args(names.iter().map(|name| library(name)));
        let printed = output(&mut command, "the compiled program does not run");
        println!("{names:?}: {printed}");
        let memory: Vec<i64> = printed.lines().map(|line| line.parse().unwrap()).collect();
        let [begin, end] = memory[..] else { panic!("two numbers expected: {printed}") };
        let growth = (end - begin) * 1024;
        assert!(growth < 100 * ROUNDS, "{names:?}: {growth} bytes more");
    }
}
