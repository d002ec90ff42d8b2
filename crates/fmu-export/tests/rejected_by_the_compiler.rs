//! The compiler's messages about invalid models. The files of `compile_fail` contain the mistakes.

/// The compiler reports only the mistakes of the first phase that fails, so there is one file for each phase. After an
/// update of the compiler, `TRYBUILD=overwrite` writes the new messages; compare them with the old ones. All dependencies are compiled
/// once more for this test.
#[test]
#[ignore = "make test-long runs it, and make test a documentation test of one mistake"]
fn messages_of_the_compiler() {
    trybuild::TestCases::new().compile_fail("tests/compile_fail/*.rs");
}
