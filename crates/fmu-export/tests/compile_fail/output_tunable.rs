//! An output is no parameter (section 2.2.7).
include!("toy/fields.rs");

variables! { for Toy;
    /// An output
    y = output(&NUMBER).tunable() in x;
}
