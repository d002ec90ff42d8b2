//! XML documents as trees of elements.

use quick_xml::Writer;
use quick_xml::events::{BytesDecl, BytesStart, BytesText, Event};
use std::fmt::Display;
use std::io;

/// An element with children, or with text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Element {
    /// Its name, with prefix.
    pub name: String,
    /// Names and values, in the order in which they are written.
    pub attributes: Vec<(String, String)>,
    /// Its children.
    pub children: Vec<Self>,
    /// Its text, if it has no children.
    pub text: String,
}

impl Element {
    /// An empty element.
    pub fn new(name: impl Into<String>) -> Self {
        Self { name: name.into(), attributes: Vec::new(), children: Vec::new(), text: String::new() }
    }

    /// An element with these children; `None` if there are none, because schemas do not allow empty lists.
    pub fn list(name: &str, children: impl IntoIterator<Item = Self>) -> Option<Self> {
        Some(Self::new(name).containing(children)).filter(|list| !list.children.is_empty())
    }

    /// The element with another attribute.
    #[must_use]
    pub fn with(mut self, name: impl Into<String>, value: impl Display) -> Self {
        self.attributes.push((name.into(), value.to_string()));
        self
    }

    /// The element with another attribute, if there is a value.
    #[must_use]
    pub fn with_some(self, name: &str, value: Option<impl Display>) -> Self {
        match value {
            Some(value) => self.with(name, value),
            None => self,
        }
    }

    /// The element with more children.
    #[must_use]
    pub fn containing(mut self, children: impl IntoIterator<Item = Self>) -> Self {
        self.children.extend(children);
        self
    }

    /// The element with this text.
    #[must_use]
    pub fn saying(mut self, text: impl Display) -> Self {
        self.text = text.to_string();
        self
    }

    /// The value of an attribute.
    pub fn attribute(&self, name: &str) -> Option<&str> {
        self.attributes.iter().find(|(known, _)| known == name).map(|(_, value)| value.as_str())
    }

    /// The document with this element as its root, indented.
    ///
    /// # Errors
    /// Never in practice, as the document is written into memory.
    pub fn document(&self) -> io::Result<String> {
        let mut writer = Writer::new_with_indent(Vec::new(), b' ', 2);
        writer.write_event(Event::Decl(BytesDecl::new("1.0", Some("UTF-8"), None)))?;
        // The root has many attributes, so each is on a separate line.
        let mut root = writer.create_element(self.name.as_str());
        for (name, value) in &self.attributes {
            root = root.new_line().with_attribute((name.as_str(), value.as_str()));
        }
        root.write_inner_content(|writer| self.children.iter().try_for_each(|child| child.write(writer)))?;
        let mut text = String::from_utf8(writer.into_inner()).map_err(io::Error::other)?;
        text.push('\n');
        Ok(text)
    }

    fn write(&self, writer: &mut Writer<Vec<u8>>) -> io::Result<()> {
        let attributes = self.attributes.iter().map(|(name, value)| (name.as_str(), value.as_str()));
        let start = BytesStart::new(self.name.as_str()).with_attributes(attributes);
        if self.children.is_empty() && self.text.is_empty() {
            return writer.write_event(Event::Empty(start));
        }
        let end = start.to_end();
        writer.write_event(Event::Start(start.borrow()))?;
        if !self.text.is_empty() {
            writer.write_event(Event::Text(BytesText::new(&self.text)))?;
        }
        self.children.iter().try_for_each(|child| child.write(writer))?;
        writer.write_event(Event::End(end))
    }
}

/// Returns a string unless it is empty, for an attribute that may be missing.
pub fn filled(string: &str) -> Option<&str> {
    Some(string).filter(|string| !string.is_empty())
}
