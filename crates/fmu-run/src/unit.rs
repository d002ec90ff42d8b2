//! Units as defined in model descriptions (section 2.2.2 of FMI 2.0, 2.4.3 of FMI 3.0).

use crate::change::Change;
use std::fmt;

/// Names of the base units.
const BASE: [&str; 8] = ["kg", "m", "s", "A", "K", "mol", "cd", "rad"];

/// Definition of a unit: value in base units = factor * value in the unit + offset. Two units are equal if their exponents are, and
/// their factors and offsets are up to rounding.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Unit {
    /// Exponents of the base units.
    exponents: [i32; BASE.len()],
    factor: f64,
    offset: f64,
}

impl Unit {
    /// Reads the attributes of a `BaseUnit`. Returns `None` if there are none, or if one is not a number.
    pub fn of(attributes: &[(String, String)]) -> Option<Self> {
        let mut unit = Self { exponents: [0; BASE.len()], factor: 1.0, offset: 0.0 };
        for (name, value) in attributes {
            match (name.as_str(), BASE.iter().position(|base| base == name)) {
                ("factor", _) => unit.factor = value.trim().parse().ok()?,
                ("offset", _) => unit.offset = value.trim().parse().ok()?,
                (_, Some(base)) => unit.exponents[base] = value.trim().parse().ok()?,
                _ => {}
            }
        }
        (!attributes.is_empty()).then_some(unit)
    }

    /// Returns the conversion of values in this unit to another one; `None` if they measure different quantities.
    pub fn conversion_to(self, other: Self) -> Option<Change> {
        if self == other {
            return Some(Change::default());
        }
        let is_same = self.exponents == other.exponents;
        is_same
            .then(|| Change::linear(self.factor / other.factor, (self.offset - other.offset) / other.factor))
    }

    /// Returns the unit of a difference of quantities, which has no offset.
    pub fn of_difference(self) -> Self {
        Self { offset: 0.0, ..self }
    }
}

impl PartialEq for Unit {
    fn eq(&self, other: &Self) -> bool {
        /// Largest relative difference that is not a difference: some tools write factors with only seven digits.
        const SAME: f64 = 1e-6;
        let same = |one: f64, other: f64| (one - other).abs() <= SAME * one.abs().max(other.abs());
        self.exponents == other.exponents
            && same(self.factor, other.factor)
            && same(self.offset, other.offset)
    }
}

/// Writes the unit as a multiple of base units, such as `1000 kg.m2.s-2`.
impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.factor)?;
        let named = BASE.iter().zip(self.exponents).filter(|(_, exponent)| *exponent != 0);
        for (index, (base, exponent)) in named.enumerate() {
            write!(f, "{}{base}", if index == 0 { " " } else { "." })?;
            if exponent != 1 {
                write!(f, "{exponent}")?;
            }
        }
        if self.offset != 0.0 {
            write!(f, " + {}", self.offset)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use crate::description::Description;

    fn with_unit(unit: &str, definition: &str, attributes: &str) -> Description {
        let text = format!(
            "<fmiModelDescription fmiVersion=\"2.0\" modelName=\"M\" guid=\"m\"><CoSimulation modelIdentifier=\"m\"/>\
             <UnitDefinitions><Unit name=\"{unit}\">{definition}</Unit></UnitDefinitions><ModelVariables>\
             <ScalarVariable name=\"v\" valueReference=\"1\" causality=\"output\"><Real unit=\"{unit}\" {attributes}/></ScalarVariable>\
             </ModelVariables></fmiModelDescription>"
        );
        Description::parse(&text).unwrap()
    }

    #[test]
    fn units_are_compared_by_definition() {
        let torque = r#"<BaseUnit kg="1" m="2" s="-2"/>"#;
        let (degree, short) = (
            r#"<BaseUnit rad="1" factor="0.017453292519943295"/>"#,
            r#"<BaseUnit rad="1" factor="0.01745329"/>"#,
        );
        let celsius = r#"<BaseUnit K="1" offset="273.15"/>"#;
        for (one, other, why) in [
            (("Nm", torque, ""), ("N.m", torque, ""), Ok(())),
            (("deg", degree, ""), ("deg", short, ""), Ok(())),
            (("deg", "", ""), ("deg", degree, ""), Ok(())),
            (("degC", celsius, r#"relativeQuantity="1""#), ("K", r#"<BaseUnit K="1"/>"#, ""), Ok(())),
            (
                ("deg", degree, ""),
                ("deg", r#"<BaseUnit rad="1"/>"#, ""),
                Err("both are in deg, but the output's is 0.017453292519943295 rad and the input's 1 rad"),
            ),
            (
                ("u", celsius, ""),
                ("u", torque, ""),
                Err("both are in u, but the output's is 1 K + 273.15 and the input's 1 kg.m2.s-2"),
            ),
            (("Nm", "", ""), ("N.m", torque, ""), Err("the output is in Nm, the input in N.m")),
            (("Nm", torque, ""), ("deg", degree, ""), Err("the output is in Nm, the input in deg")),
        ] {
            let [one, other] =
                [one, other].map(|(unit, definition, attributes)| with_unit(unit, definition, attributes));
            let found = one.connects(&one.variables[0], &other, &other.variables[0]);
            assert_eq!(found, why.map_err(str::to_owned));
        }
    }
}
