//! A Real is an f64.
include!("toy/fields.rs");

variables! { for Toy;
    /// An output
    y = output(&NUMBER) by |toy| toy.n;
}
