//! Tables of the model description and of the numbers. The style sheet shows a row as a paragraph in narrow windows.

use crate::escape;
use roxmltree::Document;
use serde_json::Value as Json;
use std::collections::HashMap;

/// Labels of the outputs in the table of orders.
const OUTPUTS: [(&str, &str); 5] = [
    ("pitch", "pitch"),
    ("roll", "roll"),
    ("pitch_rate", "pitch rate"),
    ("roll_rate", "roll rate"),
    ("tau1", "torque"),
];

/// CSS class of a table.
#[derive(Clone, Copy)]
pub enum Kind {
    /// Numbers.
    Plain,
    /// Rows that become paragraphs in narrow windows.
    Rows,
    /// The same, with cells of text.
    Text,
}

/// A variable of the model description.
#[derive(Clone)]
pub struct Variable {
    name: String,
    causality: String,
    unit: String,
    start: String,
    description: String,
}

/// Returns the variables of a model description of FMI 2.0.
pub fn variables(description: &Document) -> Vec<Variable> {
    let nodes = |tag| description.descendants().filter(move |node| node.has_tag_name(tag));
    let units: HashMap<_, _> = nodes("SimpleType")
        .filter_map(|declared| {
            Some((declared.attribute("name")?, declared.first_element_child()?.attribute("unit")?))
        })
        .collect();
    let variable = |node: roxmltree::Node| {
        let kind = node.first_element_child()?;
        let text = |node: roxmltree::Node, name| node.attribute(name).unwrap_or_default().to_owned();
        let declared = kind.attribute("declaredType").and_then(|name| units.get(name).copied());
        let unit = kind.attribute("unit").or(declared).filter(|unit| *unit != "1");
        let start = text(kind, "start");
        Some(Variable {
            name: text(node, "name"),
            causality: node.attribute("causality").unwrap_or("local").to_owned(),
            unit: unit.map_or_else(String::new, pretty),
            start: if kind.has_tag_name("Real") { eight_digits(&start) } else { start },
            description: text(node, "description"),
        })
    };
    nodes("ScalarVariable").filter_map(variable).collect()
}

/// Returns the table with name, unit and meaning of the variables of a causality.
pub fn of_causality(variables: &[Variable], causality: &str, title: &str) -> String {
    let row = |Variable { name, unit, description, .. }: &Variable| {
        let (name, meaning) = (escape(name), escape(description));
        format!("<tr><td><code>{name}</code></td><td>{unit}</td><td class=\"meaning\">{meaning}</td></tr>")
    };
    let rows: Vec<_> = variables.iter().filter(|one| one.causality == causality).map(row).collect();
    table_of_rows(title, &["name", "unit", "meaning"], &rows, &[], Kind::Rows)
}

/// Returns the table of the parameters with their start values, and the values and units that the paper prints.
pub fn parameters(variables: &[Variable], printed: Option<&Json>) -> String {
    let row = |Variable { name, unit, start, description, .. }: &Variable| {
        let as_printed = printed.map_or_else(String::new, |printed| match &printed[name] {
            Json::Null => "<td class=\"number\"></td>".to_owned(),
            paper => {
                let unit =
                    paper["unit"].as_str().filter(|unit| *unit != "1").map_or_else(String::new, pretty);
                let value = format!("{} {unit}", eight_digits(&paper["value"].to_string()));
                format!("<td class=\"number\" data-label=\"printed:\">{}</td>", value.trim())
            }
        });
        format!(
            "<tr><td><code>{}</code></td><td class=\"number\">{start}</td><td>{unit}</td>{as_printed}\
             <td class=\"meaning\">{}</td></tr>",
            escape(name),
            escape(description)
        )
    };
    let rows: Vec<_> = variables.iter().filter(|one| one.causality == "parameter").map(row).collect();
    match printed {
        None => table_of_rows("", &["name", "start", "unit", "meaning"], &rows, &[1], Kind::Rows),
        Some(_) => {
            table_of_rows("", &["name", "start", "unit", "as printed", "meaning"], &rows, &[1, 3], Kind::Rows)
        }
    }
}

/// Returns the table of the orders of convergence, with the error at a step of 1 ms.
pub fn orders(numbers: &Json) -> String {
    let row = |(name, label): (&str, &str)| {
        let order = |which: &str| format!("{:.2}", numbers[which][name].as_f64().unwrap_or(f64::NAN));
        let cells =
            [order("order_angles"), order("order_rates"), numbers["error_1ms_percent"][name].to_string()];
        let cells = cells.map(|cell| format!("<td class=\"number\">{cell}</td>"));
        format!("<tr><td>{label}</td>{}</tr>", cells.concat())
    };
    let header = ["output", "order, angles only", "order, use_omega", "error at 1 ms (%)"];
    table_of_rows("", &header, &OUTPUTS.map(row), &[1, 2, 3], Kind::Plain)
}

/// Returns a table in HTML. `numbers`: indices of the columns with right-aligned numbers.
pub fn table_of_rows(
    title: &str,
    header: &[impl AsRef<str>],
    rows: &[String],
    numbers: &[usize],
    kind: Kind,
) -> String {
    let head = header.iter().enumerate().map(|(column, name)| {
        let class = if numbers.contains(&column) { " class=\"number\"" } else { "" };
        format!("<th{class}>{}</th>", name.as_ref())
    });
    let heading = if title.is_empty() { String::new() } else { format!("<h3>{title}</h3>\n") };
    let class = match kind {
        Kind::Plain => "",
        Kind::Rows => " class=\"rows\"",
        Kind::Text => " class=\"rows text\"",
    };
    format!(
        "{heading}<div class=\"scroll\" tabindex=\"0\"><table{class}>\n<thead><tr>{}</tr></thead>\n<tbody>\n{}\n</tbody>\n\
         </table></div>",
        head.collect::<String>(),
        rows.join("\n")
    )
}

/// Returns a number with at most eight significant digits.
fn eight_digits(number: &str) -> String {
    let rounded = number.parse::<f64>().ok().and_then(|value| format!("{value:.7e}").parse::<f64>().ok());
    rounded.map_or_else(|| number.to_owned(), |value| value.to_string())
}

/// Returns kg.m2 as kg m².
fn pretty(unit: &str) -> String {
    escape(&unit.replace('.', "\u{202f}").replace("s2", "s²").replace("m2", "m²"))
}
