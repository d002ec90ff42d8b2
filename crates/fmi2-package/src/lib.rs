#![doc = include_str!("../README.md")]
//!
//! ## Inside
//!
//! * [`describe`] checks the model and writes the description; [`structure`] has the dependencies.
//! * [`LibraryBuild`] compiles the library with cargo, [`pack`] makes the FMU, [`Builder`] does all of it.
//! * [`System`] wires FMUs.
//! * [`Fingerprint`], [`Sources`] and [`build_script`] are for the guid; they are all there is without the
//!   feature `package`, for build scripts.

#![deny(missing_docs)]
#![cfg_attr(not(feature = "command"), allow(rustdoc::broken_intra_doc_links))]

mod content;
mod fingerprint;
mod packages;
mod sources;
mod variant;

#[cfg(feature = "package")]
mod cargo;
#[cfg(feature = "package")]
mod check;
#[cfg(feature = "command")]
mod command;
#[cfg(feature = "package")]
mod describe;
#[cfg(feature = "command")]
mod library;
#[cfg(feature = "package")]
mod pack;
#[cfg(feature = "package")]
mod platform;
#[cfg(feature = "package")]
pub mod structure;
#[cfg(feature = "package")]
mod system;
#[cfg(feature = "command")]
pub mod terminal;
#[cfg(feature = "package")]
mod types;
#[cfg(feature = "package")]
mod xml;

pub use content::{ContentFile, content_files};
pub use fingerprint::Fingerprint;
pub use sources::Sources;
pub use variant::{Start, Variant, build_script};

#[cfg(feature = "command")]
pub use command::{BuildOptions, Builder};
#[cfg(feature = "package")]
pub use {
    cargo::LibraryBuild,
    describe::{Changes, describe},
    pack::{Library, pack, write_atomically},
    platform::Platform,
    system::{CheckedSystem, System},
};
