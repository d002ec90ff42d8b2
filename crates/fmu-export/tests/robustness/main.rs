//! Test models: any calls in any order, and threads.
#![allow(missing_docs)]

#[path = "../models/mod.rs"]
mod models;

mod sequences;
mod threads;
