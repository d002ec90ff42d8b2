//! What a description has that the model as it was compiled has not.

use crate::variant::Variant;
use anyhow::{Result, bail};
use fmu_export::{BaseType, Value};

/// What differs from the model as it was compiled.
#[derive(Clone, Debug, Default)]
pub struct Changes {
    /// Another guid.
    pub guid: Option<String>,
    /// Other start values: the variable's name, and the value as the description has it.
    pub start: Vec<(String, String)>,
    /// Parameters are `tunable` instead of `fixed`.
    pub tunable_parameters: bool,
}

impl From<&Variant> for Changes {
    fn from(variant: &Variant) -> Self {
        Self { guid: Some(variant.guid()), start: variant.start.clone(), tunable_parameters: variant.tunable }
    }
}

/// The value that a text stands for.
pub(crate) fn read_value(base: BaseType, text: &str) -> Result<Value> {
    let value = match base {
        BaseType::Real => text.parse().ok().map(Value::Real),
        BaseType::Integer | BaseType::Enumeration => text.parse().ok().map(Value::Integer),
        BaseType::Boolean => text.parse().ok().map(Value::Boolean),
        _ => Some(Value::String(text.to_owned())),
    };
    match value {
        Some(value) => Ok(value),
        None => bail!("it is {base}, which '{}' is not", text.escape_debug()),
    }
}
