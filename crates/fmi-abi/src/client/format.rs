//! Expands `printf` formats in log messages (section 2.1.5 of FMI 2.0), without trusting them.
//!
//! Many FMUs pass finished text as the format. Percent signs in this text look like conversions, but have no arguments. So a
//! conversion is expanded only if that is harmless: numbers are copied from registers and the stack, and strings are read through
//! the kernel, which reports invalid pointers (only on Linux; elsewhere `%s` stays in the text). `%n`, which would write to memory,
//! and unknown conversions stay in the text.

use std::ffi::{CStr, CString};

/// Without a precision, a string argument is cut after this many bytes.
const LONGEST: usize = 1 << 16;

/// Arguments of a variadic call that have not been used yet.
pub(crate) struct Arguments {
    /// Integers and pointers.
    words: std::array::IntoIter<usize, 8>,
    /// Floating-point numbers.
    numbers: std::array::IntoIter<f64, 8>,
}

/// A conversion specification of a format, such as `%-5.2f`.
struct Conversion<'a> {
    flags: &'a str,
    width: Option<i32>,
    precision: Option<i32>,
    /// Length modifier: `h`, `l`, `ll` and so on.
    length: &'a str,
    kind: char,
}

impl Arguments {
    pub fn new(words: [usize; 8], numbers: [f64; 8]) -> Self {
        Self { words: words.into_iter(), numbers: numbers.into_iter() }
    }

    /// Returns the format with its conversions replaced by the arguments.
    pub fn expand(mut self, format: &str) -> String {
        let mut text = String::with_capacity(format.len());
        let mut rest = format;
        while let Some(at) = rest.find('%') {
            text.push_str(&rest[..at]);
            rest = &rest[at..];
            if let Some(after) = rest.strip_prefix("%%") {
                text.push('%');
                rest = after;
                continue;
            }
            let (length, expanded) = match self.parse(&rest[1..]) {
                Some((length, conversion)) => (1 + length, self.convert(&conversion)),
                None => (1, None),
            };
            text.push_str(expanded.as_deref().unwrap_or(&rest[..length]));
            rest = &rest[length..];
        }
        text + rest
    }

