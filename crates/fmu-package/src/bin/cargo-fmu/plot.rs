//! Draws the results of a simulation: an SVG with a panel for each unit.

use crate::results::Column;
use anyhow::{Result, anyhow, bail};
use fmu_run::BaseType;
use plotters::prelude::*;
use std::fs;
use std::path::Path;

/// Colours that colour-blind people can distinguish (Okabe and Ito).
const COLOURS: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(0, 0, 0),
];

/// Draws the variables. Variables share a panel if both their units and their labels are equal, up to as many as there are colours.
pub fn plot(path: &Path, title: &str, time: &[f64], columns: &[Column]) -> Result<()> {
    let mut svg = String::new();
    let drawn: Vec<_> = columns.iter().filter(|column| is_drawn(column)).collect();
    if drawn.is_empty() {
        bail!("there are only strings and bytes");
    }
    draw(&mut svg, title, time, &drawn).map_err(|error| anyhow!("{error}"))?;
    // The backend has integer coordinates, so it draws a large image, which the SVG scales down.
    let (begin, rest) = svg.split_once('>').unwrap_or_default();
    let size = |name: &str| {
        let (_, value) = begin.split_once(&format!(" {name}=\""))?;
        value.split('"').next()?.parse::<u32>().ok()
    };
    let (width, height) = (size("width").unwrap_or_default(), size("height").unwrap_or_default());
    let (small, low) = (width / FINE, height / FINE);
    let begin = format!(
        "<svg width=\"{small}\" height=\"{low}\" viewBox=\"0 0 {width} {height}\" xmlns=\"http://www.w3.org/2000/svg\""
    );
    Ok(fs::write(path, format!("{begin}>{rest}"))?)
}

/// Factor by which the drawn image is larger than the SVG.
const FINE: u32 = 10;

fn draw(
    svg: &mut String,
    title: &str,
    time: &[f64],
    columns: &[&Column],
) -> Result<(), Box<dyn std::error::Error>> {
    let mut panels: Vec<Vec<&Column>> = Vec::new();
    for column in columns {
        let shares = |panel: &&mut Vec<&Column>| {
            panel[0].unit == column.unit && panel[0].labels == column.labels && panel.len() < COLOURS.len()
        };
        match panels.iter_mut().find(shares) {
            Some(panel) => panel.push(column),
            None => panels.push(vec![column]),
        }
    }
    let longest =
        columns.iter().flat_map(|column| &column.labels).map(|(_, text)| shown(text).chars().count());
    let space_of_labels = (8 * longest.max().unwrap_or_default() as u32 + 12).max(76);
    let height = 70 + 260 * panels.len() as u32;
    let root = SVGBackend::with_string(svg, (840 * FINE, height * FINE)).into_drawing_area();
    root.fill(&WHITE)?;
    let root = root.margin(10 * FINE, 0, 0, 0).titled(title, ("sans-serif", 22 * FINE))?;
    for (area, panel) in root.split_evenly((panels.len(), 1)).iter().zip(&panels) {
        let (unit, labels) = (panel[0].unit, &panel[0].labels);
        let values =
            || panel.iter().flat_map(|column| &column.values).copied().filter(|value| value.is_finite());
        let (low, high) =
            (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
        let (low, high) = if low <= high { (low, high) } else { (0.0, 1.0) };
        let margin = if high > low { 0.05 * (high - low) } else { 0.5 * high.abs().max(1.0) };
        let mut chart = ChartBuilder::on(area)
            .margin(12 * FINE)
            .x_label_area_size(40 * FINE)
            .y_label_area_size(space_of_labels * FINE)
            .build_cartesian_2d(time[0]..time[time.len() - 1], low - margin..high + margin)?;
        let [label_of_value, label_of_time] = [high - low + 2.0 * margin, time[time.len() - 1] - time[0]]
            .map(|range| move |value: &f64| label(*value, range));
        let label_of_value =
            |value: &f64| match labels.iter().find(|(number, _)| (number - value).abs() < 1e-6) {
                Some((_, label)) => shown(label),
                None if labels.is_empty() => label_of_value(value),
                None => String::new(),
            };
        let mut mesh = chart.configure_mesh();
        if !labels.is_empty() {
            // The grid has a line at each integer, because the numbers of labels are integers.
            mesh.y_labels((high - low) as usize + 1);
        }
        mesh.light_line_style(TRANSPARENT)
            .bold_line_style(BLACK.mix(0.12).stroke_width(FINE))
            .axis_style(BLACK.stroke_width(FINE))
            .set_all_tick_mark_size(5 * FINE)
            .x_desc("time in s")
            .y_desc(if unit.is_empty() { String::new() } else { format!("in {unit}") })
            .x_label_formatter(&label_of_time)
            .y_label_formatter(&label_of_value)
            .label_style(("sans-serif", 14 * FINE))
            .axis_desc_style(("sans-serif", 14 * FINE))
            .draw()?;
        for (column, colour) in panel.iter().zip(COLOURS) {
            let mut points: Vec<(f64, f64)> = Vec::with_capacity(2 * time.len());
            for (time, value) in time.iter().zip(&column.values).filter(|point| point.1.is_finite()) {
                let last = points.last().filter(|_| column.jumps).map(|last| (*time, last.1));
                points.extend(last.into_iter().chain([(*time, *value)]));
            }
            chart
                .draw_series(LineSeries::new(points, colour.stroke_width(2 * FINE)))?
                .label(column.name)
                .legend(move |(x, y)| {
                    PathElement::new([(x, y), (x + 20 * FINE as i32, y)], colour.stroke_width(2 * FINE))
                });
        }
        chart
            .configure_series_labels()
            .background_style(WHITE.mix(0.8))
            .border_style(TRANSPARENT)
            .margin(8 * FINE)
            .legend_area_size(30 * FINE)
            .position(corner(
                &panel.iter().map(|column| &column.values[..]).collect::<Vec<_>>(),
                panel.iter().map(|column| column.name.chars().count()).max().unwrap_or_default(),
                (low - margin, high + margin),
            ))
            .label_font(("sans-serif", 14 * FINE))
            .draw()?;
    }
    root.present()?;
    Ok(())
}

/// Returns the corner of a panel in which the legend covers the fewest points of the curves. `longest` is the number of characters of
/// the longest name, and the range is the one of the vertical axis.
fn corner(curves: &[&[f64]], longest: usize, (low, high): (f64, f64)) -> SeriesLabelPosition {
    use SeriesLabelPosition::{LowerLeft, LowerRight, UpperLeft, UpperRight};
    // About 9 of 740 px for a character, and 22 of 190 px for a line.
    let width = (0.08 + 0.012 * longest as f64).min(0.5);
    let height = (0.06 + 0.115 * curves.len() as f64).min(0.5);
    let covered = |is_right: bool, is_upper: bool| {
        let points = curves.iter().flat_map(|values| {
            let last = (values.len().max(2) - 1) as f64;
            values.iter().enumerate().map(move |(row, value)| (row as f64 / last, *value))
        });
        let is_covered = |&(x, value): &(f64, f64)| {
            let y = (value - low) / (high - low);
            (if is_right { 1.0 - x } else { x }) < width && (if is_upper { 1.0 - y } else { y }) < height
        };
        points.filter(is_covered).count()
    };
    let corners = [
        (UpperRight, true, true),
        (UpperLeft, false, true),
        (LowerRight, true, false),
        (LowerLeft, false, false),
    ];
    let best = corners.into_iter().min_by_key(|&(_, is_right, is_upper)| covered(is_right, is_upper));
    best.map_or(UpperRight, |(position, ..)| position)
}

/// Returns whether a variable is drawn: numbers always, strings only if they have few different values, and bytes never.
fn is_drawn(column: &Column) -> bool {
    const MOST: usize = 12;
    let is_text = column.base == BaseType::String;
    column.base != BaseType::Binary && !(is_text && column.labels.len() > MOST)
}

/// Returns a label that fits next to an axis.
fn shown(label: &str) -> String {
    const LONGEST: usize = 20;
    match label.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{}...", &label[..end]),
        None => label.to_owned(),
    }
}

