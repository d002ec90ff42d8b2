//! The models that the macros reject, and the messages: each module in the files of compile_fail is one mistake.

/// A compiler reports only the mistakes of its first failing phase, so there is a file for each phase. `TRYBUILD=overwrite`
/// writes the messages again after an update of the compiler; compare them with the old ones.
#[test]
fn messages_of_the_compiler() {
    trybuild::TestCases::new().compile_fail("tests/compile_fail/*.rs");
}
