//! Formulas: the part of LaTeX that the pages use, as MathML.

use anyhow::{Context, Result, bail};
use std::iter::Peekable;
use std::vec::IntoIter;

/// Commands and characters that stand for themselves, and their MathML.
const SYMBOLS: [(&str, &str); 18] = [
    ("\\theta", "<mi>θ</mi>"),
    ("\\varphi", "<mi>φ</mi>"),
    ("\\gamma", "<mi>γ</mi>"),
    ("\\mu", "<mi>μ</mi>"),
    ("\\pi", "<mi>π</mi>"),
    ("\\tau", "<mi>τ</mi>"),
    ("\\Delta", "<mi>Δ</mi>"),
    ("\\pm", "<mi>±</mi>"),
    ("\\sin", "<mi>sin</mi>"),
    ("\\quad", "<mspace width=\"1em\" />"),
    ("\\,", "<mspace width=\"0.167em\" />"),
    ("-", "<mo>−</mo>"),
    ("+", "<mo>+</mo>"),
    ("=", "<mo>=</mo>"),
    ("/", "<mo>/</mo>"),
    (",", "<mo>,</mo>"),
    ("(", "<mo stretchy=\"false\">(</mo>"),
    (")", "<mo stretchy=\"false\">)</mo>"),
];

/// Replaces the formulas in a page, `\( ... \)` and `\[ ... \]`. `\tag{8}` between `\[` and `\]` puts a number next to the equation.
pub fn typeset(page: &str) -> Result<String> {
    let mut typeset = String::new();
    let mut rest = page;
    while let Some(start) = rest.find("\\(").into_iter().chain(rest.find("\\[")).min() {
        let (before, formula) = rest.split_at(start);
        let is_block = formula.starts_with("\\[");
        let end = if is_block { "\\]" } else { "\\)" };
        let (formula, after) =
            formula[2..].split_once(end).with_context(|| format!("a formula lacks {end}: {formula:.60}"))?;
        typeset += before;
        typeset += &if is_block { block(formula)? } else { mathml(formula, "inline")? };
        rest = after;
    }
    Ok(typeset + rest)
}

fn block(formula: &str) -> Result<String> {
    let tagged =
        formula.split_once("\\tag{").and_then(|(formula, tag)| Some((formula, tag.split_once('}')?.0)));
    let (formula, number) = match tagged {
        Some((formula, tag)) => (formula, format!("<span class=\"number\">({tag})</span>")),
        None => (formula, String::new()),
    };
    Ok(format!("<div class=\"equation\" tabindex=\"0\">{}{number}</div>", mathml(formula, "block")?))
}

fn mathml(formula: &str, display: &str) -> Result<String> {
    let mut parser = Parser { tokens: tokens(formula).into_iter().peekable() };
    let row = parser.row(&[]).with_context(|| format!("in the formula {}", formula.trim()))?;
    Ok(format!("<math display=\"{display}\"><mrow>{row}</mrow></math>"))
}

/// Splits a formula into commands, numbers and other characters. Spaces have no meaning, except in `\text`.
fn tokens(formula: &str) -> Vec<String> {
    let mut tokens: Vec<String> = Vec::new();
    for character in formula.chars() {
        let last = tokens.last_mut();
        match last {
            Some(last) if continues(last, character) => last.push(character),
            _ => tokens.push(character.to_string()),
        }
    }
    tokens
}

fn continues(token: &str, character: char) -> bool {
    match token.strip_prefix('\\') {
        Some("") => true,
        Some(name) => name.ends_with(char::is_alphabetic) && character.is_ascii_alphabetic(),
        None => token.ends_with(|last: char| last.is_ascii_digit()) && character.is_ascii_digit(),
    }
}

struct Parser {
    tokens: Peekable<IntoIter<String>>,
}

impl Parser {
    /// Returns the next token that is not a space.
    fn next(&mut self) -> Option<String> {
        self.tokens.by_ref().find(|token| !token.trim().is_empty())
    }

    fn next_is(&mut self, expected: &str) -> bool {
        while self.tokens.next_if(|token| token.trim().is_empty()).is_some() {}
        self.tokens.next_if_eq(expected).is_some()
    }

    /// Reads up to one of these tokens, or up to the end of the formula if there are none, and leaves the token.
    fn row(&mut self, ends: &[&str]) -> Result<String> {
        let mut row = String::new();
        loop {
            while self.tokens.next_if(|token| token.trim().is_empty()).is_some() {}
            match self.tokens.peek() {
                None if ends.is_empty() => return Ok(row),
                None => bail!("{} is missing", ends[0]),
                Some(token) if ends.contains(&token.as_str()) => return Ok(row),
                Some(_) => row += &self.element_with_indices()?,
            }
        }
    }

    fn element_with_indices(&mut self) -> Result<String> {
        let base = self.element()?;
        let below = if self.next_is("_") { Some(self.element()?) } else { None };
        let above = if self.next_is("^") { Some(self.element()?) } else { None };
        Ok(match (below, above) {
            (None, None) => base,
            (Some(below), None) => format!("<msub>{base}{below}</msub>"),
            (None, Some(above)) => format!("<msup>{base}{above}</msup>"),
            (Some(below), Some(above)) => format!("<msubsup>{base}{below}{above}</msubsup>"),
        })
    }

