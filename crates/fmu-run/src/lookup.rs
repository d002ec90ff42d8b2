//! Variables found by name, and checks whether a caller may set them.

use crate::connector::{Connector, End, joined};
use crate::description::{Description, Variable};
use crate::error::{Error, request};
use fmi_abi::{BaseType, Causality, Variability};

/// A variable of a component that was found by its name.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Found<'a> {
    /// Index of the component.
    pub component: usize,
    pub variable: &'a Variable,
    pub description: &'a Description,
    /// The output that is connected to the variable: names of its component and in its FMU.
    pub source: Option<(&'a str, &'a str)>,
    /// The connector of the system by whose name the variable was found, and its connection to the variable.
    pub connector: Option<(&'a Connector, &'a End)>,
}

impl Found<'_> {
    /// Fails if the values of the variable are strings or bytes.
    pub fn check_number(self, name: &str) -> Result<(), Error> {
        match self.variable.base {
            BaseType::String | BaseType::Binary => request(format!("{name} is not a number")),
            _ => Ok(()),
        }
    }

    /// Fails if the variable is connected to an output.
    pub fn check_own(self, name: &str) -> Result<(), Error> {
        if self.connector.is_some_and(|(connector, _)| connector.is_output) {
            return request(format!("{name} is an output of the system, it cannot be set"));
        }
        match self.source {
            Some((component, output)) => {
                request(format!("{name} is fed by {}, it cannot be set", joined(component, output)))
            }
            None => Ok(()),
        }
    }

    /// Fails if a caller may not set the variable, because it is connected to an output, is a structural parameter, or is neither
    /// an input nor a parameter.
    pub fn check_settable(self, name: &str) -> Result<(), Error> {
        self.check_own(name)?;
        if self.variable.is_structural() {
            return request(format!("{name} is a structural parameter; set it with the start values"));
        }
        if self.variable.is_settable() {
            return Ok(());
        }
        let kind = match self.variable.causality {
            Causality::Output => "an output".to_owned(),
            other => format!("{} variable", article(&other.to_string())),
        };
        request(format!("{name} is read-only: it is {kind}"))
    }

    /// Fails if the variable does not accept a start value, or is connected to an output. A variable that is not constant accepts
    /// one if the model description contains its start value, or if it is an input or a parameter (section 2.2.7 of FMI 2.0,
    /// 2.4.7.5 of FMI 3.0).
    pub fn check_start(self, name: &str) -> Result<(), Error> {
        self.check_own(name)?;
        let constant = self.variable.variability == Some(Variability::Constant);
        if !constant && (self.variable.is_settable() || self.variable.start.is_some()) {
            return Ok(());
        }
        let kind = if constant { "a constant" } else { "calculated by the FMU and has no start value" };
        request(format!("{name} is read-only: it is {kind}"))
    }

    /// Returns factor and offset of the conversion: value in `unit` = factor * value of the variable + offset. Fails if `unit` is
    /// neither the unit nor a display unit of the variable.
    pub fn display_unit(self, name: &str, unit: &str) -> Result<(f64, f64), Error> {
        let variable = self.connector.map_or(self.variable, |(connector, _)| &connector.variable);
        let Some(own) = &variable.unit else {
            return request(format!("{name} has no unit, its values cannot be in {unit}"));
        };
        if **own == *unit {
            return Ok((1.0, 0.0));
        }
        let others = self.description.units.get(&**own).map_or(&[][..], |own| &own.display_units);
        let mut named = others.iter().filter(|of| of.name == unit);
        if let Some(of) = named.next() {
            if named.next().is_some() || of.factor == 0.0 {
                let why = "has two definitions, or the factor 0";
                return request(format!(
                    "{name} cannot be given in {unit}, because the FMU's display unit {why}"
                ));
            }
            return Ok((of.factor, if self.variable.is_relative { 0.0 } else { of.offset }));
        }
        let known: Vec<_> = std::iter::once(&**own).chain(others.iter().map(|of| &*of.name)).collect();
        request(format!("{name} can be given in {}, not in {unit:?}", known.join(" or ")))
    }
}

/// Returns whether `f64` cannot represent all values of this type.
pub(crate) fn is_exact(base: BaseType) -> bool {
    matches!(base, BaseType::String | BaseType::Binary | BaseType::Int64 | BaseType::UInt64)
}

/// Prepends the indefinite article.
pub(crate) fn article(word: &str) -> String {
    let vowel = word.starts_with(['a', 'e', 'i', 'o', 'u']);
    format!("{} {word}", if vowel { "an" } else { "a" })
}
