//! C types from libc or, in WebAssembly, from Rust's standard library.

#[cfg(not(target_family = "wasm"))]
pub use libc::{c_char, c_int, c_uint, c_void};
#[cfg(target_family = "wasm")]
pub use std::ffi::{c_char, c_int, c_uint, c_void};
