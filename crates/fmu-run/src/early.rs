//! Values that an instance cannot read back yet.

use fmi_abi::Value;
use std::collections::HashMap;

/// Values of arrays that were set before the initialization, by array index. They cannot be read then.
#[derive(Debug, Default)]
pub(crate) struct EarlyValues {
    pub numbers: HashMap<usize, Vec<f64>>,
    pub values: HashMap<usize, Vec<Value>>,
}
