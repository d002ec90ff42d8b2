//! What the structure of a system may contain. Anything else is not used, so it is reported: it may be misspelt.

use fmi_abi::shown;
use roxmltree::Node;

/// An element, the elements in it and its attributes besides those of every element (section 4.1 of SSP 1.0).
pub(super) type Known = (&'static str, &'static [&'static str], &'static [&'static str]);

/// Calls `warn` with a message for each element and attribute that is not in the table. Elements without a row, such as annotations, may
/// contain anything.
pub(super) fn warn_of_others(node: Node, table: &[Known], warn: &mut dyn FnMut(String)) {
    let name = node.tag_name().name();
    let Some((_, elements, attributes)) = table.iter().find(|known| known.0 == name) else { return };
    let mut not_used = |what: &str, other: &str, known: &[&str]| {
        let known = if known.is_empty() { "there is none" } else { &*known.join(", ") };
        warn(format!("the {what} {} of a {name} is not used; known: {known}", shown(other)));
    };
    for other in other_attributes(node, attributes) {
        not_used("attribute", other, attributes);
    }
    for inner in node.children().filter(Node::is_element) {
        let other = inner.tag_name().name();
        if !elements.contains(&other) {
            not_used("element", other, elements);
        }
    }
    for inner in node.children().filter(|inner| elements.contains(&inner.tag_name().name())) {
        warn_of_others(inner, table, warn);
    }
}

/// Fails if an element has other attributes than these and those of every element.
pub(super) fn only_attributes(node: Node, known: &[&str]) -> Result<(), String> {
    match other_attributes(node, known).next() {
        Some(other) => Err(format!(
            "a {} has the unknown attribute {}; there are {}",
            shown(node.tag_name().name()),
            shown(other),
            known.join(", ")
        )),
        None => Ok(()),
    }
}

fn other_attributes<'a>(node: Node<'a, '_>, known: &[&str]) -> impl Iterator<Item = &'a str> {
    let is_known = |name: &str| known.contains(&name) || matches!(name, "id" | "description");
    let names = node.attributes().filter(|of| of.namespace().is_none()).map(|of| of.name());
    names.filter(move |name| !is_known(name))
}