    /// Parses the conversion after a percent sign, and returns its length (without the sign) and its parts. Returns
    /// `None` if there is no conversion: a percent-encoded character of a URI, or a percent sign before a space, is not
    /// a conversion.
    fn parse<'a>(&mut self, text: &'a str) -> Option<(usize, Conversion<'a>)> {
        let bytes = text.as_bytes();
        if let [high, low, ..] = bytes
            && high.is_ascii_digit()
            && (low.is_ascii_uppercase() && low.is_ascii_hexdigit() || (high, low) == (&b'2', &b'0'))
        {
            return None;
        }
        let span = |from: usize, of: &[u8]| bytes[from..].iter().take_while(|byte| of.contains(byte)).count();
        let flags = span(0, b"-+#0");
        let mut at = flags;
        let mut number = |at: &mut usize| -> Option<i32> {
            if bytes.get(*at) == Some(&b'*') {
                *at += 1;
                return self.words.next().map(|word| word as i32);
            }
            let digits = span(*at, b"0123456789");
            let number = &text[*at..*at + digits];
            *at += digits;
            (digits > 0).then(|| number.parse().unwrap_or(i32::MAX))
        };
        let width = number(&mut at);
        let mut precision = None;
        if bytes.get(at) == Some(&b'.') {
            at += 1;
            precision = Some(number(&mut at).unwrap_or(0));
        }
        let modifier = span(at, b"hljztq");
        let length = &text[at..at + modifier];
        at += modifier;
        let kind = text[at..].chars().next().filter(|kind| "diuoxXcspfFeEgGn".contains(*kind))?;
        Some((at + 1, Conversion { flags: &text[..flags], width, precision, length, kind }))
    }

    /// Formats the next argument. Returns `None` if the conversion must stay in the text.
    fn convert(&mut self, of: &Conversion) -> Option<String> {
        /// Maximum width and precision. Text with a larger one is almost certainly not meant as a conversion.
        const WIDEST: i32 = 200;
        let part = |number: Option<i32>, before: &str| {
            number.map(|number| format!("{before}{number}")).unwrap_or_default()
        };
        let Conversion { flags, length, kind, .. } = *of;
        let (width, precision) = (part(of.width, ""), part(of.precision, "."));
        if [of.width, of.precision].into_iter().flatten().any(|number| !(0..=WIDEST).contains(&number)) {
            self.words.next();
            return None;
        }
        match kind {
            'f' | 'F' | 'e' | 'E' | 'g' | 'G' => {
                let value = self.numbers.next()?;
                print(&format!("%{flags}{width}{precision}{kind}"), Printed::Number(value))
            }
            'n' => {
                self.words.next();
                None
            }
            's' => {
                let limit = of.precision.map_or(LONGEST, |limit| limit as usize);
                let text = string_at(self.words.next()?, limit)?;
                let width = of.width.unwrap_or(0) as usize;
                Some(if flags.contains('-') { format!("{text:<width$}") } else { format!("{text:>width$}") })
            }
            'c' => char::from_u32(self.words.next()? as u32 & 0xff)
                .filter(|char| !char.is_control())
                .map(String::from),
            'p' => Some(format!("{:#x}", self.words.next()?)),
            _ => {
                let word = self.words.next()?;
                let signed = matches!(kind, 'd' | 'i');
                let value = match (length, signed) {
                    ("", true) => i64::from(word as i32),
                    ("h", true) => i64::from(word as i16),
                    ("hh", true) => i64::from(word as i8),
                    ("", false) => i64::from(word as u32),
                    ("h", false) => i64::from(word as u16),
                    ("hh", false) => i64::from(word as u8),
                    _ => word as i64,
                };
                print(&format!("%{flags}{width}{precision}ll{kind}"), Printed::Integer(value))
            }
        }
    }
}

/// A value that `snprintf` formats.
enum Printed {
    Integer(i64),
    Number(f64),
}

/// Formats a value with `snprintf`. The format must have exactly one conversion, which fits the type of the value. Returns `None` if
/// the result is too long.
fn print(format: &str, value: Printed) -> Option<String> {
    let format = CString::new(format).ok()?;
    // A number printed with `%f` has at most 309 digits before the point; width and precision are limited to 200.
    let mut buffer = [0_u8; 640];
    let to = buffer.as_mut_ptr().cast();
    // SAFETY: the buffer has this size; the format has one conversion, for a value of this type.
    let length = unsafe {
        match value {
            Printed::Integer(value) => libc::snprintf(to, buffer.len(), format.as_ptr(), value),
            Printed::Number(value) => libc::snprintf(to, buffer.len(), format.as_ptr(), value),
        }
    };
    usize::try_from(length).ok().filter(|length| *length < buffer.len())?;
    CStr::from_bytes_until_nul(&buffer).ok()?.to_str().ok().map(str::to_owned)
}

/// Returns the string at an address, at most `limit` bytes of it. Returns `None` if there is no readable text. The kernel copies the
/// bytes, because the address may be invalid.
#[cfg(target_os = "linux")]
fn string_at(address: usize, limit: usize) -> Option<String> {
    use std::os::unix::fs::FileExt;
    /// Smallest page size. No read crosses a page boundary, because the next page may not be readable.
    const PAGE: usize = 4096;
    let memory = std::fs::File::open("/proc/self/mem").ok().filter(|_| address >= PAGE)?;
    let (mut found, mut page) = (Vec::new(), [0; PAGE]);
    while found.len() < limit {
        let next = address.checked_add(found.len())?;
        let part = &mut page[..(PAGE - next % PAGE).min(limit - found.len())];
        memory.read_exact_at(part, next as u64).ok()?;
        let end = part.iter().position(|byte| *byte == 0);
        found.extend_from_slice(&part[..end.unwrap_or(part.len())]);
        if end.is_some() {
            break;
        }
    }
    let is_text = |text: &String| !text.chars().any(|char| char.is_control() && !"\t\r\n".contains(char));
    let is_cut = found.len() >= LONGEST;
    if is_cut {
        // The last character may be incomplete.
        let valid = found.utf8_chunks().next().map_or(0, |chunk| chunk.valid().len());
        if found.len() - valid < 4 {
            found.truncate(valid);
        }
    }
    // If the caller passed no argument, the address is arbitrary, and may point to data that is not text.
    let text = String::from_utf8(found).ok().filter(is_text)?;
    Some(if is_cut { format!("{text}... (cut after {LONGEST} bytes)") } else { text })
}

