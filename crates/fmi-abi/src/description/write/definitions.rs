//! Writes units and declared types (sections 2.2.2 and 2.2.3 of FMI 2.0, 2.4.3 and 2.4.4 of FMI 3.0).

use crate::description::{Attributes, ModelDescription, Type};
use crate::write::{Element, filled};
use crate::{Standard, Unit};

impl ModelDescription {
    pub(super) fn unit_definitions(&self) -> Option<Element> {
        Element::list("UnitDefinitions", self.units.iter().map(|(name, unit)| unit_definition(name, unit)))
    }

    pub(super) fn type_definitions(&self) -> Option<Element> {
        Element::list(
            "TypeDefinitions",
            self.types.iter().map(|(name, of)| type_definition(self.standard, name, of)),
        )
    }
}

fn unit_definition(name: &str, unit: &Unit) -> Element {
    let display_units = unit.display_units.iter().map(|of| {
        let offset = (of.offset != 0.0).then_some(of.offset);
        Element::new("DisplayUnit")
            .with("name", &of.name)
            .with("factor", of.factor)
            .with_some("offset", offset)
    });
    Element::new("Unit")
        .with("name", name)
        .containing(unit.base.map(|base| base.element("BaseUnit")))
        .containing(display_units)
}

fn type_definition(standard: Standard, name: &str, of: &Type) -> Element {
    // `to_xml` has rejected types that the FMI version lacks.
    let base = of.base.and_then(|base| base.element(standard)).unwrap_or_default();
    let items = of.items.iter().map(|item| {
        Element::new("Item")
            .with("name", &item.name)
            .with("value", item.value)
            .with_some("description", filled(&item.description))
    });
    let named = |element: String| {
        Element::new(element).with("name", name).with_some("description", filled(&of.description))
    };
    match standard {
        Standard::Fmi2 => {
            named("SimpleType".to_owned())
                .containing([with_attributes(Element::new(base), &of.attributes).containing(items)])
        }
        Standard::Fmi3 => with_attributes(named(format!("{base}Type")), &of.attributes).containing(items),
    }
}

/// Adds the attributes that a variable shares with its type.
pub(super) fn with_attributes(element: Element, of: &Attributes) -> Element {
    element
        .with_some("quantity", of.quantity.as_ref())
        .with_some("unit", of.unit.as_ref())
        .with_some("displayUnit", of.display_unit.as_ref())
        .with_some("relativeQuantity", of.is_relative.then_some(true))
        .with_some("min", of.min.as_ref())
        .with_some("max", of.max.as_ref())
        .with_some("nominal", of.nominal)
        .with_some("mimeType", of.mime_type.as_ref())
        .with_some("maxSize", of.max_size)
}
