//! No variable is a character.
include!("toy/fields.rs");

variables! { for Toy;
    /// An output
    y = output(&INTEGER) by |_| '7';
}
