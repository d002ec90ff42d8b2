//! Reads `modelDescription/parameters.json`, Table 1 of the paper as printed, or a file of the same format.
//!
//! The build script compiles the values into the library; `build_fmu` writes them into the model description.
//! The FMU reads no file at run time. The module uses no derive macros because every build of the library
//! begins by compiling it.

use crate::parameters::{Integer, Parameters, Real, table};
use serde_core::de::{Deserialize, Deserializer, Error, MapAccess, Visitor};
use std::f64::consts::PI;
use std::fmt;
use std::fs;
use std::marker::PhantomData;
use std::path::Path;

/// Factor from "per degree" to "per radian". The SI value is the printed value, read to the nearest double,
/// times this double, rounded once. In Python, `value * (180 / math.pi)` gives the same bits.
const DEG_PER_RAD: f64 = 180.0 / PI;

/// Reads and checks a parameter file.
///
/// # Errors
/// The message names the file, the parameter and the fault.
pub fn read(file: &Path) -> Result<Parameters, String> {
    let name = file.display();
    let json = fs::read_to_string(file).map_err(|error| format!("{name}: cannot be read: {error}"))?;
    parse(&json).map_err(|error| format!("{name}: {error}"))
}

fn parse(json: &str) -> Result<Parameters, String> {
    let File(parameters) = serde_json::from_str(json).map_err(|error| error.to_string())?;
    parameters.check().map_err(|error| format!("in SI units: {error}"))?;
    Ok(parameters)
}

/// The parameters of a file in SI units.
struct File(Parameters);

struct FileVisitor;

impl<'de> Deserialize<'de> for File {
    fn deserialize<D: Deserializer<'de>>(file: D) -> Result<Self, D::Error> {
        file.deserialize_map(FileVisitor)
    }
}

macro_rules! file {
    ($($(#[$_meaning:meta])* $name:ident: $kind:ident $_compare:tt $_limit:literal, $unit:literal;)+) => {
        const NAMES: &[&str] = &[$(stringify!($name)),+];

        impl<'de> Visitor<'de> for FileVisitor {
            type Value = File;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("an object with the parameters")
            }

            #[allow(non_snake_case, reason = "the paper's symbols")]
            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<File, A::Error> {
                $(let mut $name = None;)+
                while let Some(key) = map.next_key::<String>()? {
                    let named = |error: A::Error| A::Error::custom(format_args!("{key}: {error}"));
                    match key.as_str() {
                        $(stringify!($name) => {
                            let entry: Entry<$kind> = map.next_value().map_err(named)?;
                            let value = entry.in_unit($unit).map_err(A::Error::custom).map_err(named)?;
                            fill(&mut $name, value as $kind, stringify!($name))?;
                        })+
                        unknown => return Err(A::Error::unknown_field(unknown, NAMES)),
                    }
                }
                Ok(File(Parameters {
                    $($name: $name.ok_or_else(|| A::Error::missing_field(stringify!($name)))?,)+
                }))
            }
        }
    };
}
table!(file);

/// Stores a member of an object; rejects a second value.
fn fill<T, E: Error>(member: &mut Option<T>, value: T, name: &'static str) -> Result<(), E> {
    match member.replace(value) {
        None => Ok(()),
        Some(_) => Err(E::duplicate_field(name)),
    }
}

/// A value with its unit.
struct Entry<T> {
    value: T,
    unit: String,
}

struct EntryVisitor<T>(PhantomData<T>);

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Entry<T> {
    fn deserialize<D: Deserializer<'de>>(entry: D) -> Result<Self, D::Error> {
        entry.deserialize_map(EntryVisitor(PhantomData))
    }
}

impl<'de, T: Deserialize<'de>> Visitor<'de> for EntryVisitor<T> {
    type Value = Entry<T>;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("an object like { \"value\": 2.11, \"unit\": \"N.m/deg\" }")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Entry<T>, A::Error> {
        let (mut value, mut unit, mut meaning) = (None, None, None);
        while let Some(key) = map.next_key::<String>()? {
            match key.as_str() {
                "value" => fill(&mut value, map.next_value()?, "value")?,
                "unit" => fill(&mut unit, map.next_value()?, "unit")?,
                "meaning" => fill(&mut meaning, map.next_value::<String>()?, "meaning")?,
                unknown => return Err(A::Error::unknown_field(unknown, &["value", "unit", "meaning"])),
            }
        }
        Ok(Entry {
            value: value.ok_or_else(|| A::Error::missing_field("value"))?,
            unit: unit.ok_or_else(|| A::Error::missing_field("unit"))?,
        })
    }
}

