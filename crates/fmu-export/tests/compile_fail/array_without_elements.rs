//! Nobody could set it.
include!("toy/fields.rs");

variables! { for Toy;
    /// Nothing
    y = output(&NUMBER) by |_| [0.0; 0];
}
