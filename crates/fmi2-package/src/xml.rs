//! The text of XML files, above all of `modelDescription.xml`.
//!
//! fmi-schema writes one long line, the children of the root in an order that the schema does not allow,
//! an empty list of dependencies as none at all (which means "depends on everything", section 2.2.8),
//! empty lists of unknowns that the schema forbids, and unit and range only at types. This module mends
//! that.

use anyhow::{Context, Result, bail};
use fmi_schema::fmi2::Fmi2ModelDescription;
use fmi_schema::traits::FmiModelDescription;
use quick_xml::XmlVersion;
use quick_xml::events::{BytesDecl, BytesStart, BytesText, Event};
use quick_xml::{Reader, Writer};
use std::collections::HashMap;
use std::io;

/// The children of the root in the order of fmi2ModelDescription.xsd.
const ORDER: [&str; 8] = [
    "ModelExchange",
    "CoSimulation",
    "UnitDefinitions",
    "TypeDefinitions",
    "LogCategories",
    "DefaultExperiment",
    "ModelVariables",
    "ModelStructure",
];

/// Writes the description, indented. Every unknown in it must state its dependencies.
pub(crate) fn to_text(description: &Fmi2ModelDescription) -> Result<String> {
    let mut root = parse(&description.serialize()?).context("fmi-schema wrote XML that is none")?;
    if let Some(stranger) = root.children.iter().find(|child| !ORDER.contains(&child.name.as_str())) {
        bail!("the element {} has no place in the order of the schema", stranger.name);
    }
    repeat_types_at_variables(&mut root);
    root.children.sort_by_key(|child| ORDER.iter().position(|name| *name == child.name));
    for structure in root.children.iter_mut().filter(|child| child.name == "ModelStructure") {
        structure.children.retain(|list| !list.children.is_empty());
        for unknown in structure.children.iter_mut().flat_map(|list| &mut list.children) {
            state_dependencies(unknown);
        }
    }
    document(&root)
}

/// An XML document of this element.
pub(crate) fn document(root: &Element) -> Result<String> {
    let mut writer = Writer::new_with_indent(Vec::new(), b' ', 2);
    writer.write_event(Event::Decl(BytesDecl::new("1.0", Some("UTF-8"), None)))?;
    write_root(&mut writer, root)?;
    let mut text = String::from_utf8(writer.into_inner())?;
    text.push('\n');
    Ok(text)
}

/// Writes what a variable's type says (unit, range, nominal value) at the variable as well: many importers
/// never look types up, and fmi-schema has no place for it.
fn repeat_types_at_variables(root: &mut Element) {
    let of_types: HashMap<String, Vec<(String, String)>> = root
        .children_of("TypeDefinitions")
        .filter_map(|simple_type| Some((simple_type.attribute("name")?.to_owned(), simple_type)))
        .map(|(name, simple_type)| {
            (name, simple_type.children.iter().flat_map(|e| e.attributes.clone()).collect())
        })
        .collect();
    for variables in root.children.iter_mut().filter(|child| child.name == "ModelVariables") {
        for kind in variables.children.iter_mut().flat_map(|variable| &mut variable.children) {
            if let Some(attributes) = kind.attribute("declaredType").and_then(|name| of_types.get(name)) {
                kind.attributes.extend(attributes.iter().cloned());
            }
        }
    }
}

/// An unknown without dependencies depends on nothing: says so.
fn state_dependencies(unknown: &mut Element) {
    for name in ["dependencies", "dependenciesKind"] {
        if unknown.attribute(name).is_none() {
            unknown.attributes.push((name.to_owned(), String::new()));
        }
    }
}

/// An element with children, or with text.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Element {
    pub name: String,
    pub attributes: Vec<(String, String)>,
    pub children: Vec<Self>,
    pub text: String,
}

impl Element {
    pub fn new(name: &str, attributes: Vec<(String, String)>, children: Vec<Self>) -> Self {
        Self { name: name.to_owned(), attributes, children, text: String::new() }
    }

    pub fn attribute(&self, name: &str) -> Option<&str> {
        self.attributes.iter().find(|(known, _)| known == name).map(|(_, value)| value.as_str())
    }

    /// The children of the children of this name.
    pub fn children_of(&self, name: &str) -> impl Iterator<Item = &Self> {
        self.children.iter().filter(move |child| child.name == name).flat_map(|child| &child.children)
    }

    fn start(&self) -> BytesStart<'_> {
        let attributes = self.attributes.iter().map(|(name, value)| (name.as_str(), value.as_str()));
        BytesStart::new(self.name.as_str()).with_attributes(attributes)
    }
}

/// Reads a document; text between elements is left out.
pub(crate) fn parse(text: &str) -> Result<Element> {
    let mut reader = Reader::from_str(text);
    reader.config_mut().expand_empty_elements = true;
    let mut open: Vec<Element> = Vec::new();
    loop {
        match reader.read_event()? {
            Event::Start(start) => open.push(element(&start)?),
            Event::End(_) => {
                let closed = open.pop().context("an element ends that has not begun")?;
                match open.last_mut() {
                    Some(parent) => parent.children.push(closed),
                    None => return Ok(closed),
                }
            }
            Event::Eof => bail!("it ends too early"),
            _ => {}
        }
    }
}

fn element(start: &BytesStart) -> Result<Element> {
    let mut attributes = Vec::new();
    for attribute in start.attributes() {
        let attribute = attribute?;
        let name = attribute.key.as_ref().to_owned();
        attributes.push((name, attribute.normalized_value(XmlVersion::Explicit1_0)?.into_owned()));
    }
    Ok(Element::new(start.name().as_ref(), attributes, Vec::new()))
}

/// The root has many attributes: one on each line.
fn write_root(writer: &mut Writer<Vec<u8>>, root: &Element) -> io::Result<()> {
    let mut start = writer.create_element(root.name.as_str());
    for (name, value) in &root.attributes {
        start = start.new_line().with_attribute((name.as_str(), value.as_str()));
    }
    start.write_inner_content(|writer| root.children.iter().try_for_each(|child| write(writer, child)))?;
    Ok(())
}

fn write(writer: &mut Writer<Vec<u8>>, element: &Element) -> io::Result<()> {
    if !element.text.is_empty() {
        writer.create_element(element.name.as_str()).write_text_content(BytesText::new(&element.text))?;
        return Ok(());
    }
    if element.children.is_empty() {
        return writer.write_event(Event::Empty(element.start()));
    }
    let start = element.start();
    let end = start.to_end();
    writer.write_event(Event::Start(start.borrow()))?;
    element.children.iter().try_for_each(|child| write(writer, child))?;
    writer.write_event(Event::End(end))
}
