#![doc = include_str!("../README.md")]
//!
//! ## Inside
//!
//! * [`LoadedModel`] is a library that describes itself; [`describe`] checks its model and returns the description;
//!   [`structure`] has the dependencies.
//! * [`LibraryBuild`] compiles the library with cargo, [`pack()`] makes the FMU, [`Builder`] does both.
//! * [`Fingerprint`], [`Sources`] and [`Variant`] are for the guid.
//!
//! Each file uses only those before it:
//!
//! | for | files |
//! |---|---|
//! | the guid | `fingerprint`, `directory`, `content`, `packages`, `sources`, `variant` |
//! | files | `xml`, `files` |
//! | the model | `table`, `model`, `instance` |
//! | the description | `check`, `sample`, `memory`, `rates`, `derivatives`, `structure`, `definitions`, `describe` |
//! | the FMU | `connectors`, `platform`, `pack` |
//! | the command | `cross`, `c_sources`, `cargo`, `library`, `universal`, `live`, `page`, `terminal`, `command` |

mod c_sources;
mod cargo;
mod check;
mod command;
mod connectors;
mod content;
mod cross;
mod definitions;
mod derivatives;
mod describe;
mod directory;
pub mod files;
mod fingerprint;
mod instance;
mod library;
mod live;
mod memory;
mod model;
mod pack;
mod packages;
mod page;
mod platform;
mod rates;
mod sample;
mod sources;
pub mod structure;
mod table;
pub mod terminal;
mod trials;
mod universal;
mod variant;
pub mod xml;

pub use {
    c_sources::{CSources, LINKING, WEBASSEMBLY, c_sources, check_tools},
    cargo::LibraryBuild,
    command::{BuildOptions, Builder, build},
    connectors::{Terminal, terminals},
    content::{ContentFile, content_files},
    describe::{Changes, describe},
    fingerprint::Fingerprint,
    fmi_abi::Standard,
    model::LoadedModel,
    pack::{Library, Parts, pack},
    packages::{cargo, metadata},
    page::{Companion, Page},
    platform::Platform,
    sources::Sources,
    variant::{NO_GUID, Variant},
};
