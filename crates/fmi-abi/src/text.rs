//! Makes strings from files and FMUs safe to print in messages.

use std::borrow::Cow;

/// Maximum number of characters of a string that a message quotes.
pub const SHOWN: usize = 200;

/// Returns a string that can be printed in a message of one line. Control characters, and characters that reorder or
/// end a line, are escaped as in Rust, because a terminal would interpret them. A string of more than [`SHOWN`]
/// characters is cut, and ends with `...`.
pub fn shown(text: &str) -> Cow<'_, str> {
    shown_to(text, SHOWN)
}

/// Escapes and cuts a string as [`shown`] does, but after `most` characters.
pub fn shown_to(text: &str, most: usize) -> Cow<'_, str> {
    let cut = text.char_indices().nth(most).map_or(text.len(), |(index, _)| index);
    let mut line = one_line(&text[..cut]);
    if cut < text.len() {
        line.to_mut().push_str("...");
    }
    line
}

/// Escapes a string as [`shown`] does, without cutting it.
pub fn one_line(text: &str) -> Cow<'_, str> {
    if !text.contains(is_unsafe) {
        return Cow::Borrowed(text);
    }
    let mut escaped = String::with_capacity(text.len() + 16);
    for letter in text.chars() {
        if is_unsafe(letter) {
            escaped.extend(letter.escape_default());
        } else {
            escaped.push(letter);
        }
    }
    Cow::Owned(escaped)
}

/// Returns a number for a message, with an exponent if it would need many zeros, as a very short time would.
pub fn shown_number(number: f64) -> impl std::fmt::Display {
    crate::Value::Real(number)
}

/// Returns whether a terminal or an editor would interpret the character instead of showing it. These are control
/// characters, line and paragraph separators, and marks that change the direction of text.
fn is_unsafe(letter: char) -> bool {
    letter.is_control()
        || matches!(letter, '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// Returns whether a string is an identifier of C, as the FMI standard requires for `modelIdentifier`.
pub fn is_c_identifier(text: &str) -> bool {
    let mut letters = text.chars();
    letters.next().is_some_and(|first| first.is_ascii_alphabetic() || first == '_')
        && letters.all(|letter| letter.is_ascii_alphanumeric() || letter == '_')
}

/// Returns whether a name is structured (section 2.2.9 of FMI 2.0, 2.4.7.5 of FMI 3.0): `a.'b c'[1,2].d`, `der(a[1])`, `der(a, 2)`.
pub fn is_structured_name(name: &str) -> bool {
    if let Some(differentiated) = name.strip_prefix("der(").and_then(|name| name.strip_suffix(')')) {
        // A comma within brackets separates indices.
        return match differentiated.rsplit_once(',') {
            Some((name, order)) if is_number(order.trim()) => is_path(name),
            _ => is_path(differentiated),
        };
    }
    is_path(name)
}

fn is_number(text: &str) -> bool {
    !text.is_empty() && text.bytes().all(|digit| digit.is_ascii_digit())
}

/// Whether this is a sequence of names, with or without indices, separated by dots.
fn is_path(mut rest: &str) -> bool {
    loop {
        rest = match rest.strip_prefix('\'') {
            Some(quoted) => {
                let mut escaped = false;
                let end = quoted.find(|c| {
                    let ends = c == '\'' && !escaped;
                    escaped = c == '\\' && !escaped;
                    ends
                });
                match end {
                    Some(end) if end > 0 => &quoted[end + 1..],
                    _ => return false,
                }
            }
            None => {
                let end = rest.find(['[', '.']).unwrap_or(rest.len());
                if !is_c_identifier(&rest[..end]) {
                    return false;
                }
                &rest[end..]
            }
        };
        if let Some(indices) = rest.strip_prefix('[') {
            let Some((indices, behind)) = indices.split_once(']') else { return false };
            if !indices.split(',').map(str::trim).all(is_number) {
                return false;
            }
            rest = behind;
        }
        match rest.strip_prefix('.') {
            Some(behind) => rest = behind,
            None => return rest.is_empty(),
        }
    }
}

/// Returns whether a string is safe as the name of a file in any directory: it contains only letters, digits, spaces and `_-+.`, and
/// begins with a letter, a digit or `_`. So it is neither a path nor an option of a program.
pub fn is_plain_file_name(text: &str) -> bool {
    let is_first = |letter: char| letter.is_alphanumeric() || letter == '_';
    text.chars().next().is_some_and(is_first)
        && text.chars().all(|letter| is_first(letter) || " -+.".contains(letter))
}

#[cfg(test)]
mod tests {
    use super::{is_c_identifier, is_plain_file_name, one_line, shown};

    #[test]
    fn characters_that_a_terminal_interprets_are_escaped() {
        assert_eq!(shown("x \u{e4}\u{1f600}"), "x \u{e4}\u{1f600}");
        assert_eq!(shown("\u{1b}[31m\r\n\t\0"), "\\u{1b}[31m\\r\\n\\t\\u{0}");
        assert_eq!(one_line("a\u{9b}b\u{202e}c\u{2028}d"), "a\\u{9b}b\\u{202e}c\\u{2028}d");
        assert_eq!(shown(&"\u{e4}".repeat(1000)), format!("{}...", "\u{e4}".repeat(200)));
    }

    #[test]
    fn identifiers() {
        assert!(["a", "_1", "Model_2"].into_iter().all(is_c_identifier));
        assert!(
            !["", "1a", "a.b", "a-b", "a\n", "\u{e4}", "a();system(\"x\")", "../a"]
                .into_iter()
                .any(is_c_identifier)
        );
        assert!(["a", "a-b", "2.Model 1", "\u{e4}"].into_iter().all(is_plain_file_name));
        assert!(
            !["", ".", "../a", "a/b", "a\\b", "c:a", "-a", "a\n", "a;b", "$(a)", "a\"", "a\0", "a\u{202e}b"]
                .into_iter()
                .any(is_plain_file_name)
        );
    }
}
