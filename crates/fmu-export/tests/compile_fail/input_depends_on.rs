//! Only what is calculated depends on others.
include!("toy/fields.rs");

variables! { for Toy;
    /// An input
    u = input(&NUMBER).depends_on(&[u]) in u;
}
