//! The meaning of the names of units, such as `N.m/rad`, `kW.h` or `W/(m2.K)`.

use crate::{BASE_UNITS, BaseUnit};
use std::f64::consts::PI;

/// Symbols that prefixes may precede: the units of the SI with special names and base units, except the kilogram, and some others.
#[rustfmt::skip]
const PREFIXED: &[(&str, [i32; BASE_UNITS.len()], f64)] = &[
    // kg m s A K mol cd rad
    ("m", [0, 1, 0, 0, 0, 0, 0, 0], 1.0), ("g", [1, 0, 0, 0, 0, 0, 0, 0], 1e-3), ("s", [0, 0, 1, 0, 0, 0, 0, 0], 1.0),
    ("A", [0, 0, 0, 1, 0, 0, 0, 0], 1.0), ("K", [0, 0, 0, 0, 1, 0, 0, 0], 1.0), ("mol", [0, 0, 0, 0, 0, 1, 0, 0], 1.0),
    ("cd", [0, 0, 0, 0, 0, 0, 1, 0], 1.0), ("rad", [0, 0, 0, 0, 0, 0, 0, 1], 1.0), ("Hz", [0, 0, -1, 0, 0, 0, 0, 0], 1.0),
    ("N", [1, 1, -2, 0, 0, 0, 0, 0], 1.0), ("Pa", [1, -1, -2, 0, 0, 0, 0, 0], 1.0), ("J", [1, 2, -2, 0, 0, 0, 0, 0], 1.0),
    ("W", [1, 2, -3, 0, 0, 0, 0, 0], 1.0), ("VA", [1, 2, -3, 0, 0, 0, 0, 0], 1.0), ("var", [1, 2, -3, 0, 0, 0, 0, 0], 1.0),
    ("C", [0, 0, 1, 1, 0, 0, 0, 0], 1.0), ("V", [1, 2, -3, -1, 0, 0, 0, 0], 1.0), ("F", [-1, -2, 4, 2, 0, 0, 0, 0], 1.0),
    ("Ohm", [1, 2, -3, -2, 0, 0, 0, 0], 1.0), ("ohm", [1, 2, -3, -2, 0, 0, 0, 0], 1.0), ("S", [-1, -2, 3, 2, 0, 0, 0, 0], 1.0),
    ("Wb", [1, 2, -2, -1, 0, 0, 0, 0], 1.0), ("T", [1, 0, -2, -1, 0, 0, 0, 0], 1.0), ("H", [1, 2, -2, -2, 0, 0, 0, 0], 1.0),
    ("l", [0, 3, 0, 0, 0, 0, 0, 0], 1e-3), ("L", [0, 3, 0, 0, 0, 0, 0, 0], 1e-3), ("bar", [1, -1, -2, 0, 0, 0, 0, 0], 1e5),
    ("Wh", [1, 2, -2, 0, 0, 0, 0, 0], 3600.0), ("Ah", [0, 0, 1, 1, 0, 0, 0, 0], 3600.0),
];

/// Symbols without prefixes. Among them are those that could also be read as a prefix and a symbol.
#[rustfmt::skip]
const OTHERS: &[(&str, [i32; BASE_UNITS.len()], f64)] = &[
    ("1", [0; 8], 1.0), ("%", [0; 8], 0.01),
    ("min", [0, 0, 1, 0, 0, 0, 0, 0], 60.0), ("h", [0, 0, 1, 0, 0, 0, 0, 0], 3600.0), ("d", [0, 0, 1, 0, 0, 0, 0, 0], 86_400.0),
    ("t", [1, 0, 0, 0, 0, 0, 0, 0], 1e3), ("deg", [0, 0, 0, 0, 0, 0, 0, 1], PI / 180.0), ("degC", [0, 0, 0, 0, 1, 0, 0, 0], 1.0),
];

/// Prefixes, each with its factor.
#[rustfmt::skip]
const PREFIXES: [(&str, f64); 14] = [
    ("p", 1e-12), ("n", 1e-9), ("u", 1e-6), ("µ", 1e-6), ("μ", 1e-6), ("m", 1e-3), ("c", 1e-2), ("d", 1e-1), ("h", 1e2), ("k", 1e3),
    ("M", 1e6), ("G", 1e9), ("T", 1e12), ("da", 1e1),
];

/// The offset of the degree Celsius, which it has only if it is the whole unit.
const CELSIUS: f64 = 273.15;

