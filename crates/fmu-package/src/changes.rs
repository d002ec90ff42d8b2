//! What a description has that the model as it was compiled has not.

use crate::variant::Variant;
use anyhow::{Result, bail};
use fmu_export::{BaseType, Value};

/// What differs from the model as it was compiled.
#[derive(Clone, Debug, Default)]
pub struct Changes {
    /// Another guid.
    pub guid: Option<String>,
    /// Other start values: the variable's name, and the value as the description has it; bytes are two hexadecimal
    /// digits each.
    pub start: Vec<(String, String)>,
    /// Parameters are `tunable` instead of `fixed`.
    pub tunable_parameters: bool,
    /// The files of the folder `sources` that an importer compiles (FMI 2.0).
    pub source_files: Vec<String>,
}

impl From<&Variant> for Changes {
    fn from(variant: &Variant) -> Self {
        Self {
            guid: Some(variant.guid()),
            start: variant.start.clone(),
            tunable_parameters: variant.tunable,
            source_files: Vec::new(),
        }
    }
}

/// The value that a text stands for.
pub(crate) fn read_value(base: BaseType, text: &str) -> Result<Value> {
    let value = match base {
        BaseType::Real => text.parse().ok().map(Value::Real),
        BaseType::Float32 => text.parse().ok().map(|value: f32| Value::Real(value.into())),
        BaseType::Enumeration => text.parse().ok().map(|value: i32| Value::Integer(value.into())),
        BaseType::Boolean => text.parse().ok().map(Value::Boolean),
        BaseType::Binary => bytes(text).map(Value::Binary),
        _ => match base.range() {
            Some((min, max)) => {
                text.parse().ok().filter(|value| (min..=max).contains(value)).map(Value::Integer)
            }
            None => Some(Value::String(text.to_owned())),
        },
    };
    match value {
        Some(value) => Ok(value),
        None => bail!("it is {base}, which '{}' is not", text.escape_debug()),
    }
}

/// Two digits for each.
fn bytes(hexadecimal: &str) -> Option<Vec<u8>> {
    let digit = |byte: &u8| char::from(*byte).to_digit(16);
    let digits: Vec<u32> = hexadecimal.as_bytes().iter().map(digit).collect::<Option<_>>()?;
    let (pairs, rest) = digits.as_chunks();
    let byte = |[high, low]: &[u32; 2]| u8::try_from(16 * high + low).ok();
    if rest.is_empty() { pairs.iter().map(byte).collect() } else { None }
}
