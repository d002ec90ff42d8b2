//! A constant is exact (section 2.2.7).
include!("toy/fields.rs");

variables! { for Toy;
    /// An output
    y = output(&NUMBER).constant().approx() in x;
}
