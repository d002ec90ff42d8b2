//! A variable has a place or a calculation.
include!("toy/fields.rs");

variables! { for Toy;
    /// An output
    y = output(&NUMBER);
}
