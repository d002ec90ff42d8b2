//! C types from libc, or from Rust's standard library on targets without a C library.

#[cfg(not(target_family = "wasm"))]
pub use libc::{c_char, c_int, c_uint, c_void};
#[cfg(target_family = "wasm")]
pub use std::ffi::{c_char, c_int, c_uint, c_void};
