//! Names of elements are names.
include!("toy/fields.rs");

variables! { for Toy;
    /// Its elements are T[1], T[2] and so on
    T = input(&NUMBER) in list;
    /// One of them again
    T3 as "T[3]" = input(&NUMBER) in u;
}
