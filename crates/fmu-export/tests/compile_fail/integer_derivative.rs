//! Only a Real has a rate.
include!("toy/fields.rs");

variables! { for Toy;
    /// A state
    x = output(&NUMBER).state() in x;
    /// Its rate
    n = local(&INTEGER).derivative_of(x) by |toy| toy.n;
}
