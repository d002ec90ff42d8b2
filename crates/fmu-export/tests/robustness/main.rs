//! Toy models under abuse: any calls in any order, and threads.
#![allow(missing_docs)]

#[path = "../toys/mod.rs"]
mod toys;

mod sequences;
mod threads;
