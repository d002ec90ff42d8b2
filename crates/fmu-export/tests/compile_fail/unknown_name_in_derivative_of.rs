//! Other variables are named by their names.
include!("toy/fields.rs");

variables! { for Toy;
    /// A rate
    dx = local(&NUMBER).derivative_of(w) by |toy| toy.u;
}
