//! What the structure of a system may contain. Anything else is not used, so it is reported: it may be misspelt.

use fmi_abi::shown;
use roxmltree::Node;

/// An element, the elements in it and its attributes besides those of every element (section 4.1 of SSP 1.0).
pub(super) type Known = (&'static str, &'static [&'static str], &'static [&'static str]);

/// Calls `warn` with a message for each element and attribute that is not known. What is in an element without a row in the table, such as
/// an annotation, is not checked.
pub(super) fn warn_of_others(node: Node, table: &[Known], warn: &mut dyn FnMut(String)) {
    let name = node.tag_name().name();
    let Some((_, elements, attributes)) = table.iter().find(|known| known.0 == name) else { return };
    only_attributes(node, attributes).unwrap_or_else(|why| warn(format!("{why}; it is not used")));
    for inner in node.children().filter(Node::is_element) {
        let other = inner.tag_name().name();
        if elements.contains(&other) {
            warn_of_others(inner, table, warn);
        } else {
            warn(format!(
                "a {name} has the unknown element {}{}; it is not used",
                shown(other),
                there_are(elements)
            ));
        }
    }
}

/// Fails if an element has other attributes than these and those of every element.
pub(super) fn only_attributes(node: Node, known: &[&str]) -> Result<(), String> {
    let is_known = |name: &str| known.contains(&name) || matches!(name, "id" | "description");
    match node.attributes().find(|of| of.namespace().is_none() && !is_known(of.name())) {
        Some(other) => Err(format!(
            "a {} has the unknown attribute {}{}",
            shown(node.tag_name().name()),
            shown(other.name()),
            there_are(known)
        )),
        None => Ok(()),
    }
}

fn there_are(known: &[&str]) -> String {
    if known.is_empty() { String::new() } else { format!("; there are {}", known.join(", ")) }
}
