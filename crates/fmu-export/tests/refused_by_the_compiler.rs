//! What the macros refuse, and the words in which they do; each file of compile_fail says what it is about.

/// What the compiler adds to the words varies from version to version: `TRYBUILD=overwrite` writes the files anew, after
/// which a look at the difference shows whether a message got worse.
#[test]
fn messages_of_the_compiler() {
    trybuild::TestCases::new().compile_fail("tests/compile_fail/*.rs");
}
