//! Parses the XML of untrusted files. First checks that the parser will not need too much memory or time.

pub use crate::attribute::{Typed, attribute};
use roxmltree::{Document, Error};

/// Beginnings and ends of markup that is not the start of an element.
const SKIPPED: [(&str, &str); 4] = [("<!--", "-->"), ("<![CDATA[", "]]>"), ("<?", "?>"), ("</", ">")];
/// Maximum number of prefixes that are not declared.
const MAX_UNDECLARED: usize = 10;
/// Maximum depth of nested elements.
const MAX_DEPTH: usize = 250;
/// Maximum number of comparisons that the parser may make for an empty file, and the number by which each byte of a
/// file raises this maximum. The parser compares all attributes of an element with each other, and the namespaces of an
/// element with the namespaces of the elements around it, so without a limit the time could grow quadratically.
const COMPARISONS: usize = 1 << 22;
const COMPARISONS_PER_BYTE: usize = 8;
/// Maximum number of bytes that [`reserve`] accepts.
const MAX_MEMORY: usize = 1 << 30;
/// Upper bounds for the memory of a parsed element (with the text after it) and of an attribute, in bytes.
const ELEMENT: usize = 300;
const ATTRIBUTE: usize = 200;

/// Parses the content of an XML file. Error messages begin with `name`.
///
/// # Errors
/// Fails if the file is not well-formed, has a document type definition or elements that are nested too deep, or would
/// take too much memory or time.
pub fn parse<'a>(text: &'a str, name: &str) -> Result<Document<'a>, String> {
    check(text, name)?;
    Document::parse(text).map_err(|error| refused(error, name))
}

/// Parses the content of an XML file as [`parse`] does, even if it uses prefixes without declaring them, as some tools do in
/// annotations. Then `declared` gets the text with their declarations.
///
/// # Errors
/// Fails for the other reasons of [`parse`].
pub fn parse_undeclared<'a>(
    text: &'a str,
    name: &str,
    declared: &'a mut String,
) -> Result<Document<'a>, String> {
    check(text, name)?;
    let mut error = match Document::parse(text) {
        Ok(document) => return Ok(document),
        Err(error) => error,
    };
    text.clone_into(declared);
    for _ in 0..MAX_UNDECLARED {
        let (Error::UnknownNamespace(prefix, _), Some(at)) = (&error, root_name_end(declared)) else { break };
        declared.insert_str(at, &format!(" xmlns:{prefix}=\"undeclared\""));
        match Document::parse(declared) {
            Ok(_) => return parse(declared, name),
            Err(next) => error = next,
        }
    }
    Err(refused(error, name))
}

/// Returns the end of the name of the root element.
fn root_name_end(text: &str) -> Option<usize> {
    let mut at = 0;
    loop {
        let begin = at + text[at..].find('<')?;
        let rest = &text[begin..];
        let Some((start, end)) = SKIPPED.into_iter().find(|(start, _)| rest.starts_with(start)) else {
            return Some(begin + rest.find(|letter: char| letter.is_whitespace() || "/>".contains(letter))?);
        };
        at = begin + start.len() + rest[start.len()..].find(end)? + end.len();
    }
}

fn refused(error: Error, name: &str) -> String {
    match error {
        Error::DtdDetected => {
            format!("{name} has a document type definition (<!DOCTYPE>), which is not read here; remove it")
        }
        error => format!("{name} is not well-formed XML: {}", crate::shown(&error.to_string())),
    }
}

/// Checks that the parser will not need too much memory or time.
fn check(text: &str, name: &str) -> Result<(), String> {
    let count = |byte: u8| text.bytes().filter(|other| *other == byte).count();
    let bytes = ELEMENT * count(b'<') + ATTRIBUTE * count(b'=') + 2 * text.len();
    reserve(bytes).map_err(|why| format!("{name} cannot be read: {why}"))?;
    scan(text).map_err(|why| format!("{name} {why}"))
}

/// Checks that this number of bytes can be allocated. A collection that grows ends the process if memory runs out, so
/// callers first check the memory for the whole file here, where a lack of memory is only an error.
///
/// # Errors
/// Fails if the memory is not available, or if it is more than 1 GiB.
pub fn reserve(bytes: usize) -> Result<(), String> {
    let megabytes = bytes.div_ceil(1 << 20);
    if bytes > MAX_MEMORY {
        return Err(format!(
            "it would take about {megabytes} MB of memory, more than the limit of {} MB",
            MAX_MEMORY >> 20
        ));
    }
    let reserved = Vec::<u8>::new().try_reserve_exact(bytes);
    reserved.map_err(|_| format!("it would take about {megabytes} MB of memory, which are not available"))
}

