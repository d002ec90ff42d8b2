//! Only a Real is continuous (section 2.2.7).
include!("toy/fields.rs");

variables! { for Toy;
    /// A state
    n = output(&INTEGER).state() in n;
}