impl BaseUnit {
    /// Returns the unit that this name usually means, or `None` if the name is not a product of powers of known units. A quotient has one
    /// divisor, in parentheses if it is a product.
    ///
    /// ```
    /// use fmi_abi::BaseUnit;
    ///
    /// let torque = BaseUnit::of_name("mN.m").unwrap();
    /// assert_eq!(torque.to_string(), "0.001 kg.m2.s-2");
    /// assert_eq!(BaseUnit::of_name("W/m2.K"), None);
    /// ```
    pub fn of_name(name: &str) -> Option<Self> {
        if name == "degC" {
            return Some(Self { offset: CELSIUS, ..symbol(name)? });
        }
        let Some((dividend, divisor)) = name.split_once('/') else { return product(name) };
        let is_single = !divisor.contains(['.', '*', '(', ')', '/']);
        let divisor = match divisor.strip_prefix('(').and_then(|divisor| divisor.strip_suffix(')')) {
            Some(inner) => inner,
            None if is_single => divisor,
            None => return None,
        };
        Some(product(dividend)?.times(&product(divisor)?, -1))
    }

    /// Returns the product with a power of another unit, without offsets.
    fn times(mut self, other: &Self, power: i32) -> Self {
        for (exponent, other) in self.exponents.iter_mut().zip(other.exponents) {
            *exponent += power * other;
        }
        Self { factor: self.factor * other.factor.powi(power), offset: 0.0, ..self }
    }
}

/// Returns a product of powers.
fn product(name: &str) -> Option<BaseUnit> {
    name.split(['.', '*']).try_fold(BaseUnit::ONE, |product, power| {
        let digits = power.trim_end_matches(|c: char| c.is_ascii_digit());
        let base = digits.strip_suffix('-').unwrap_or(digits);
        match base {
            // A number is a unit only as 1.
            "" => (power == "1").then_some(product),
            _ => {
                let exponent = &power[base.len()..];
                let exponent = if exponent.is_empty() { 1 } else { exponent.parse().ok()? };
                // Larger exponents are not units.
                (-9..=9).contains(&exponent).then_some(())?;
                Some(product.times(&symbol(base.strip_suffix('^').unwrap_or(base))?, exponent))
            }
        }
    })
}

/// Returns the unit of a symbol.
fn symbol(symbol: &str) -> Option<BaseUnit> {
    let of = |table: &[(&str, [i32; BASE_UNITS.len()], f64)], symbol: &str, scale: f64| {
        let (_, exponents, factor) = table.iter().find(|(name, ..)| *name == symbol)?;
        Some(BaseUnit { exponents: *exponents, factor: scale * factor, offset: 0.0 })
    };
    let prefixed =
        || PREFIXES.iter().find_map(|(prefix, scale)| of(PREFIXED, symbol.strip_prefix(prefix)?, *scale));
    of(OTHERS, symbol, 1.0).or_else(|| of(PREFIXED, symbol, 1.0)).or_else(prefixed)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Compares with the definitions of the SI.
    #[test]
    fn names_have_their_usual_meaning() {
        for (name, unit) in [
            ("1", "1"),
            ("kg.m2", "1 kg.m2"),
            ("N.m/rad", "1 kg.m2.s-2.rad-1"),
            ("m/s^2", "1 m.s-2"),
            ("m.s-2", "1 m.s-2"),
            ("1/s", "1 s-1"),
            ("mH", "0.001 kg.m2.s-2.A-2"),
            ("A.h", "3600 s.A"),
            ("min", "60 s"),
            ("mm", "0.001 m"),
            ("cd", "1 cd"),
            ("W/(m2.K)", "1 kg.s-3.K-1"),
            ("degC", "1 K + 273.15"),
            ("J/degC", "1 kg.m2.s-2.K-1"),
            ("kg", "1 kg"),
            ("MPa", "1000000 kg.m-1.s-2"),
            ("T", "1 kg.s-2.A-1"),
            ("%", "0.01"),
        ] {
            assert_eq!(BaseUnit::of_name(name).unwrap().to_string(), unit, "{name}");
        }
        for name in ["", "-", "W/m2.K", "m/s/s", "foo", "m-", "2", "m99", "/s", "m..s", "kmin", "N.m)"] {
            assert_eq!(BaseUnit::of_name(name), None, "{name}");
        }
    }
}
