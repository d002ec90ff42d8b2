//! Names are unique.
include!("toy/fields.rs");

variables! { for Toy;
    /// An input
    u = input(&NUMBER) in u;
    /// Another
    u = input(&NUMBER) in x;
}
