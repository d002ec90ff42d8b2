//! What FMI 3.0 alone has, or has another way.

mod arrays;
mod call_table;
mod derivatives;
mod events;
mod hostile;
mod same;
mod states;
mod values;
