//! The compiler's messages about invalid models. The files of `compile_fail` contain the mistakes.

/// The compiler reports only the mistakes of the first phase that fails, so there is one file for each phase. After an
/// update of the compiler, `TRYBUILD=overwrite` writes the new messages; compare them with the old ones.
#[test]
fn messages_of_the_compiler() {
    trybuild::TestCases::new().compile_fail("tests/compile_fail/*.rs");
}
