//! The types of C: libc's, or where there is no C library, Rust's own.

#[cfg(not(target_family = "wasm"))]
pub use libc::{c_char, c_int, c_uint, c_void};
#[cfg(target_family = "wasm")]
pub use std::ffi::{c_char, c_int, c_uint, c_void};