/// Returns a label for an axis with this range, with enough digits to distinguish the labels. Zero has no sign.
fn label(value: f64, range: f64) -> String {
    let value = if value.abs() < 1e-6 * range { 0.0 } else { value };
    let digits = 4.0 - range.log10().ceil();
    if !(-2.0..=9.0).contains(&digits) {
        let text = format!("{value:.4e}");
        let (digits, exponent) = text.split_once('e').unwrap_or((&text, "0"));
        let digits = digits.trim_end_matches('0').trim_end_matches('.');
        return if value == 0.0 { "0".to_owned() } else { format!("{digits}e{exponent}") };
    }
    let text = format!("{value:.*}", digits.max(0.0) as usize);
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}

#[cfg(test)]
mod tests {
    use super::{corner, label};
    use plotters::prelude::SeriesLabelPosition;

    #[test]
    fn the_legend_is_in_a_corner_without_curves() {
        let curve =
            |value: fn(f64) -> f64| (0..=100).map(|row| value(f64::from(row) / 100.0)).collect::<Vec<_>>();
        let (rising, falling, low) = (curve(|x| x), curve(|x| 1.0 - x), curve(|_| 0.02));
        let position = |curves: &[&[f64]]| corner(curves, 1, (-0.05, 1.05));
        assert!(matches!(position(&[&rising]), SeriesLabelPosition::UpperLeft));
        assert!(matches!(position(&[&falling]), SeriesLabelPosition::UpperRight));
        assert!(matches!(position(&[&rising, &low]), SeriesLabelPosition::UpperLeft));
        assert!(matches!(position(&[&rising, &falling, &low]), SeriesLabelPosition::UpperRight));
    }

    #[test]
    fn axes_have_plain_numbers() {
        let cases =
            [(-1e-17, 1.0, "0"), (-0.0, 1.0, "0"), (0.30000000000000004, 1.0, "0.3"), (-0.25, 1.0, "-0.25")];
        let more = [
            (1500.0, 3000.0, "1500"),
            (2e-4, 1e-3, "0.0002"),
            (20.0, 0.5, "20"),
            (2e-8, 1e-7, "2e-8"),
            (0.0, 1e-7, "0"),
        ];
        for (value, range, expected) in cases.into_iter().chain(more) {
            assert_eq!(label(value, range), expected, "{value} on {range}");
        }
    }
}