/// Returns `None`, so that `%s` stays in the text.
#[cfg(not(target_os = "linux"))]
fn string_at(_address: usize, _limit: usize) -> Option<String> {
    None
}

#[cfg(test)]
mod tests {
    use super::{Arguments, LONGEST};

    fn expand(format: &str, words: &[usize], numbers: &[f64]) -> String {
        let (mut all, mut reals) = ([0; 8], [0.0; 8]);
        all[..words.len()].copy_from_slice(words);
        reals[..numbers.len()].copy_from_slice(numbers);
        Arguments::new(all, reals).expand(format)
    }

    #[test]
    #[cfg_attr(miri, ignore = "Miri has neither snprintf nor the file of the memory")]
    fn numbers_are_as_in_c() {
        let minus = -3_i32 as u32 as usize;
        assert_eq!(
            expand("%d %5d|%-5d|%u %x %ld", &[minus, 7, 7, 8, 255, usize::MAX], &[]),
            "-3     7|7    |8 ff -1"
        );
        assert_eq!(expand("%hhd %hu %c %p", &[0x1ff, 0x1_0001, 65, 16], &[]), "-1 1 A 0x10");
        assert_eq!(
            expand("%g, %5.1e, %.3f, %f, 100 %%", &[], &[0.5, 1e-9, 2.0, 1.0]),
            "0.5, 1.0e-09, 2.000, 1.000000, 100 %"
        );
        assert_eq!(expand("%*d|%.*f", &[4, 7, 1], &[0.25]), "   7|0.2");
        // Integers and floating-point numbers are counted separately.
        assert_eq!(expand("%f %d %f %d", &[1, 2], &[0.5, 1.5]), "0.500000 1 1.500000 2");
    }

    #[cfg(target_os = "linux")]
    #[test]
    #[cfg_attr(miri, ignore = "Miri has neither snprintf nor the file of the memory")]
    fn strings_are_read_if_they_exist() {
        let tank = c"tank".as_ptr().addr();
        assert_eq!(expand("%s|%6s|%-6s|%.2s", &[tank; 4], &[]), "tank|  tank|tank  |ta");
        let long = std::ffi::CString::new("\u{e4}".repeat(LONGEST)).unwrap();
        let cut = expand("<%s>", &[long.as_ptr().addr()], &[]);
        assert_eq!(cut, format!("<{}... (cut after 65536 bytes)>", "\u{e4}".repeat(LONGEST / 2)));
        for wrong in [0, 1, 0x1000, usize::MAX - 1, usize::MAX / 2] {
            assert_eq!(expand("the %s is %n empty", &[wrong, wrong], &[]), "the %s is %n empty");
        }
    }

    #[test]
    #[cfg_attr(miri, ignore = "Miri has neither snprintf nor the file of the memory")]
    fn text_that_is_no_format_stays() {
        for text in [
            "",
            "100 %",
            "100% of it",
            "50% done",
            "file:///a%20directory/%C3%A9%2F%3A",
            "%n %hhn %y %",
            "%99999999999999999999d",
            "%500d",
            "%Lf",
            "5 %\u{e9}",
        ] {
            assert_eq!(expand(text, &[1; 8], &[]), text);
        }
        // Only 8 integers can be read, so the ninth conversion stays.
        assert_eq!(expand(&"%d ".repeat(9), &[1; 8], &[]), "1 1 1 1 1 1 1 1 %d ");
    }
}
