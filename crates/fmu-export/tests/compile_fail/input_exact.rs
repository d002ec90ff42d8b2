//! An input has no initial (section 2.2.7).
include!("toy/fields.rs");

variables! { for Toy;
    /// An input
    u = input(&NUMBER).exact() in u;
}
