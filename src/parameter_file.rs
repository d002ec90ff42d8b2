//! Reads `modelDescription/parameters.json`, Table 1 of the paper as printed, or a file like it.
//!
//! The build script bakes the values into the library, `build_fmu` writes them into the model
//! description; nothing is read at run time.

use serde::Deserialize;
use serde::de::{Deserializer, Error as _, MapAccess, Visitor};
use serde_json::Number;
use std::f64::consts::PI;
use std::path::Path;
use std::{fmt, fs};

/// Turns "per degree" into "per radian". The value in SI is the printed value, read to the nearest double,
/// times this double, rounded once: `value * (180 / math.pi)` in Python gives the same bits.
const DEG_PER_RAD: f64 = 180.0 / PI;

/// What the value of a parameter may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Range {
    Positive,
    NotNegative,
    Count,
}

/// A unit that a file may use, with its factor to SI.
type Unit = (&'static str, f64);

const INERTIA: &[Unit] = &[("kg.m2", 1.0)];
const STIFFNESS: &[Unit] = &[("N.m/deg", DEG_PER_RAD), ("N.m/rad", 1.0)];
const DAMPING: &[Unit] = &[("N.m.s/deg", DEG_PER_RAD), ("N.m.s/rad", 1.0)];
const NUMBER: &[Unit] = &[("1", 1.0)];

const KEYS: [(&str, &[Unit], Range); 10] = [
    ("J2", INERTIA, Range::Positive),
    ("J3", INERTIA, Range::Positive),
    ("H3", INERTIA, Range::Positive),
    ("k1", STIFFNESS, Range::Positive),
    ("k2", STIFFNESS, Range::Positive),
    ("c1", DAMPING, Range::NotNegative),
    ("c2", DAMPING, Range::NotNegative),
    ("c3", DAMPING, Range::NotNegative),
    ("M", NUMBER, Range::Count),
    ("N", NUMBER, Range::Count),
];

/// The value of a parameter in SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    /// Of an inertia, a stiffness or a damping coefficient.
    Real(f64),
    /// Of a number of lobes or rollers.
    Integer(i32),
}

/// Prints as Rust does, so that reading it gives the same bits.
impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Real(value) => write!(f, "{value:?}"),
            Self::Integer(value) => write!(f, "{value}"),
        }
    }
}

/// A checked set of all parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterSet([(&'static str, Value); KEYS.len()]);

impl ParameterSet {
    /// Reads and checks a file.
    ///
    /// # Errors
    /// Names the file, the parameter and what to do.
    pub fn read(file: &Path) -> Result<Self, ParameterFileError> {
        let error = |message: String| ParameterFileError(format!("{}: {message}", file.display()));
        let text = fs::read_to_string(file).map_err(|e| error(format!("cannot be read: {e}")))?;
        Self::parse(&text).map_err(|ParameterFileError(message)| error(message))
    }

    /// Checks the text of a file.
    ///
    /// # Errors
    /// Names the parameter and what to do.
    pub fn parse(text: &str) -> Result<Self, ParameterFileError> {
        let File(entries) = serde_json::from_str(text).map_err(|e| ParameterFileError(e.to_string()))?;
        if let Some((stranger, _)) = entries.iter().find(|(key, _)| KEYS.iter().all(|(name, ..)| name != key))
        {
            let known = KEYS.map(|(name, ..)| name).join(", ");
            return refuse(format!(
                "\"{stranger}\" is no parameter of the testbed; the parameters are {known}"
            ));
        }
        let mut set = [("", Value::Integer(0)); KEYS.len()];
        for (place, (key, units, range)) in set.iter_mut().zip(KEYS) {
            let mut values = entries.iter().filter(|(name, _)| name == key).map(|(_, entry)| entry);
            let Some(entry) = values.next() else {
                let unit = units[0].0;
                return refuse(format!(
                    "{key} is missing; add \"{key}\": {{ \"value\": ..., \"unit\": \"{unit}\" }}"
                ));
            };
            if values.next().is_some() {
                return refuse(format!("{key} is there twice; remove one of them"));
            }
            *place = (key, entry.value(units, range).map_err(|e| ParameterFileError(format!("{key}: {e}")))?);
        }
        let set = Self(set);
        if ["c1", "c2"].iter().all(|key| set.get(key) == Some(Value::Real(0.0))) {
            return refuse(
                "c1 and c2 are both 0; give one of them a positive value, because the massless shafts between \
                 the couplings need damping",
            );
        }
        Ok(set)
    }

