//! A parameter has an exact value (section 2.2.7).
include!("toy/fields.rs");

variables! { for Toy;
    /// A parameter
    gain = parameter(&NUMBER).approx() in x;
}
