#![doc = include_str!("../README.md")]
//!
//! ## Inside
//!
//! * [`LoadedModel`] is a library that describes itself; [`fmi2::describe`] and [`fmi3::describe`] check its model and write
//!   the description; [`structure`] has the dependencies.
//! * [`LibraryBuild`] compiles the library with cargo, [`pack()`] makes the FMU, [`Builder`] does all of it.
//! * [`Fingerprint`], [`Sources`] and [`Variant`] are for the guid.
//!
//! Each file uses only those before it:
//!
//! | for | files |
//! |---|---|
//! | the guid | `fingerprint`, `folder`, `content`, `packages`, `sources`, `variant` |
//! | files | `xml`, `files` |
//! | the model | `table`, `model`, `instance` |
//! | the description | `changes`, `check`, `sample`, `memory`, `derivatives`, `structure`, `definitions`, `describe`, `fmi2`, `fmi3` |
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

#[cfg(feature = "command")]
mod cargo;
#[cfg(feature = "command")]
mod changes;
#[cfg(feature = "command")]
mod check;
#[cfg(feature = "command")]
mod connectors;
#[cfg(feature = "command")]
mod definitions;
#[cfg(feature = "command")]
mod derivatives;
#[cfg(feature = "command")]
mod describe;
#[cfg(feature = "command")]
pub mod fmi2;
#[cfg(feature = "command")]
pub mod fmi3;
#[cfg(feature = "command")]
mod instance;
#[cfg(feature = "command")]
mod memory;
#[cfg(feature = "command")]
mod model;
#[cfg(feature = "command")]
mod pack;
#[cfg(feature = "command")]
mod platform;
#[cfg(feature = "command")]
mod sample;
#[cfg(feature = "command")]
pub mod structure;
#[cfg(feature = "command")]
mod table;
#[cfg(feature = "command")]
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
pub use {
    c_sources::{CSources, LINKING, WEBASSEMBLY, c_sources, check_tools},
    cargo::LibraryBuild,
    changes::Changes,
    command::{BuildOptions, Builder, build},
    connectors::{Terminal, terminals},
    model::LoadedModel,
    pack::{Library, Parts, pack},
    platform::Platform,
    version::Fmi,
};
