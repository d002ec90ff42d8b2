//! A kind is a function of Variable.
include!("toy/fields.rs");

variables! { for Toy;
    /// An input
    u = inlet(&NUMBER) in u;
}
