//! An author's crate may call its items like FMI's types, like this crate's, and like Rust's.
#![allow(
    dead_code,
    unused_macros,
    missing_docs,
    non_camel_case_types,
    non_snake_case,
    non_upper_case_globals
)]

use fmi2_export as fmi;

/// A status of the author's own.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Status {
    #[default]
    Idle,
}

pub struct Model;
pub struct Variable;
pub struct Instance;
pub struct ImporterLog;
pub struct Mode;
pub struct fmi2Real;
pub struct fmi2Component;
pub struct fmi2EventInfo;
pub struct Option;
pub struct Place;
pub const Some: () = ();
pub const None: () = ();
pub mod types {}
pub mod boundary {}
pub mod core {}
pub mod std {}
macro_rules! concat {
    () => {};
}
macro_rules! stringify {
    () => {};
}
fn fmi2GetReal() {}

const NUMBER: fmi::RealType = fmi::RealType::new("Number", &fmi::units::ONE);

fmi::variables! {
    /// What is called like the macro's own item
    Place = fmi::Variable::output(&NUMBER);
}

#[derive(Clone)]
struct Idler(Status);

impl fmi::Model for Idler {
    const INFO: fmi::ModelInfo = fmi::ModelInfo {
        co_simulation: ::core::option::Option::Some(fmi::CoSimulation::PLAIN),
        ..fmi::ModelInfo::new("Idler", "idler", fmi::guid!(), VARIABLES)
    };

    fn new(_: fmi::Interface) -> Self {
        Self(Status::Idle)
    }

    fn real(&self, _: u32) -> f64 {
        0.0
    }

    fn set_real(&mut self, _: u32, _: f64) {}
}

fmi::export_fmi2!(Idler);

#[test]
fn the_functions_are_those_of_the_fmu() {
    let version = fmi2_functions::fmi2GetVersion();
    // SAFETY: a string that lives as long as the library.
    assert_eq!(unsafe { ::std::ffi::CStr::from_ptr(version) }, c"2.0");
    assert_eq!(VARIABLES[vr::Place as usize].name(), "Place");
}
