//! Reads `modelDescription/parameters.json`, Table 1 of the paper as printed, or a file of the same format. Also converts the
//! parameters to Rust code for the build script.
//!
//! This module uses no derive macros, because every build of the library begins by compiling it, and derive macros would take
//! longer to compile than everything else in the build script.

use crate::parameters::{Integer, Parameters, Real};
use serde_core::de::{Deserialize, Deserializer, Error, MapAccess, Visitor};
use serde_json::Value;
use std::f64::consts::PI;
use std::fmt;
use std::fs;
use std::marker::PhantomData;
use std::path::Path;

/// Factor from "per degree" to "per radian". The SI value is the product of this `f64` and the `f64` nearest to the printed
/// value. In Python, `value * (180 / math.pi)` gives the same bits.
const DEG_PER_RAD: f64 = 180.0 / PI;

/// Boolean parameters, which a file for `build_fmu` may contain in addition to Table 1. Some importers set every parameter as a
/// Real, so their users can only build these values into the FMU.
const SWITCHES: [&str; 2] = ["start_at_rest", "use_omega"];

/// Reads and checks Table 1, or a file with the same parameters.
///
/// # Errors
/// The message names the file and the fault, and the parameter if the fault concerns one.
pub fn read(file: &Path) -> Result<Parameters, String> {
    named(file, |json| parse(json, &[]).map(|(parameters, _)| parameters))
}

/// Reads and checks a file that may also contain the Booleans of `SWITCHES`. Returns its start values by name.
///
/// # Errors
/// As [`read`].
pub fn read_start_values(file: &Path) -> Result<Vec<(String, String)>, String> {
    named(file, |json| {
        let (parameters, switches) = parse(json, &SWITCHES)?;
        Ok([parameters.start_values(), switches].concat())
    })
}

/// Passes the content of a file to `parse`, and names the file in the message of an error.
fn named<T>(file: &Path, parse: impl FnOnce(&str) -> Result<T, String>) -> Result<T, String> {
    let name = file.display();
    let json = fs::read_to_string(file).map_err(|error| format!("{name}: cannot be read: {error}"))?;
    parse(&json).map_err(|error| format!("{name}: {error}"))
}

/// Returns the parameters in SI units, and the values of those `switches` that the file contains.
fn parse(json: &str, switches: &[&str]) -> Result<(Parameters, Vec<(String, String)>), String> {
    let file: Object<Object<Value>> = serde_json::from_str(json).map_err(|error| error.to_string())?;
    let parameters = from_file(&file, switches)?;
    parameters.check().map_err(|error| format!("in SI units: {error}"))?;
    let mut values = Vec::new();
    for (name, entry) in file.0.iter().filter(|(name, _)| switches.contains(&name.as_str())) {
        let value = boolean(entry).map_err(|error| format!("{name}: {error}"))?;
        values.push((name.clone(), value.to_string()));
    }
    Ok((parameters, values))
}

/// Returns the value of an entry like `{ "value": true }`.
fn boolean(entry: &Object<Value>) -> Result<bool, String> {
    entry.check_names(&["value", "meaning"])?;
    let value = entry.member("value")?;
    value.as_bool().ok_or_else(|| format!("the value is {value}; write true or false"))
}

