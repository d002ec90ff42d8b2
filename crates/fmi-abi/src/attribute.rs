//! Reads attributes of XML elements. A value of another type than the attribute's is an error and never a default.

use crate::value::BLANKS;
use crate::{Causality, DependencyKind, Initial, IntervalVariability, Variability, boolean, shown};
use roxmltree::Node;

/// A type of attributes.
pub trait Typed: Sized {
    /// The values of this type, as they follow “not” in messages.
    const VALUES: &str;

    /// Reads a value without blanks at its ends.
    fn read(text: &str) -> Option<Self>;
}

macro_rules! typed {
    ($($kind:ty: $values:literal by $read:expr;)+) => {
        $(impl Typed for $kind {
            const VALUES: &str = $values;

            fn read(text: &str) -> Option<Self> {
                $read(text)
            }
        })+
    };
}

fn parsed<T: std::str::FromStr>(text: &str) -> Option<T> {
    text.parse().ok()
}

typed! {
    f64: "a number" by parsed;
    i32: "an integer of 32 bits" by parsed;
    i64: "an integer of 64 bits" by parsed;
    u32: "an integer from 0 to 4294967295" by parsed;
    u64: "an integer from 0 to 18446744073709551615" by parsed;
    usize: "an integer from 0" by parsed;
    bool: "true, false, 1 or 0" by boolean;
    Causality: "a causality" by Causality::of_name;
    Variability: "a variability" by Variability::of_name;
    Initial: "exact, approx or calculated" by Initial::of_name;
    IntervalVariability: "constant, fixed, tunable, changing, countdown or triggered" by IntervalVariability::of_name;
    DependencyKind: "a kind of dependency" by DependencyKind::of_name;
}

/// Reads an attribute; `None` if the element lacks it. Blanks around the value do not count, as in the data types of XML schema
/// (`whiteSpace` is `collapse`).
///
/// # Errors
/// Fails if the value is not of this type. The message names the line, the element and the value.
pub fn attribute<T: Typed>(node: Node, name: &str) -> Result<Option<T>, String> {
    value(node, name).transpose().map_err(|text| unreadable::<T>(node, name, text))
}

/// Reads an attribute. The error is the value that is not of this type.
pub(crate) fn value<'a, T: Typed>(node: Node<'a, '_>, name: &str) -> Option<Result<T, &'a str>> {
    let text = node.attribute(name)?;
    Some(T::read(trimmed(text)).ok_or(text))
}

/// Reads an attribute that is a list of values between blanks. The error is the first value that is not of this type.
pub(crate) fn values<'a, T: Typed>(node: Node<'a, '_>, name: &str) -> Option<Result<Vec<T>, &'a str>> {
    let texts = blank_separated(node.attribute(name)?);
    Some(texts.map(|text| T::read(text).ok_or(text)).collect())
}

/// Returns a text without blanks at its ends. Other white space, such as a no-break space, is part of it.
pub(crate) fn trimmed(text: &str) -> &str {
    text.trim_matches(BLANKS)
}

/// Returns the texts between blanks.
pub(crate) fn blank_separated(text: &str) -> impl Iterator<Item = &str> {
    text.split(BLANKS).filter(|text| !text.is_empty())
}

/// Returns the message for a value that is not of the attribute's type.
pub(crate) fn unreadable<T: Typed>(node: Node, name: &str, text: &str) -> String {
    let line = node.document().text_pos_at(node.range().start).row;
    let own = node.attribute("name").map_or(String::new(), |own| format!(" {}", shown(own)));
    let element = node.tag_name().name();
    format!("line {line}: {name} of {}{own} is {:?}, not {}", shown(element), shown(text), T::VALUES)
}

#[cfg(test)]
mod tests {
    use super::{Typed, attribute, values};
    use roxmltree::Document;
    use std::fmt::Debug;

    fn one<T: Typed>(value: &str) -> Result<Option<T>, String> {
        let text = format!("<a>\n<b name='c' d='{value}'/></a>");
        let document = Document::parse(&text).unwrap();
        attribute(document.root_element().last_element_child().unwrap(), "d")
    }

    /// XML schema, part 2, section 4.3.6: numbers and Booleans are the same with blanks around them.
    #[test]
    fn blanks_around_a_value_do_not_count() {
        fn same<T: Typed + PartialEq + Debug>(text: &str, value: T) {
            assert_eq!(one(text), Ok(Some(value)), "{text:?}");
        }
        for blanks in ["", " ", "&#9;", "&#10;&#13; "] {
            same(&format!("{blanks}0.5{blanks}"), 0.5);
            same(&format!("{blanks}-INF{blanks}"), f64::NEG_INFINITY);
            same(&format!("{blanks}true{blanks}"), true);
            same(&format!("{blanks}0{blanks}"), false);
            same(&format!("{blanks}4294967295{blanks}"), u32::MAX);
            same(&format!("{blanks}-7{blanks}"), -7);
        }
    }

    #[test]
    fn what_is_not_of_the_type_is_named_with_its_line() {
        fn wrong<T: Typed + PartialEq + Debug>(text: &str, values: &str) {
            assert_eq!(one::<T>(text), Err(format!("line 2: d of b c is {text:?}, not {values}")));
        }
        wrong::<f64>("0,5", "a number");
        wrong::<f64>("", "a number");
        wrong::<bool>("True", "true, false, 1 or 0");
        for text in ["4294967296", "-1", "1 2", "1.0"] {
            wrong::<u32>(text, "an integer from 0 to 4294967295");
        }
        let document = Document::parse("<a e=' 1&#9;2 ' f='1 x'/>").unwrap();
        let list = |name| values::<u32>(document.root_element(), name);
        assert_eq!([list("e"), list("f"), list("g")], [Some(Ok(vec![1, 2])), Some(Err("x")), None]);
    }
}
