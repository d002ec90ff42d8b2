#![doc = include_str!("../README.md")]
//!
//! ## Inside
//!
//! * [`describe()`] checks the model and writes the description; [`structure`] has the dependencies.
//! * [`LibraryBuild`] compiles the library with cargo, [`pack()`] makes the FMU, [`Builder`] does all of it.
//! * [`Fingerprint`], [`Sources`] and [`build_script`] are for the guid; they are all there is without features, for
//!   build scripts.
//!
//! Each file uses only those before it:
//!
//! | for | files |
//! |---|---|
//! | the guid | `fingerprint`, `folder`, `content`, `packages`, `sources`, `variant` |
//! | files | `xml`, `files` |
//! | the description | `changes`, `check`, `sample`, `structure`, `definitions`, `describe` |
//! | the FMU | `platform`, `cargo`, `pack` |
//! | the command | `library`, `terminal`, `command` |

#![cfg_attr(not(feature = "command"), allow(rustdoc::broken_intra_doc_links))]

mod content;
mod fingerprint;
mod folder;
mod packages;
mod sources;
mod variant;

#[cfg(feature = "files")]
pub mod files;
#[cfg(feature = "files")]
pub mod xml;

#[cfg(feature = "package")]
mod cargo;
#[cfg(feature = "package")]
mod changes;
#[cfg(feature = "package")]
mod check;
#[cfg(feature = "package")]
mod definitions;
#[cfg(feature = "package")]
mod describe;
#[cfg(feature = "package")]
mod pack;
#[cfg(feature = "package")]
mod platform;
#[cfg(feature = "package")]
mod sample;
#[cfg(feature = "package")]
pub mod structure;

#[cfg(feature = "command")]
mod command;
#[cfg(feature = "command")]
mod library;
#[cfg(feature = "command")]
pub mod terminal;

pub use content::{ContentFile, content_files};
pub use fingerprint::Fingerprint;
pub use sources::Sources;
pub use variant::{NO_GUID, Variant, build_script};

#[cfg(feature = "command")]
pub use command::{BuildOptions, Builder};
#[cfg(feature = "package")]
pub use {
    cargo::LibraryBuild,
    changes::Changes,
    describe::describe,
    pack::{Library, pack},
    platform::Platform,
};
