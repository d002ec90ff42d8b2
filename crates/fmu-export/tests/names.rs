//! The items of an author's crate may have the same names as types of FMI and items of this crate or of Rust.
#![allow(
    dead_code,
    unused_macros,
    missing_docs,
    non_camel_case_types,
    non_snake_case,
    non_upper_case_globals
)]

use fmu_export as fmi;

/// A type of the author that has the name of an FMI type.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Status {
    #[default]
    Idle,
}

pub struct Model;
pub struct Variable;
pub struct Variables;
pub struct Instance;
pub struct ImporterLog;
pub struct Mode;
pub struct Exported;
pub struct Index;
pub struct Event;
pub struct Step;
pub struct fmi2Real;
pub struct fmi2Component;
pub struct fmi2EventInfo;
pub struct Option;
pub struct Result;
pub struct String;
pub struct Some;
pub struct None;
pub struct Ok;
pub struct Err;
pub trait Clone {}
pub mod types {}
pub mod fmi2 {}
pub mod index {}
pub mod core {}
pub mod std {}
macro_rules! concat {
    () => {};
}
macro_rules! stringify {
    () => {};
}
macro_rules! panic {
    () => {};
}
fn fmi2GetReal() {}

/// Fields and variables may have such names, too.
#[derive(::core::clone::Clone)]
struct Idler {
    model: f64,
    variable: f64,
    status: Status,
}

fmi::variables! { for Idler, memory in model;
    /// Named like an argument of the macro
    model = input(&fmi::NUMBER) in variable then |variable| { variable.model += 1.0; };
    /// Named like a variable
    variable = output(&fmi::NUMBER).state() in variable;
    /// Named like an item of the crate
    Status = local(&fmi::NUMBER).derivative_of(variable).depends_on(&[model]) by |model| model.model;
    /// Named like an item of the macro
    Name = output(&fmi::NUMBER) by |value| value.variable;
    /// Named like a constant of Rust
    COUNT = output(&fmi::NUMBER) by |_| 0.0;
}

impl fmi::Model for Idler {
    const INFO: fmi::Info = fmi::info!("Idler", "idler");

    fn new(_: &fmi::Setup) -> ::core::result::Result<Self, fmi::Error> {
        ::core::result::Result::Ok(Self { model: 0.0, variable: 0.0, status: Status::Idle })
    }
}

impl fmi::CoSimulation for Idler {
    fn step(&mut self, _: fmi::Step) -> ::core::result::Result<fmi::Stepped, fmi::Error> {
        ::core::result::Result::Ok(fmi::Stepped::Done)
    }
}

impl fmi::ModelExchange for Idler {}

impl fmi::Partials for Idler {
    fn partial(&self, _: Name, _: Name) -> ::core::option::Option<f64> {
        ::core::option::Option::None
    }
}

impl fmi::InputDerivatives for Idler {
    fn set_input_derivative(&mut self, _: Name, _: u32, _: f64) {}
}

impl fmi::OutputDerivatives for Idler {
    fn output_derivative(&self, _: Name, _: u32) -> f64 {
        0.0
    }
}

mod choices {
    pub enum Item {}
    pub enum Value {}
    fmu_export::enumeration! {
        /// An enumeration whose items have names of Rust.
        pub enum Scalar {
            /// One
            Some = 1,
            /// Two
            None = 2,
        }
    }
    fmu_export::saved! {
        /// A struct with the name of a trait.
        #[derive(Clone, Copy, Default)]
        pub struct Saved {
            /// A field with the name of an argument.
            pub visitor: f64,
        }
    }
}

fmi::export_fmu!(Idler: CoSimulation + ModelExchange + Partials + InputDerivatives + OutputDerivatives);

#[test]
fn the_macros_use_their_own_items() {
    // SAFETY: the function has no requirements.
    let version = unsafe { fmi2_functions::fmi2GetVersion() };
    // SAFETY: the string is valid until the program ends.
    assert_eq!(unsafe { ::std::ffi::CStr::from_ptr(version) }, c"2.0");
    let table = <Idler as fmi::Variables>::TABLE;
    let index = <Idler as fmi::Variables>::index;
    assert_eq!(table[index(Name::Status)].name(), "Status");
    assert_eq!(
        table[index(Name::Status)].differentiates(),
        ::core::option::Option::Some(index(Name::variable) as u32)
    );
}