    /// The value of a parameter.
    pub fn get(&self, key: &str) -> Option<Value> {
        self.iter().find(|(name, _)| *name == key).map(|(_, value)| value)
    }

    /// All parameters with their values, in the order of Table 1.
    pub fn iter(&self) -> impl Iterator<Item = (&'static str, Value)> {
        self.0.iter().copied()
    }
}

/// The set as a literal of the struct `Parameters`, in Rust.
impl fmt::Display for ParameterSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Parameters {")?;
        for (key, value) in self.iter() {
            write!(f, " {key}: {value},")?;
        }
        f.write_str(" }")
    }
}

/// Why a file is no set of parameters.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ParameterFileError(String);

impl fmt::Display for ParameterFileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for ParameterFileError {}

fn refuse<T>(message: impl Into<String>) -> Result<T, ParameterFileError> {
    Err(ParameterFileError(message.into()))
}

/// The entries in the order of the file, with those that are there twice.
struct File(Vec<(String, Entry)>);

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "an object like { \"value\": 2.11, \"unit\": \"N.m/deg\" }")]
struct Entry {
    value: serde_json::Value,
    unit: String,
    #[serde(default, rename = "meaning")]
    _meaning: Option<String>,
}

impl Entry {
    fn value(&self, units: &[Unit], range: Range) -> Result<Value, String> {
        let Some((_, factor)) = units.iter().find(|(name, _)| *name == self.unit) else {
            let known: Vec<_> = units.iter().map(|(name, _)| format!("\"{name}\"")).collect();
            return Err(format!("the unit \"{}\" is unknown here; use {}", self.unit, known.join(" or ")));
        };
        let Some(number) = self.value.as_number() else {
            return Err(format!("the value must be a number, it is {}", self.value));
        };
        if range == Range::Count {
            return count(number);
        }
        let value = number.as_f64().unwrap_or(f64::NAN) * factor;
        if !value.is_finite() {
            return Err(format!("the value {number} is too large"));
        }
        match range {
            Range::Positive if value <= 0.0 => Err(format!("the value must be > 0, it is {number}")),
            Range::NotNegative if value < 0.0 => Err(format!("the value must be >= 0, it is {number}")),
            // -0.0 becomes 0.0.
            _ => Ok(Value::Real(value + 0.0)),
        }
    }
}

fn count(number: &Number) -> Result<Value, String> {
    number
        .as_i64()
        .and_then(|value| i32::try_from(value).ok())
        .filter(|value| *value >= 1)
        .map(Value::Integer)
        .ok_or_else(|| format!("the value must be a whole number >= 1, it is {number}"))
}

impl<'de> Deserialize<'de> for File {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(Entries)
    }
}

struct Entries;

impl<'de> Visitor<'de> for Entries {
    type Value = File;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an object with the parameters")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<File, A::Error> {
        let mut entries = Vec::new();
        while let Some(key) = map.next_key::<String>()? {
            let entry = map.next_value().map_err(|error| A::Error::custom(format!("{key}: {error}")))?;
            entries.push((key, entry));
        }
        Ok(File(entries))
    }
}

#[cfg(test)]
mod tests {
    use super::{KEYS, ParameterSet, Value};

    const TABLE_1: &str = include_str!("../modelDescription/parameters.json");

