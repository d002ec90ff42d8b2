//! Turns a [`Model`](fmi2_export::Model) of fmi2-export into a file that importers take: describes it in
//! `modelDescription.xml`, compiles its library, packs both into an FMU.
//!
//! * [`describe`] writes the description from the model's own table of variables. Which variable depends
//!   on which ([`structure`]) is found by asking a live model, so it cannot contradict the equations.
//! * [`LibraryBuild`] compiles the library with cargo.
//! * [`pack`] makes the FMU; the same content gives the same bytes.
//! * [`Fingerprint`] is for the guid; it is all there is without the feature `package`, for build scripts.

mod content;
mod fingerprint;
mod sources;
mod variant;

#[cfg(feature = "package")]
mod cargo;
#[cfg(feature = "command")]
mod command;
#[cfg(feature = "package")]
mod describe;
#[cfg(feature = "package")]
mod pack;
#[cfg(feature = "package")]
mod platform;
#[cfg(feature = "package")]
pub mod structure;
#[cfg(feature = "package")]
mod system;
#[cfg(feature = "package")]
mod types;
#[cfg(feature = "package")]
mod xml;

pub use content::{ContentFile, content_files};
pub use fingerprint::Fingerprint;
pub use sources::Sources;
pub use variant::{Start, Variant, build_script};

#[cfg(feature = "command")]
pub use command::{BuildOptions, Builder, exit, short};
#[cfg(feature = "package")]
pub use {
    cargo::LibraryBuild,
    describe::{Changes, describe},
    pack::{Library, pack, write_atomically},
    platform::Platform,
    system::{CheckedSystem, System},
};