/// Checks the depth of the elements, and counts the comparisons that their attributes and namespaces need, in a
/// single pass. A file that is not well-formed may pass this check, because the parser rejects it later.
fn scan(text: &str) -> Result<(), String> {
    let bytes = text.as_bytes();
    // For each open element, the number of namespaces that are declared in it and around it.
    let mut open: Vec<usize> = Vec::new();
    let (mut at, mut comparisons) = (0, 0_usize);
    while let Some(begin) = text[at..].find('<').map(|offset| at + offset) {
        let rest = &text[begin..];
        let skipped = SKIPPED.into_iter().find(|(start, _)| rest.starts_with(start));
        if let Some((start, end)) = skipped {
            if start == "</" {
                open.pop();
            }
            let Some(length) = rest[start.len()..].find(end) else { return Ok(()) };
            at = begin + start.len() + length + end.len();
            continue;
        }
        let tag = tag(&bytes[begin + 1..]);
        let namespaces = open.last().copied().unwrap_or_default() + tag.namespaces;
        let declared = if tag.namespaces > 0 { namespaces } else { 0 };
        let own = tag.attributes * tag.attributes + declared * declared + namespaces * (1 + tag.attributes);
        comparisons = comparisons.saturating_add(own);
        if comparisons > COMPARISONS + COMPARISONS_PER_BYTE * text.len() {
            return Err("has elements with too many attributes or namespaces".to_owned());
        }
        if !tag.is_empty {
            open.push(namespaces);
        }
        if open.len() > MAX_DEPTH {
            return Err(format!("has elements that are nested more than {MAX_DEPTH} deep"));
        }
        at = begin + 1 + tag.length;
    }
    Ok(())
}

/// Start tag of an element.
struct Tag {
    attributes: usize,
    namespaces: usize,
    /// Whether the element has no content and no end tag, as in `<a/>`.
    is_empty: bool,
    length: usize,
}

fn tag(bytes: &[u8]) -> Tag {
    let mut tag = Tag { attributes: 0, namespaces: 0, is_empty: false, length: bytes.len() };
    let mut quote = None;
    for (index, byte) in bytes.iter().enumerate() {
        match (quote, byte) {
            (Some(open), byte) if open == *byte => quote = None,
            (Some(_), _) => {}
            (None, b'"' | b'\'') => quote = Some(*byte),
            (None, b'=') => tag.attributes += 1,
            (None, b'x')
                if index > 0
                    && bytes[index - 1].is_ascii_whitespace()
                    && bytes[index..].starts_with(b"xmlns") =>
            {
                tag.namespaces += 1;
            }
            (None, b'>') => {
                tag.is_empty = index > 0 && bytes[index - 1] == b'/';
                tag.length = index + 1;
                break;
            }
            (None, _) => {}
        }
    }
    tag
}

#[cfg(test)]
mod tests {
    use super::{parse, parse_undeclared};

    #[test]
    fn ordinary_files_are_read() {
        let text =
            r#"<?xml version="1.0"?><!-- <a> --><a xmlns="u" b="<>'/>"><![CDATA[<x>]]><c d='"'/><c></c></a>"#;
        let text = text.replace("<>", "&lt;&gt;");
        assert_eq!(parse(&text, "F").unwrap().descendants().filter(|node| node.is_element()).count(), 3);
        let deep = "<a>".repeat(250) + &"</a>".repeat(250);
        assert!(parse(&deep, "F").is_ok());
    }

    #[test]
    fn prefixes_need_not_be_declared() {
        let text = "<?xml version='1.0'?><!-- <a> --><a b='c'><d:e f:g='h'/><i/></a>";
        assert!(parse(text, "F").is_err());
        let mut declared = String::new();
        let document = parse_undeclared(text, "F", &mut declared).unwrap();
        let names: Vec<_> = document.root_element().children().map(|node| node.tag_name().name()).collect();
        assert_eq!(names, ["e", "i"]);
        let many: String = (0..11).map(|number| format!("<p{number}:a/>")).collect();
        for wrong in ["<a", "<a:b>", &format!("<a>{many}</a>")] {
            let error = parse_undeclared(wrong, "F", &mut String::new()).unwrap_err();
            assert!(error.starts_with("F is not well-formed XML"), "{error}");
        }
    }

    #[test]
    fn time_and_memory_are_limited() {
        let attributes: String = (0..20_000).map(|number| format!(" a{number}=''")).collect();
        let spaces: String = (0..900).map(|number| format!(" xmlns:a{number}='{number}'")).collect();
        let many = |count: usize| format!("<a{spaces}>{}</a>", "<b xmlns:c='d'/>".repeat(count));
        for (text, why) in [
            (format!("<a{attributes}/>"), "F has elements with too many attributes"),
            ("<a>".repeat(10_000), "F has elements that are nested more than 250 deep"),
            (many(1000), "F has elements with too many attributes or namespaces"),
            ("<!DOCTYPE a [<!ENTITY b 'c'>]><a>&b;</a>".to_owned(), "F has a document type definition"),
            ("<a>\u{1b}[31m</a>".to_owned(), "F is not well-formed XML"),
            (String::new(), "F is not well-formed XML"),
        ] {
            let error = parse(&text, "F").unwrap_err();
            assert!(error.starts_with(why) && !error.contains(char::is_control), "{error:?}");
        }
        assert!(parse(&many(1), "F").is_ok());
    }
}
