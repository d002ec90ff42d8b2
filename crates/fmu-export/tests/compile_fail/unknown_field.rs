//! A place is a field of the model.
include!("toy/fields.rs");

variables! { for Toy;
    /// An input
    u = input(&NUMBER) in w;
}
