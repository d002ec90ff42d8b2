//! Features that exist only in FMI 3.0, or differ from FMI 2.0.

mod arrays;
mod call_table;
mod derivatives;
mod events;
mod hostile;
mod same;
mod states;
mod values;
