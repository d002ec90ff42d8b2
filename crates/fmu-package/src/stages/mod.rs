//! The stages of a build. Each takes the result of the stage before it, and the plan, which is made from the options before the first.

mod check;
mod compile;
mod describe;
mod pack;
mod page;
mod plan;

pub use check::pass_checker;
pub(crate) use check::{check, passed_checker};
pub(crate) use compile::compile;
pub(crate) use describe::describe;
pub(crate) use pack::pack;
pub use page::Page;
pub(crate) use page::page;
pub(crate) use plan::Plan;
