//! One FMU among those that can be made from the same sources, and the build script's part in making it.

use crate::fingerprint::Fingerprint;
use crate::sources::Sources;
use anyhow::{Result, bail};
use std::env;

/// A start value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Start {
    /// Of a Real variable.
    Real(f64),
    /// Of an Integer variable.
    Integer(i32),
    /// Of a Boolean variable.
    Boolean(bool),
}

#[cfg(feature = "package")]
impl Start {
    /// What a variable's table says.
    pub(crate) fn of(kind: &fmi2_export::Kind) -> Self {
        use fmi2_export::Kind;
        match *kind {
            Kind::Real { start, .. } => Self::Real(start),
            Kind::Integer { start, .. } => Self::Integer(start),
            Kind::Boolean { start } => Self::Boolean(start),
            // fmi2-export has no other kind, and fmi2-package is released with it.
            ref other => unreachable!("{other:?}"),
        }
    }
}

/// What the library and the description must agree on.
#[derive(Clone, Debug, PartialEq)]
pub struct Variant {
    /// The fingerprint of the sources.
    pub sources: String,
    /// Start values that are read from elsewhere when the library is compiled, by variable name.
    pub start: Vec<(String, Start)>,
    /// Whether parameters are `tunable` instead of `fixed`.
    pub tunable: bool,
}

impl Variant {
    /// The guid of the FMU.
    pub fn guid(&self) -> String {
        let mut fingerprint = Fingerprint::new();
        fingerprint.add("sources", self.sources.as_bytes());
        for (name, start) in &self.start {
            match start {
                Start::Real(value) => fingerprint.add(name, &value.to_bits().to_le_bytes()),
                Start::Integer(value) => fingerprint.add(name, &value.to_le_bytes()),
                Start::Boolean(value) => fingerprint.add(name, &[u8::from(*value)]),
            }
        }
        fingerprint.add("tunable", &[u8::from(self.tunable)]);
        fingerprint.guid()
    }
}

/// A build script: fingerprints the sources and tells cargo when to do it again. The crate then knows its
/// guid as `env!("FMU_GUID")`, and its `build_fmu` as `env!("FMU_SOURCES")` what it was compiled from.
///
/// `start` are start values that the build script itself has baked in; most models have none.
///
/// ```no_run
/// // in main of build.rs
/// let sources = fmi2_package::Sources::of_package(env!("CARGO_MANIFEST_DIR"));
/// fmi2_package::build_script(&sources, vec![]).unwrap();
/// ```
///
/// # Errors
/// When a source cannot be read, or `FMU_TUNABLE`, which `build_fmu --tunable` sets to 1, makes no sense.
pub fn build_script(sources: &Sources, start: Vec<(String, Start)>) -> Result<()> {
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
