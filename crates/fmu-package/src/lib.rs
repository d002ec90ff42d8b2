#![doc = include_str!("../README.md")]
//!
//! ## Inside
//!
//! * [`fmi2::describe`] and [`fmi3::describe`] check the model and write the description; [`structure`] has the
//!   dependencies.
//! * [`LibraryBuild`] compiles the library with cargo, [`pack()`] makes the FMU, [`Builder`] does all of it.
//! * [`Fingerprint`], [`Sources`] and [`Variant`] are for the guid.
//!
//! Each file uses only those before it:
//!
//! | for | files |
//! |---|---|
//! | the guid | `fingerprint`, `folder`, `content`, `packages`, `sources`, `variant` |
//! | files | `xml`, `files` |
//! | the description | `changes`, `check`, `sample`, `memory`, `structure`, `definitions`, `describe`, `fmi2`, `fmi3` |
//! | the FMU | `connectors`, `version`, `platform`, `cargo`, `pack` |
//! | the command | `library`, `universal`, `cross`, `c_sources`, `live`, `terminal`, `command` |

#![cfg_attr(not(feature = "command"), allow(rustdoc::broken_intra_doc_links))]
#![cfg_attr(docsrs, feature(doc_cfg))]

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
mod connectors;
#[cfg(feature = "package")]
mod definitions;
#[cfg(feature = "package")]
mod derivatives;
#[cfg(feature = "package")]
mod describe;
#[cfg(feature = "package")]
pub mod fmi2;
#[cfg(feature = "package")]
pub mod fmi3;
#[cfg(feature = "package")]
mod memory;
#[cfg(feature = "package")]
mod pack;
#[cfg(feature = "package")]
mod platform;
#[cfg(feature = "package")]
mod sample;
#[cfg(feature = "package")]
pub mod structure;
#[cfg(feature = "package")]
mod version;

#[cfg(feature = "command")]
mod c_sources;
#[cfg(feature = "command")]
mod command;
#[cfg(feature = "command")]
mod cross;
#[cfg(feature = "command")]
mod library;
#[cfg(feature = "command")]
mod live;
#[cfg(feature = "command")]
pub mod terminal;
#[cfg(feature = "command")]
mod universal;

pub use content::{ContentFile, content_files};
pub use fingerprint::Fingerprint;
pub use sources::Sources;
pub use variant::{NO_GUID, Variant};

#[cfg(feature = "command")]
pub use c_sources::{CSources, LINKING, WEBASSEMBLY, c_sources, check_tools};
#[cfg(feature = "command")]
pub use command::{BuildOptions, Builder, build};
#[cfg(feature = "package")]
pub use {
    cargo::LibraryBuild,
    changes::Changes,
    connectors::{Terminal, terminals},
    pack::{Library, Parts, pack},
    platform::Platform,
    version::Fmi,
};
