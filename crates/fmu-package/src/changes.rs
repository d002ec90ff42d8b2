//! What a description has that the model as it was compiled has not.

/// What differs from the model as it was compiled.
#[derive(Clone, Debug, Default)]
pub struct Changes {
    /// Another guid.
    pub guid: Option<String>,
    /// Parameters are `tunable` instead of `fixed`.
    pub tunable_parameters: bool,
    /// The files of the folder `sources` that an importer compiles (FMI 2.0).
    pub source_files: Vec<String>,
}
