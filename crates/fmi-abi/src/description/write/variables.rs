//! Writes variables (section 2.2.7 of FMI 2.0, 2.4.7 of FMI 3.0).

use super::definitions::with_attributes;
use crate::description::{Alias, Attributes, Clock, ModelDescription, Timing, Variable};
use crate::write::{Element, filled};
use crate::{BaseType, Standard};

impl ModelDescription {
    pub(super) fn model_variables(&self) -> Element {
        let variable = |of| match self.standard {
            Standard::Fmi2 => self.variable_of_fmi2(of),
            Standard::Fmi3 => self.variable_of_fmi3(of),
        };
        Element::new("ModelVariables").containing(self.variables.iter().map(variable))
    }

    /// Many importers do not look types up, so the attributes of the declared type are repeated.
    fn variable_of_fmi2(&self, of: &Variable) -> Element {
        let element = self.with_value(Element::new(self.element_name(of)), of, of.start.first());
        with_common(Element::new("ScalarVariable"), of).containing([with_attributes(element, &of.attributes)])
    }

    fn variable_of_fmi3(&self, of: &Variable) -> Element {
        let are_children = matches!(of.base, Some(BaseType::String | BaseType::Binary));
        let (children, list) = of.start.split_at(if are_children { of.start.len() } else { 0 });
        let start = (!list.is_empty()).then(|| list.join(" "));
        let element =
            self.with_value(with_common(Element::new(self.element_name(of)), of), of, start.as_ref());
        let element = match of.clock.as_deref() {
            Some(clock) => with_clock(element, clock),
            None => element,
        };
        with_attributes(element, &self.own_attributes(of))
            .containing(of.aliases.iter().map(alias))
            .containing(
                of.dimensions.iter().flatten().map(|size| Element::new("Dimension").with("start", size)),
            )
            .containing(children.iter().map(|start| Element::new("Start").with("value", start)))
    }

    fn element_name(&self, of: &Variable) -> &'static str {
        // `to_xml` has rejected types that the FMI version lacks, so a variable without a type of values is a clock.
        of.base.and_then(|base| base.element(self.standard)).unwrap_or("Clock")
    }

    /// Returns the attributes that are written for a variable of FMI 3.0. It inherits its quantity, units and nominal value from its declared
    /// type, because fmi-sim 0.7 rejects an FMU that repeats them, although section 2.4.7.3 of FMI 3.0 allows that. The range and the size
    /// of bytes are repeated for importers that do not look types up.
    fn own_attributes(&self, of: &Variable) -> Attributes {
        let mut own = of.attributes.clone();
        let Some(declared) = of.declared_type.as_ref().and_then(|name| self.types.get(name)) else {
            return own;
        };
        let of_type = &declared.attributes;
        own.is_relative &= !of_type.is_relative;
        own.nominal = own.nominal.filter(|_| own.nominal != of_type.nominal);
        for (text, of_type) in [
            (&mut own.quantity, &of_type.quantity),
            (&mut own.unit, &of_type.unit),
            (&mut own.display_unit, &of_type.display_unit),
        ] {
            if text == of_type {
                *text = None;
            }
        }
        own
    }

    /// Adds the attributes of a variable that its type does not have.
    fn with_value(&self, element: Element, of: &Variable, start: Option<&String>) -> Element {
        let derivative = of.derivative_of.map(|state| match self.standard {
            Standard::Fmi2 => state as u32 + 1,
            Standard::Fmi3 => self.variables[state].reference,
        });
        element
            .with_some("declaredType", of.declared_type.as_ref())
            .with_some("start", start)
            .with_some("derivative", derivative)
            .with_some("reinit", of.reinit.then_some(true))
    }
}

/// Adds the attributes that variables of all types have.
fn with_common(element: Element, of: &Variable) -> Element {
    let clocks = of.clocks.iter().map(u32::to_string).collect::<Vec<_>>().join(" ");
    element
        .with("name", &of.name)
        .with("valueReference", of.reference)
        .with_some("description", filled(&of.description))
        .with("causality", of.causality)
        .with_some("variability", of.has_variability.then_some(of.variability))
        .with_some("initial", of.initial)
        .with_some("clocks", of.clocked.then_some(clocks))
        .with_some("canHandleMultipleSetPerTimeInstant", of.once_per_instant.then_some(false))
}

/// Adds the attributes of a clock (section 2.4.5 of FMI 3.0).
fn with_clock(element: Element, of: &Clock) -> Element {
    let element = element
        .with_some("intervalVariability", of.interval_variability)
        .with_some("supportsFraction", of.supports_fraction.then_some(true));
    match of.timing {
        None => element,
        Some(Timing::Decimal { interval, shift }) => {
            element.with("intervalDecimal", interval).with("shiftDecimal", shift)
        }
        Some(Timing::Fraction { interval, shift, resolution }) => element
            .with("resolution", resolution)
            .with("intervalCounter", interval)
            .with("shiftCounter", shift),
    }
}

fn alias(of: &Alias) -> Element {
    Element::new("Alias")
        .with("name", &of.name)
        .with_some("description", filled(&of.description))
        .with_some("displayUnit", of.display_unit.as_ref())
}
