//! What importers set lives somewhere.
include!("toy/fields.rs");

variables! { for Toy;
    /// A parameter
    gain = parameter(&NUMBER) by |toy| toy.x;
}
