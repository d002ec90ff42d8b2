//! The time is the instance's.
include!("toy/fields.rs");

variables! { for Toy;
    /// The time
    time = independent(&TIME) by |toy| toy.x;
}
