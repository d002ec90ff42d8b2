//! An input changes (section 2.2.7).
include!("toy/fields.rs");

variables! { for Toy;
    /// An input
    u = input(&NUMBER).constant() in u;
}
