#![doc = include_str!("../README.md")]
//!
//! ## Structure of the crate
//!
//! * [`LoadedModel`] is the model of a loaded library, which describes itself. [`describe`] checks the model and returns its model
//!   description; [`structure`] finds the dependencies between its variables.
//! * [`LibraryBuild`] compiles the library with cargo, [`pack()`] writes the FMU, and [`Builder`] does both.
//! * [`Fingerprint`] computes the guid from the content of the FMU.
//!
//! A file uses only files that come before it in this table:
//!
//! | purpose | files |
//! |---|---|
//! | the sources | `directory`, `content`, `packages`, `sources` |
//! | the model | `table`, `call_monitor`, `model`, `instance` |
//! | checks of the model | `check`, `sample` |
//! | the description | `structure`, `definitions`, `describe` |
//! | the FMU | `connectors`, `platform`, `signature`, `library`, `starts`, `universal`, `fingerprint`, `pack` |
//! | the command | `cross`, `c_sources`, `cargo`, `page_html`, `terminal`, `options`, `builder`, `stages/plan` |
//! | its stages | `stages/compile`, `stages/describe`, `stages/check`, `stages/page`, `stages/pack`; `command` has their order |

mod builder;
mod c_sources;
mod call_monitor;
mod cargo;
mod check;
mod command;
mod connectors;
mod content;
mod cross;
mod describe;
mod directory;
mod fingerprint;
mod instance;
mod library;
mod model;
mod options;
mod pack;
mod packages;
mod page_html;
mod platform;
mod sample;
mod signature;
mod sources;
mod stages;
mod starts;
pub mod structure;
mod table;
pub mod terminal;
mod universal;

pub use {
    builder::Builder,
    c_sources::{LINKING, WEBASSEMBLY, c_sources, check_tools},
    cargo::LibraryBuild,
    command::build,
    connectors::{Terminal, terminals},
    content::{ContentFile, content_files},
    describe::{Changes, describe},
    fingerprint::Fingerprint,
    fmi_abi::Standard,
    fmi_abi::stamp::NO_GUID,
    library::Library,
    model::LoadedModel,
    options::BuildOptions,
    pack::{Files, Packed, Parts, pack},
    packages::{cargo, directory_of, metadata},
    platform::Platform,
    sources::Sources,
    stages::{Page, pass_checker},
};
