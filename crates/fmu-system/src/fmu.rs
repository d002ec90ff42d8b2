//! What a system needs to know of an FMU.

use anyhow::{Context, Result, ensure};
use fmu_package::files::unzip;
use fmu_package::xml::Element;
use std::collections::BTreeMap;

/// An FMU that has been read.
pub struct Fmu {
    pub bytes: Vec<u8>,
    pub variables: BTreeMap<String, Variable>,
    /// By name, as SSP has them.
    pub units: BTreeMap<String, Element>,
}

/// A variable of an FMU.
pub struct Variable {
    pub causality: String,
    /// `Real`, `Integer`, `Boolean`, `String` or `Enumeration`.
    pub kind: String,
    pub unit: Option<String>,
    /// Of an Enumeration.
    pub items: Option<Items>,
}

/// The items of an enumeration: its name, and name and number of each item.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Items {
    pub name: String,
    pub items: Vec<(String, String)>,
}

impl Fmu {
    /// From the content of its file.
    pub fn read(bytes: Vec<u8>) -> Result<Self> {
        let text = String::from_utf8(unzip(&bytes, "modelDescription.xml")?)?;
        let description = Element::parse(&text).context("its modelDescription.xml cannot be read")?;
        let version = description.attribute("fmiVersion").unwrap_or_default();
        ensure!(!version.starts_with("3."), "it is for FMI {version}; systems are of FMUs for FMI 2.0");
        let units = description.children_of("UnitDefinitions").map(unit).collect();
        let types: BTreeMap<&str, &Element> = description
            .children_of("TypeDefinitions")
            .filter_map(|of| Some((of.attribute("name")?, of.children.first()?)))
            .collect();
        let named = |variable: &Element| {
            Some((variable.attribute("name")?.to_owned(), self::variable(variable, &types)?))
        };
        let variables = description.children_of("ModelVariables").filter_map(named).collect();
        Ok(Self { bytes, variables, units })
    }
}

fn unit(unit: &Element) -> (String, Element) {
    let name = unit.attribute("name").unwrap_or_default();
    let base = unit.children.iter().find(|child| child.name == "BaseUnit");
    let attributes = base.map(|base| base.attributes.clone()).unwrap_or_default();
    let base = Element { attributes, ..Element::new("ssc:BaseUnit") };
    (name.to_owned(), Element::new("ssc:Unit").with("name", name).containing([base]))
}

fn variable(variable: &Element, types: &BTreeMap<&str, &Element>) -> Option<Variable> {
    let kind = variable.children.first()?;
    let declared = kind.attribute("declaredType");
    let of = declared.and_then(|name| types.get(name));
    let unit = kind.attribute("unit").or_else(|| of?.attribute("unit"));
    let item =
        |item: &Element| Some((item.attribute("name")?.to_owned(), item.attribute("value")?.to_owned()));
    let items = of.filter(|of| of.name == "Enumeration").map(|of| Items {
        name: declared.unwrap_or_default().to_owned(),
        items: of.children.iter().filter_map(item).collect(),
    });
    Some(Variable {
        causality: variable.attribute("causality").unwrap_or("local").to_owned(),
        kind: kind.name.clone(),
        unit: unit.map(str::to_owned),
        items,
    })
}

impl Variable {
    /// Fails unless this text is a value of the variable: a number, `true` or `false`, any text, the name of an item.
    pub fn check_start(&self, name: &str, text: &str) -> Result<()> {
        let possible = match self.kind.as_str() {
            "Real" => {
                let value: Option<f64> = text.parse().ok();
                if let Some(value) = value.filter(|value| !value.is_finite()) {
                    anyhow::bail!("the start value of {name} must be a finite number, it is {value}");
                }
                value.is_some()
            }
            "Integer" => text.parse::<i32>().is_ok(),
            "Boolean" => text.parse::<bool>().is_ok(),
            "Enumeration" => self.number_of(text).is_some(),
            _ => true,
        };
        ensure!(possible, "{name} is {}, its start value cannot be '{}'", self.kind, text.escape_debug());
        Ok(())
    }

    /// The number of an item.
    pub fn number_of(&self, item: &str) -> Option<&str> {
        let items = &self.items.as_ref()?.items;
        items.iter().find(|(name, _)| name == item).map(|(_, number)| number.as_str())
    }
}
