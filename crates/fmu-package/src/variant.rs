//! One FMU among those that can be made from the same sources, and the build script's part in making it.

use crate::fingerprint::Fingerprint;
use crate::sources::Sources;
use anyhow::{Result, bail};
use std::env;

/// The guid that is written where none is due: what [`build_script`] has not made one for, and descriptions that are
/// kept with the sources.
pub const NO_GUID: &str = "{00000000-0000-0000-0000-000000000000}";

/// What the library and the description must agree on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Variant {
    /// The fingerprint of the sources.
    pub sources: String,
    /// Start values that are read from elsewhere when the library is compiled: the variable's name, and the value as
    /// the description has it, for example `0.5`, `true`, or the number of an item.
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

/// A build script: fingerprints the sources and tells cargo when to do it again. The crate then knows its
/// guid as `env!("FMU_GUID")`, and its `build_fmu` as `env!("FMU_SOURCES")` what it was compiled from.
///
/// `start` are start values that the build script itself has baked in, see [`Variant::start`]; most models have none.
///
/// ```no_run
/// // in main of build.rs
/// let sources = fmu_package::Sources::of_package(env!("CARGO_MANIFEST_DIR"));
/// fmu_package::build_script(&sources, vec![]).unwrap();
/// ```
///
/// # Errors
/// When a source cannot be read, or `FMU_TUNABLE`, which `build_fmu --tunable` sets to 1, makes no sense.
pub fn build_script(sources: &Sources, start: Vec<(String, String)>) -> Result<()> {
    println!("cargo::rerun-if-env-changed=FMU_TUNABLE");
    for path in sources.watched()? {
        println!("cargo::rerun-if-changed={}", path.display());
    }
    let tunable = match env::var("FMU_TUNABLE").as_deref() {
        Ok("1") => true,
        Ok("" | "0") | Err(_) => false,
        Ok(other) => bail!("FMU_TUNABLE must be 1 or 0, it is '{other}'"),
    };
    let variant = Variant { sources: sources.fingerprint()?, start, tunable };
    println!("cargo::rustc-env=FMU_SOURCES={}", variant.sources);
    println!("cargo::rustc-env=FMU_GUID={}", variant.guid());
    Ok(())
}
