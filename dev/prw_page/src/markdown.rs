//! Tables of the documents, which are written in Markdown.

use crate::tables::{Kind, table_of_rows};
use crate::{escape, escape_text, read};
use anyhow::{Context, Result, ensure};
use std::path::Path;

/// Returns the first table below a heading of a document, in HTML. Formulas stay as they are.
pub fn table(path: &Path, heading: &str) -> Result<String> {
    let text = read(path)?;
    let mut lines = text
        .lines()
        .skip_while(|line| line.trim_start_matches('#').strip_prefix(' ') != Some(heading))
        .skip(1)
        .take_while(|line| !line.starts_with('#'))
        .skip_while(|line| !line.starts_with('|'))
        .take_while(|line| line.starts_with('|'))
        .map(|line| line.trim_matches('|').split('|').map(str::trim).collect::<Vec<_>>());
    let header = lines.next().with_context(|| format!("{}: no table below “{heading}”", path.display()))?;
    let mut rows = Vec::new();
    // The line below the header consists of dashes.
    for row in lines.skip(1) {
        ensure!(
            row.len() == header.len(),
            "{}: below “{heading}” the row of “{}” has {} cells, not {}",
            path.display(),
            row[0],
            row.len(),
            header.len()
        );
        let cell = |(column, cell): (usize, &&str)| {
            let label = match column > 0 && !cell.is_empty() {
                true => format!(" data-label=\"{}:\"", escape(header[column])),
                false => String::new(),
            };
            format!("<td{label}>{}</td>", inline(cell))
        };
        rows.push(format!("<tr>{}</tr>", row.iter().enumerate().map(cell).collect::<String>()));
    }
    let header: Vec<_> = header.into_iter().map(escape).collect();
    Ok(table_of_rows("", &header, &rows, &[], Kind::Text))
}

/// Returns a cell in HTML: code in backticks, and links without their targets, which the FMU does not contain.
fn inline(cell: &str) -> String {
    let mut text = String::new();
    let mut rest = cell;
    while let Some((before, after)) = rest.split_once("](")
        && let Some((start, label)) = before.rsplit_once('[')
        && let Some((_, behind)) = after.split_once(')')
    {
        text += &(start.to_owned() + label);
        rest = behind;
    }
    let text = escape_text(&(text + rest));
    let parts = text.split('`').enumerate();
    parts.map(|(k, part)| if k % 2 == 1 { format!("<code>{part}</code>") } else { part.to_owned() }).collect()
}

#[cfg(test)]
mod tests {
    use super::table;
    use std::fs;

    #[test]
    fn tables_are_found_and_gaps_are_named() {
        let directory = std::env::temp_dir().join(format!("prw_page_{}", std::process::id()));
        fs::create_dir_all(&directory).unwrap();
        let path = directory.join("tables.md");
        let text = "# Run\n\ntext\n\n## Deeper\n\n| a | b |\n|---|---|\n| `1` | [2](c.md) < 3 |\n\n## Gap\n\n| a | b |\n|---|---|\n| 1 |\n";
        fs::write(&path, text).unwrap();
        let html = table(&path, "Deeper").unwrap();
        assert!(html.contains("<td><code>1</code></td><td data-label=\"b:\">2 &lt; 3</td>"), "{html}");
        for (heading, message) in
            [("Run", "no table below “Run”"), ("Gap", "the row of “1” has 1 cells, not 2")]
        {
            assert!(table(&path, heading).unwrap_err().to_string().contains(message));
        }
        fs::remove_dir_all(directory).unwrap();
    }
}
