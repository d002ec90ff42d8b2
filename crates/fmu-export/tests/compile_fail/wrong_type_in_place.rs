//! An Integer lives in an i32.
include!("toy/fields.rs");

variables! { for Toy;
    /// An output
    y = output(&INTEGER) in x;
}