impl<T: Into<f64>> Entry<T> {
    /// Converts the value to an SI unit; a value per radian may be given per degree.
    fn in_unit(self, si: &str) -> Result<f64, String> {
        let per_degree = si.strip_suffix("/rad").map(|quantity| format!("{quantity}/deg"));
        let factor = match &per_degree {
            _ if self.unit == si => 1.0,
            Some(unit) if self.unit == *unit => DEG_PER_RAD,
            Some(unit) => {
                return Err(format!(
                    "the unit \"{}\" is unknown here; use \"{unit}\" or \"{si}\"",
                    self.unit
                ));
            }
            None => return Err(format!("the unit \"{}\" is unknown here; use \"{si}\"", self.unit)),
        };
        // Adding 0.0 turns -0.0 into 0.0.
        let value = self.value.into() * factor + 0.0;
        if value.is_finite() { Ok(value) } else { Err("the value is too large".to_owned()) }
    }
}

#[cfg(test)]
mod tests {
    use super::{parse, read};

    const TABLE_1: &str = include_str!("../modelDescription/parameters.json");

    /// Returns the line of Table 1 that contains this key.
    fn line(key: &str) -> &'static str {
        TABLE_1.lines().find(|line| line.contains(&format!("\"{key}\""))).unwrap()
    }

    fn with_line(key: &str, new: &str) -> String {
        TABLE_1.replace(line(key), new)
    }

    #[test]
    fn table_1_is_read_to_the_last_bit() {
        let p = parse(TABLE_1).unwrap();
        // The expected values come from Python: 2.11 * (180 / math.pi) and so on.
        assert_eq!((p.J2, p.k1, p.k2), (3.8681291e-3, 120.8940947726037, 43.54479242994257));
        assert_eq!((p.c1, p.c2, p.c3), (0.4486259535874346, 0.4784197589342374, 0.3815898915571283));
        assert_eq!((p.M, p.N), (4, 7));
    }

    #[test]
    fn units_per_radian_and_entries_without_meaning_are_taken() {
        let json = with_line("k1", r#""k1": {"value": 120, "unit": "N.m/rad"},"#);
        assert_eq!(parse(&json).unwrap().k1, 120.0);
        let json = with_line("c3", r#""c3": {"unit": "N.m.s/rad", "value": -0.0},"#);
        assert!(parse(&json).unwrap().c3.is_sign_positive());
    }

    #[test]
    fn invalid_files_have_an_error() {
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
            (entry("c3", "-1e-9", "N.m.s/deg"), "must be >= 0, it is -0.0000000572957795"),
            (entry("k1", "1e308", "N.m/deg"), "too large"),
            (entry("k1", "1e999", "N.m/deg"), "out of range at line 5"),
            (entry("k1", "NaN", "N.m/deg"), "expected value at line 5"),
            (entry("k1", "\"2.11\"", "N.m/deg"), "invalid type: string \"2.11\", expected f64 at line 5"),
            (entry("k1", "null", "N.m/deg"), "invalid type: null, expected f64"),
            (entry("k1", "2.11", "N.m.s/deg"), "use \"N.m/deg\" or \"N.m/rad\""),
            (entry("J3", "1", "g.cm2"), "the unit \"g.cm2\" is unknown here; use \"kg.m2\""),
            (entry("M", "4.5", "1"), "`4.5`, expected i32"),
            (entry("M", "4.0", "1"), "`4.0`, expected i32"),
            (entry("M", "0", "1"), "must be >= 1, it is 0"),
            (entry("N", "3000000000", "1"), "`3000000000`, expected i32"),
            ((with_line("c3", ""), "c3".into()), "missing field `c3`"),
            ((with_line("c3", &line("c3").repeat(2)), "c3".into()), "duplicate field `c3`"),
            (
                (with_line("c3", &line("c3").replace("c3", "c9")), "`c9`".into()),
                "unknown field `c9`, expected one of `J2`, `J3`",
            ),
            ((with_line("k1", "\"k1\": 2.11,"), "k1".into()), "an object like { \"value\""),
            ((with_line("k1", "\"k1\": {\"value\": 2.11},"), "k1".into()), "missing field `unit`"),
            ((line("k1").replace(',', "}"), String::new()), "line 1"),
            (("[]".into(), String::new()), "an object with the parameters"),
            ((String::new(), String::new()), "line 1"),
            ((TABLE_1.replace("7.83", "0").replace("8.35", "0"), "c1 and c2".into()), "must not both be 0"),
        ];
        for ((json, key), message) in cases {
            match parse(&json) {
                Ok(_) => assert_eq!(message, "", "{json}"),
                Err(error) => {
                    assert!(
                        !message.is_empty() && error.contains(&key) && error.contains(message),
                        "{error}\n{json}"
                    );
                }
            }
        }
    }

    #[test]
    fn the_file_is_named() {
        let error = read("no/such.json".as_ref()).unwrap_err();
        assert!(error.starts_with("no/such.json: cannot be read"), "{error}");
    }
}
