//! Names are unique for importers, too.
include!("toy/fields.rs");

variables! { for Toy;
    /// An input
    u = input(&NUMBER) in u;
    /// Another
    w as "u" = input(&NUMBER) in x;
}
