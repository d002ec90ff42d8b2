#![doc = include_str!("../README.md")]
//!
//! ## Structure of the crate
//!
//! * [`LoadedModel`] is the model of a loaded library, which describes itself. [`describe`] checks the model and returns its model
//!   description; [`structure`] finds the dependencies between its variables.
//! * [`LibraryBuild`] compiles the library with cargo, [`pack()`] writes the FMU, and [`Builder`] does both.
//! * [`Fingerprint`], [`Sources`] and [`Variant`] compute the guid.
//!
//! A file uses only files that come before it in this table:
//!
//! | purpose | files |
//! |---|---|
//! | the guid | `fingerprint`, `directory`, `content`, `packages`, `sources`, `variant` |
//! | files | `xml`, `files` |
//! | the model | `table`, `call_monitor`, `model`, `instance` |
//! | checks of the model | `check`, `sample`, `saved_states`, `state_derivatives`, `partial_derivatives` |
//! | the description | `structure`, `definitions`, `describe` |
//! | the FMU | `connectors`, `platform`, `pack` |
//! | the command | `cross`, `c_sources`, `cargo`, `library`, `universal`, `page_html`, `page`, `terminal`, `command` |

mod c_sources;
mod call_monitor;
mod cargo;
mod check;
mod command;
mod connectors;
mod content;
mod cross;
mod definitions;
mod describe;
mod directory;
pub mod files;
mod fingerprint;
mod instance;
mod library;
mod model;
mod pack;
mod packages;
mod page;
mod page_html;
mod partial_derivatives;
mod platform;
mod sample;
mod saved_states;
mod sources;
mod state_derivatives;
pub mod structure;
mod table;
pub mod terminal;
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
