//! A state lives somewhere.
include!("toy/fields.rs");

variables! { for Toy;
    /// A state
    x = output(&NUMBER).state() by |toy| toy.x;
    /// Its rate
    dx = local(&NUMBER).derivative_of(x) by |toy| toy.u;
}