    fn element(&mut self) -> Result<String> {
        let token = self.next().context("the end is missing")?;
        if let Some((_, symbol)) = SYMBOLS.iter().find(|(name, _)| *name == token) {
            return Ok((*symbol).to_owned());
        }
        let accented =
            |parser: &mut Self, accent| Ok(format!("<mover>{}{accent}</mover>", parser.element()?));
        match token.as_str() {
            "{" => {
                let row = self.row(&["}"])?;
                self.next();
                Ok(format!("<mrow>{row}</mrow>"))
            }
            "\\frac" => Ok(format!("<mfrac>{}{}</mfrac>", self.element()?, self.element()?)),
            "\\dot" => accented(self, "<mo>˙</mo>"),
            "\\ddot" => accented(self, "<mo>¨</mo>"),
            "\\hat" => accented(self, "<mo stretchy=\"false\">^</mo>"),
            "\\mathbf" => Ok(format!("<mi>{}</mi>", self.braces()?.chars().map(bold).collect::<String>())),
            "\\text" => Ok(format!("<mtext>{}</mtext>", self.braces()?.replace(' ', "\u{a0}"))),
            "\\left" => self.fenced(),
            "\\begin" => self.matrix(),
            // Characters such as a bold 1, which has no command.
            other if other.chars().all(char::is_numeric) => Ok(format!("<mn>{other}</mn>")),
            other if other.chars().all(char::is_alphabetic) => Ok(format!("<mi>{other}</mi>")),
            other => bail!("{other} is not supported"),
        }
    }

    /// Returns the characters between braces.
    fn braces(&mut self) -> Result<String> {
        if !self.next_is("{") {
            bail!("{{ is missing");
        }
        let content = self.tokens.by_ref().take_while(|token| token != "}");
        Ok(content.collect())
    }

    /// Reads what follows `\left`, up to `\right` and its bracket.
    fn fenced(&mut self) -> Result<String> {
        let fence = |bracket: Option<String>, form| {
            let bracket = bracket.context("a bracket is missing")?;
            Ok::<_, anyhow::Error>(format!(
                "<mo stretchy=\"true\" fence=\"true\" form=\"{form}\">{bracket}</mo>"
            ))
        };
        let start = fence(self.next(), "prefix")?;
        let row = self.row(&["\\right"])?;
        self.next();
        Ok(format!("<mrow>{start}{row}{}</mrow>", fence(self.next(), "postfix")?))
    }

    /// Reads a matrix after `\begin`. The style sheet draws its brackets, because characters for brackets grow with the matrix only
    /// in a font for mathematics.
    fn matrix(&mut self) -> Result<String> {
        if self.braces()? != "bmatrix" {
            bail!("only bmatrix is supported");
        }
        let mut rows = "<mtr>".to_owned();
        loop {
            rows += &format!("<mtd>{}</mtd>", self.row(&["&", "\\\\", "\\end"])?);
            match self.next().as_deref() {
                Some("&") => {}
                Some("\\\\") => rows += "</mtr><mtr>",
                _ => break,
            }
        }
        self.braces()?;
        Ok(format!("<mtable class=\"matrix\">{rows}</mtr></mtable>"))
    }
}

/// Returns the bold form of a letter.
fn bold(letter: char) -> char {
    let shifted = |first: u32, from: char| char::from_u32(first + letter as u32 - from as u32);
    match letter {
        'A'..='Z' => shifted(0x1d400, 'A').unwrap_or(letter),
        'a'..='z' => shifted(0x1d41a, 'a').unwrap_or(letter),
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::typeset;

    #[test]
    fn formulas_become_mathml() {
        for (formula, mathml) in [
            (
                r"\(\dot\theta_1^2\)",
                "<msubsup><mover><mi>θ</mi><mo>˙</mo></mover><mn>1</mn><mn>2</mn></msubsup>",
            ),
            (r"\(\frac{N}{2M}\)", "<mfrac><mrow><mi>N</mi></mrow><mrow><mn>2</mn><mi>M</mi></mrow></mfrac>"),
            (
                r"\[ \mathbf{K} \tag{8} \]",
                "<math display=\"block\"><mrow><mi>𝐊</mi></mrow></math><span class=\"number\">(8)</span>",
            ),
            (
                r"\(\begin{bmatrix} 1 & 0 \\ k \end{bmatrix}\)",
                "<mtr><mtd><mn>1</mn></mtd><mtd><mn>0</mn></mtd></mtr><mtr><mtd><mi>k</mi></mtd></mtr>",
            ),
        ] {
            let typeset = typeset(formula).unwrap();
            assert!(typeset.contains(mathml), "{typeset}");
        }
    }

    #[test]
    fn faults_of_formulas_are_named() {
        for (formula, message) in [
            (r"\(\sqrt{2}\)", r"\sqrt is not supported"),
            (r"\(x_{1\)", "} is missing"),
            (r"\(x^\)", "the end is missing"),
            (r"\[ x", r"a formula lacks \]"),
        ] {
            let error = format!("{:#}", typeset(formula).unwrap_err());
            assert!(error.contains(message), "{error}");
        }
    }
}
