//! An input lives somewhere.
include!("toy/fields.rs");

variables! { for Toy;
    /// An input
    u = input(&NUMBER) by |toy| toy.u;
}
