//! Element by element: a derivative has as many as its state.
include!("toy/fields.rs");

variables! { for Toy;
    /// States
    T = output(&NUMBER).state() in list;
    /// Their rates, but for one
    der_T as "der(T)" = local(&NUMBER).derivative_of(T) by |toy| [toy.u; 7];
}
