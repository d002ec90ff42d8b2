//! Users read what a variable is.
include!("toy/fields.rs");

variables! { for Toy;
    u = input(&NUMBER) in u;
}
