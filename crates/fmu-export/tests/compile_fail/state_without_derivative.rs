//! Every state has a derivative.
include!("toy/fields.rs");

variables! { for Toy;
    /// A state with one
    u = output(&NUMBER).state() in u;
    /// Its rate
    du = local(&NUMBER).derivative_of(u) by |toy| toy.u;
    /// A state without
    x = output(&NUMBER).state() in x;
}
