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

mod c_sources;
mod cargo;
mod changes;
mod check;
mod command;
mod connectors;
mod content;
mod cross;
mod definitions;
mod derivatives;
mod describe;
pub mod files;
mod fingerprint;
pub mod fmi2;
pub mod fmi3;
mod folder;
mod instance;
mod library;
mod live;
mod memory;
mod model;
mod pack;
mod packages;
mod platform;
mod sample;
mod sources;
pub mod structure;
mod table;
pub mod terminal;
mod universal;
mod variant;
mod version;
pub mod xml;

pub use {
    c_sources::{CSources, LINKING, WEBASSEMBLY, c_sources, check_tools},
    cargo::LibraryBuild,
    changes::Changes,
    command::{BuildOptions, Builder, build},
    connectors::{Terminal, terminals},
    content::{ContentFile, content_files},
    fingerprint::Fingerprint,
    model::LoadedModel,
    pack::{Library, Parts, pack},
    platform::Platform,
    sources::Sources,
    variant::{NO_GUID, Variant},
    version::Fmi,
};
