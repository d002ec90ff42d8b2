//! A parameter is fixed or tunable (section 2.2.7).
include!("toy/fields.rs");

variables! { for Toy;
    /// A parameter
    gain = parameter(&NUMBER).discrete() in x;
}
