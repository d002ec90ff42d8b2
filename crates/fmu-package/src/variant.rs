//! The guid of an FMU. It depends on more than the sources, because several FMUs can be built from the same sources.

use crate::fingerprint::Fingerprint;

/// The placeholder for the guid in libraries that were compiled without one, and in descriptions that are kept with the sources.
pub const NO_GUID: &str = "{00000000-0000-0000-0000-000000000000}";

/// The information from which a guid is computed, so that the library and the description belong together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Variant {
    /// The fingerprint of the sources.
    pub sources: String,
    /// Start values that are read from another file when the library is compiled: the variable's name, and the value in the
    /// description, for example `0.5`, `true`, or the number of an item.
    pub start: Vec<(String, String)>,
    /// Whether parameters are `tunable` instead of `fixed`.
    pub tunable: bool,
}

impl Variant {
    /// The guid of the FMU.
    pub fn guid(&self) -> String {
        let mut fingerprint = Fingerprint::new();
        fingerprint.add("sources", self.sources.as_bytes());
        for (name, start) in &self.start {
            fingerprint.add(name, start.as_bytes());
        }
        fingerprint.add("tunable", &[u8::from(self.tunable)]);
        fingerprint.guid()
    }
}