macro_rules! file {
    ($($(#[$_meaning:meta])* $name:ident: $kind:ident $_compare:tt $_limit:literal, $unit:literal;)+) => {
        /// Returns the parameters in SI units. The file may also contain `others`.
        fn from_file(file: &Object<Object<Value>>, others: &[&str]) -> Result<Parameters, String> {
            file.check_names(&[&[$(stringify!($name)),+], others].concat())?;
            Ok(Parameters {
                $($name: in_unit(file.member(stringify!($name))?, $unit)
                    .map_err(|error| format!("{}: {error}", stringify!($name)))?,)+
            })
        }

        /// Returns the parameters as a Rust expression with typed numbers, which the build script compiles into the
        /// library.
        pub fn rust_expression(parameters: &Parameters) -> String {
            let fields = [$(format!("{}: {:?}_{}", stringify!($name), parameters.$name, stringify!($kind))),+];
            let typed = fields.join(",\n    ").replace("_Real", "_f64").replace("_Integer", "_i32");
            format!("Parameters {{\n    {typed},\n}}\n")
        }
    };
}
table!(file);

/// Returns the value of an entry like `{ "value": 2.11, "unit": "N.m/deg" }` in the SI unit `si`. If this unit is per radian,
/// the entry may also be per degree.
fn in_unit<T: Number>(entry: &Object<Value>, si: &str) -> Result<T, String> {
    entry.check_names(&["value", "unit", "meaning"])?;
    let (value, unit) = (entry.member("value")?, entry.member("unit")?);
    let value = T::from_json(value).ok_or_else(|| format!("the value is {value}; write {}", T::KIND))?;
    let per_degree = si.strip_suffix("/rad").map(|quantity| format!("{quantity}/deg"));
    match (unit.as_str(), &per_degree) {
        (Some(unit), _) if unit == si => value.times(1.0),
        (Some(unit), Some(per_degree)) if unit == per_degree => value.times(DEG_PER_RAD),
        (_, Some(per_degree)) => {
            Err(format!("the unit {unit} is unknown here; use \"{per_degree}\" or \"{si}\""))
        }
        (_, None) => Err(format!("the unit {unit} is unknown here; use \"{si}\"")),
    }
}

/// A type that parameters have: [`Real`] or [`Integer`].
trait Number: Sized {
    /// Description of the values that are accepted, for error messages.
    const KIND: &str;

    /// Returns the number if it has this type.
    fn from_json(value: &Value) -> Option<Self>;

    /// Multiplies a [`Real`] by the factor of a unit conversion; fails if the product is too large. An [`Integer`] has no
    /// unit and stays unchanged.
    fn times(self, factor: f64) -> Result<Self, String>;
}

impl Number for Real {
    const KIND: &str = "a number";

    fn from_json(value: &Value) -> Option<Self> {
        value.as_f64()
    }

    fn times(self, factor: f64) -> Result<Self, String> {
        // Adding 0.0 turns -0.0 into 0.0.
        let value = self * factor + 0.0;
        if value.is_finite() { Ok(value) } else { Err("the value is too large".to_owned()) }
    }
}

impl Number for Integer {
    const KIND: &str = "an integer of 32 bits without a decimal point";

    fn from_json(value: &Value) -> Option<Self> {
        value.as_i64()?.try_into().ok()
    }

    fn times(self, _: f64) -> Result<Self, String> {
        Ok(self)
    }
}

/// The members of a JSON object in their order. It is not a map, so that two members with the same name are detected.
struct Object<T>(Vec<(String, T)>);

impl<T> Object<T> {
    fn check_names(&self, known: &[&str]) -> Result<(), String> {
        for (index, (name, _)) in self.0.iter().enumerate() {
            if !known.contains(&name.as_str()) {
                return Err(format!("unknown field `{name}`, expected one of `{}`", known.join("`, `")));
            }
            if self.0[..index].iter().any(|(other, _)| other == name) {
                return Err(format!("duplicate field `{name}`"));
            }
        }
        Ok(())
    }

    fn member(&self, name: &str) -> Result<&T, String> {
        let found = self.0.iter().find(|(other, _)| other == name);
        found.map(|(_, value)| value).ok_or_else(|| format!("missing field `{name}`"))
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Object<T> {
    fn deserialize<D: Deserializer<'de>>(object: D) -> Result<Self, D::Error> {
        object.deserialize_map(Members(PhantomData))
    }
}

struct Members<T>(PhantomData<T>);

impl<'de, T: Deserialize<'de>> Visitor<'de> for Members<T> {
    type Value = Object<T>;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("parameters like { \"k1\": { \"value\": 2.11, \"unit\": \"N.m/deg\" } }")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Object<T>, A::Error> {
        let mut members = Vec::new();
        while let Some(name) = map.next_key::<String>()? {
            let value =
                map.next_value().map_err(|error| A::Error::custom(format_args!("{name}: {error}")))?;
            members.push((name, value));
        }
        Ok(Object(members))
    }
}

#[cfg(test)]
mod tests {
    use super::{Parameters, SWITCHES, read, rust_expression};

    /// Returns the parameters of a file that may contain nothing else.
    fn parse(json: &str) -> Result<Parameters, String> {
        super::parse(json, &[]).map(|(parameters, _)| parameters)
    }

    const TABLE_1: &str = include_str!("../../modelDescription/parameters.json");

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

    /// The constant in the library is an expression that the build script has written, so its numbers must have the same
    /// bits as the parameters.
    #[test]
    fn the_expression_has_typed_numbers_with_the_same_bits() {
        let table_1 = parse(TABLE_1).unwrap();
        let mut exponents = (-40..).map(f64::from);
        for parameters in [table_1, table_1.varied(|| exponents.next().unwrap() * 16.3)] {
            let expression = rust_expression(&parameters);
            let number = |name: &str, suffix: &str| {
                let line = expression.lines().find_map(|line| line.trim().strip_prefix(&format!("{name}: ")));
                line.and_then(|line| line.strip_suffix(&format!("_{suffix},"))).unwrap().to_owned()
            };
            assert!(
                expression.starts_with("Parameters {\n    J2: ") && expression.ends_with(",\n}\n"),
                "{expression}"
            );
            assert_eq!(number("J2", "f64").parse(), Ok(parameters.J2));
            assert_eq!(number("c3", "f64").parse(), Ok(parameters.c3));
            assert_eq!(number("N", "i32").parse(), Ok(parameters.N));
            assert_eq!(expression.matches("_f64").count(), 8, "{expression}");
        }
    }

    #[test]
    fn units_per_radian_and_entries_without_meaning_are_accepted() {
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
            (entry("k1", "\"2.11\"", "N.m/deg"), "the value is \"2.11\"; write a number"),
            (entry("k1", "null", "N.m/deg"), "the value is null; write a number"),
            (entry("k1", "2.11", "N.m.s/deg"), "use \"N.m/deg\" or \"N.m/rad\""),
            (entry("J3", "1", "g.cm2"), "the unit \"g.cm2\" is unknown here; use \"kg.m2\""),
            (entry("M", "4.5", "1"), "the value is 4.5; write an integer"),
            (entry("M", "4.0", "1"), "the value is 4.0; write an integer"),
            (entry("M", "0", "1"), "must be >= 1, it is 0"),
            (entry("N", "3000000000", "1"), "the value is 3000000000; write an integer"),
            ((with_line("c3", ""), "c3".into()), "missing field `c3`"),
            ((with_line("c3", &line("c3").repeat(2)), "c3".into()), "duplicate field `c3`"),
            (
                (with_line("c3", &line("c3").replace("c3", "c9")), "`c9`".into()),
                "unknown field `c9`, expected one of `J2`, `J3`",
            ),
            ((with_line("k1", "\"k1\": 2.11,"), "k1".into()), "{ \"value\": 2.11"),
            ((with_line("k1", "\"k1\": {\"value\": 2.11},"), "k1".into()), "missing field `unit`"),
            ((line("k1").replace(',', "}"), String::new()), "line 1"),
            (("[]".into(), String::new()), "expected parameters like"),
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
    fn booleans_may_be_set_only_for_build_fmu() {
        let with = |entry: &str| TABLE_1.replacen('{', &format!("{{ {entry},"), 1);
        let read = |entry: &str| super::parse(&with(entry), &SWITCHES);
        let (parameters, switches) =
            read(r#""use_omega": { "value": true, "meaning": "rates are inputs" }"#).unwrap();
        assert_eq!(parameters, parse(TABLE_1).unwrap());
        assert_eq!(switches, [("use_omega".to_owned(), "true".to_owned())]);
        assert_eq!(read(r#""start_at_rest": { "value": false }"#).unwrap().1[0].1, "false");
        for (entry, message) in [
            (r#""use_omega": { "value": 1 }"#, "use_omega: the value is 1; write true or false"),
            (r#""use_omega": { "value": true, "unit": "1" }"#, "use_omega: unknown field `unit`"),
            (r#""use_omega": {}"#, "use_omega: missing field `value`"),
            (r#""use_omega": true"#, "use_omega: invalid type: boolean `true`, expected parameters like"),
            (r#""omega1": { "value": true }"#, "unknown field `omega1`, expected one of `J2`, `J3`"),
            (r#""M": { "value": 2, "unit": "1" }"#, "duplicate field `M`"),
        ] {
            let error = read(entry).unwrap_err();
            assert!(error.contains(message), "{error}");
        }
        // The library is compiled with Table 1 only, so the build script must not ignore a Boolean.
        assert!(
            parse(&with(r#""use_omega": { "value": true }"#))
                .unwrap_err()
                .contains("unknown field `use_omega`")
        );
    }

    #[test]
    fn the_file_is_named() {
        let error = read("no/such.json".as_ref()).unwrap_err();
        assert!(error.starts_with("no/such.json: cannot be read"), "{error}");
    }
}
