//! What FMI 3.0 has more.
include!("toy/fields.rs");

variables! { for Toy;
    /// Ticks
    tick = clock(&BOOLEAN);
    /// How many
    n = structural_parameter(&INTEGER) in n;
}