    /// The line of Table 1 with this key.
    fn line(key: &str) -> &'static str {
        TABLE_1.lines().find(|line| line.contains(&format!("\"{key}\""))).unwrap()
    }

    fn with_line(key: &str, new: &str) -> String {
        TABLE_1.replace(line(key), new)
    }

    #[test]
    fn table_1_is_read_to_the_last_bit() {
        let set = ParameterSet::parse(TABLE_1).unwrap();
        // From Python: 2.11 * (180 / math.pi) and so on.
        for (key, value) in [
            ("J2", 3.8681291e-3),
            ("k1", 120.8940947726037),
            ("k2", 43.54479242994257),
            ("c1", 0.4486259535874346),
            ("c2", 0.4784197589342374),
            ("c3", 0.3815898915571283),
        ] {
            assert_eq!(set.get(key), Some(Value::Real(value)), "{key}");
        }
        assert_eq!((set.get("M"), set.get("N")), (Some(Value::Integer(4)), Some(Value::Integer(7))));
        assert_eq!(set.iter().map(|(key, _)| key).collect::<Vec<_>>(), KEYS.map(|(key, ..)| key));
        assert!(set.to_string().starts_with("Parameters { J2: 0.0038681291, "), "{set}");
        assert!(set.to_string().ends_with(", c3: 0.3815898915571283, M: 4, N: 7, }"), "{set}");
    }

    #[test]
    fn units_per_radian_and_entries_without_meaning_are_taken() {
        let text = with_line("k1", r#""k1": {"value": 120, "unit": "N.m/rad"},"#);
        assert_eq!(ParameterSet::parse(&text).unwrap().get("k1"), Some(Value::Real(120.0)));
        let text = with_line("c3", r#""c3": {"unit": "N.m.s/rad", "value": -0.0},"#);
        assert_eq!(ParameterSet::parse(&text).unwrap().to_string().matches("c3: 0.0,").count(), 1);
    }

    #[test]
    fn what_is_wrong_with_a_file_is_said() {
        let entry = |key: &str, value: &str, unit: &str| {
            let comma = if key == "N" { "" } else { "," };
            (
                with_line(key, &format!(r#""{key}": {{ "value": {value}, "unit": "{unit}" }}{comma}"#)),
                key.to_owned(),
            )
        };
        let cases = [
            (entry("J2", "0", "kg.m2"), "must be > 0, it is 0"),
            (entry("H3", "-1.5", "kg.m2"), "must be > 0, it is -1.5"),
            (entry("k2", "0.0", "N.m/deg"), "must be > 0"),
            (entry("k2", "5e-324", "N.m/rad"), ""),
            (entry("c3", "-1e-9", "N.m.s/deg"), "must be >= 0, it is -1e-9"),
            (entry("k1", "1e308", "N.m/deg"), "too large"),
            (entry("k1", "1e999", "N.m/deg"), "out of range at line 5"),
            (entry("k1", "NaN", "N.m/deg"), "expected value at line 5"),
            (entry("k1", "\"2.11\"", "N.m/deg"), "must be a number, it is \"2.11\""),
            (entry("k1", "null", "N.m/deg"), "must be a number, it is null"),
            (entry("k1", "2.11", "N.m.s/deg"), "use \"N.m/deg\" or \"N.m/rad\""),
            (entry("J3", "1", "g.cm2"), "the unit \"g.cm2\" is unknown here; use \"kg.m2\""),
            (entry("M", "4.5", "1"), "whole number >= 1, it is 4.5"),
            (entry("M", "4.0", "1"), "whole number >= 1, it is 4.0"),
            (entry("M", "0", "1"), "whole number >= 1"),
            (entry("N", "3000000000", "1"), "whole number >= 1"),
            (
                (with_line("c3", ""), "c3".into()),
                "is missing; add \"c3\": { \"value\": ..., \"unit\": \"N.m.s/deg\" }",
            ),
            ((with_line("c3", &line("c3").repeat(2)), "c3".into()), "is there twice"),
            (
                (with_line("c3", &line("c3").replace("c3", "c4")), "\"c4\"".into()),
                "the parameters are J2, J3",
            ),
            ((with_line("k1", "\"k1\": 2.11,"), "k1".into()), "an object like { \"value\""),
            ((with_line("k1", "\"k1\": {\"value\": 2.11},"), "k1".into()), "missing field `unit`"),
            ((line("k1").replace(',', "}"), String::new()), "line 1"),
            (("[]".into(), String::new()), "an object with the parameters"),
            ((String::new(), String::new()), "line 1"),
            ((TABLE_1.replace("7.83", "0").replace("8.35", "0"), "c1 and c2".into()), "are both 0"),
        ];
        for ((text, key), message) in cases {
            match ParameterSet::parse(&text) {
                Ok(_) => assert_eq!(message, "", "{text}"),
                Err(error) => {
                    let error = error.to_string();
                    assert!(
                        !message.is_empty() && error.contains(&key) && error.contains(message),
                        "{error}\n{text}"
                    );
                }
            }
        }
    }

    #[test]
    fn the_file_is_named() {
        let error = ParameterSet::read("no/such.json".as_ref()).unwrap_err().to_string();
        assert!(error.starts_with("no/such.json: cannot be read"), "{error}");
    }
}
