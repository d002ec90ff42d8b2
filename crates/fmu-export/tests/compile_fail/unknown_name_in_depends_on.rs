//! Other variables are named by their names.
include!("toy/fields.rs");

variables! { for Toy;
    /// An output
    y = output(&NUMBER).depends_on(&[w]) by |toy| toy.u;
}
