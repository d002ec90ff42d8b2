//! Where a value is set and how it is read go together.
include!("toy/fields.rs");

variables! { for Toy;
    /// Inputs
    u = input(&NUMBER) in list by |toy| toy.u;
}
