//! Draws the results of a simulation: an SVG with a panel for each unit.

use anyhow::{Result, anyhow};
use plotters::prelude::*;
use std::fs;
use std::path::Path;

/// A variable over time.
pub struct Trajectory<'a> {
    pub name: &'a str,
    pub unit: &'a str,
    /// Whether the variable is constant between jumps.
    pub jumps: bool,
    /// Whether the values 0 and 1 mean false and true.
    pub is_boolean: bool,
    pub values: &'a [f64],
}

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

/// Draws the trajectories. Trajectories of one unit share a panel.
pub fn plot(path: &Path, title: &str, time: &[f64], trajectories: &[Trajectory]) -> Result<()> {
    let mut svg = String::new();
    draw(&mut svg, title, time, trajectories).map_err(|error| anyhow!("{error}"))?;
    // The backend has integer coordinates: it draws a large image, which the SVG then scales down.
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
    trajectories: &[Trajectory],
) -> Result<(), Box<dyn std::error::Error>> {
    let mut panels: Vec<(&str, Vec<&Trajectory>)> = Vec::new();
    for trajectory in trajectories {
        match panels.iter_mut().find(|(unit, panel)| *unit == trajectory.unit && panel.len() < COLOURS.len())
        {
            Some((_, panel)) => panel.push(trajectory),
            None => panels.push((trajectory.unit, vec![trajectory])),
        }
    }
    let height = 70 + 260 * panels.len() as u32;
    let root = SVGBackend::with_string(svg, (840 * FINE, height * FINE)).into_drawing_area();
    root.fill(&WHITE)?;
    let root = root.margin(10 * FINE, 0, 0, 0).titled(title, ("sans-serif", 22 * FINE))?;
    for (area, (unit, panel)) in root.split_evenly((panels.len(), 1)).iter().zip(&panels) {
        let values = || {
            panel.iter().flat_map(|trajectory| trajectory.values).copied().filter(|value| value.is_finite())
        };
        let (low, high) =
            (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
        let (low, high) = if low <= high { (low, high) } else { (0.0, 1.0) };
        let margin = if high > low { 0.05 * (high - low) } else { 0.5 * high.abs().max(1.0) };
        let mut chart = ChartBuilder::on(area)
            .margin(12 * FINE)
            .x_label_area_size(40 * FINE)
            .y_label_area_size(76 * FINE)
            .build_cartesian_2d(time[0]..time[time.len() - 1], low - margin..high + margin)?;
        let [label, label_of_time] = [high - low + 2.0 * margin, time[time.len() - 1] - time[0]]
            .map(|range| move |value: &f64| label(*value, range));
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(BLACK.mix(0.12).stroke_width(FINE))
            .axis_style(BLACK.stroke_width(FINE))
            .set_all_tick_mark_size(5 * FINE)
            .x_desc("time in s")
            .y_desc(if unit.is_empty() || *unit == "1" { String::new() } else { format!("in {unit}") })
            .x_label_formatter(&label_of_time)
            .y_label_formatter(&label)
            .label_style(("sans-serif", 14 * FINE))
            .axis_desc_style(("sans-serif", 14 * FINE))
            .draw()?;
        for (trajectory, colour) in panel.iter().zip(COLOURS) {
            let mut points: Vec<(f64, f64)> = Vec::with_capacity(2 * time.len());
            for (time, value) in time.iter().zip(trajectory.values).filter(|point| point.1.is_finite()) {
                let last = points.last().filter(|_| trajectory.jumps).map(|last| (*time, last.1));
                points.extend(last.into_iter().chain([(*time, *value)]));
            }
            chart
                .draw_series(LineSeries::new(points, colour.stroke_width(2 * FINE)))?
                .label(trajectory.name)
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
            .position(SeriesLabelPosition::UpperRight)
            .label_font(("sans-serif", 14 * FINE))
            .draw()?;
    }
    root.present()?;
    Ok(())
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
    use super::label;

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
