//! The terminals of FMI 3.0, and the errors for invalid ones.

use crate::models::{chain::Chain, room::Room};
use crate::{is_expected, model};
use fmu_package::{ContentFile, Terminal, terminals};

fn icon(name: &str) -> ContentFile {
    ContentFile { name: format!("terminalsAndIcons/{name}"), path: name.into() }
}

#[test]
fn terminals_are_written() {
    let door = Terminal::plug("door")
        .kind("org.example.Door")
        .description("Where people <enter>")
        .signal("warmth", "outside")
        .inflow("people", "alarms");
    let content = [icon("door.png")];
    let all = [
        door.icon("door", [-110.0, -10.0, -90.0, 10.5]),
        Terminal::bus("bus").outflow("a", "outside"),
        Terminal::sequence("row").member("power", "power", "org.example.power"),
    ];
    is_expected("terminals.xml", &terminals(&model::<Room>(), &all, &content).unwrap().unwrap());
    assert_eq!(terminals(&model::<Room>(), &[], &content).unwrap(), None);
}

#[test]
fn invalid_terminals_are_rejected() {
    let door = || Terminal::plug("door");
    for (all, message) in [
        (vec![door(), door()], "there are two terminals with the name door"),
        (
            vec![Terminal::plug("")],
            "the terminal '' is empty or has a line break or another control character",
        ),
        (
            vec![door().description("a\nb")],
            "the terminal door: 'a\\nb' has a line break or another control character",
        ),
        (
            vec![door().signal("", "power")],
            "the terminal door: the member '' is empty or has a line break or another control character",
        ),
        (
            vec![door().signal("a", "power").signal("a", "outside")],
            "the terminal door: it has two members with the name a",
        ),
        (vec![door().signal("a", "b")], "the terminal door: its member a is b, which is not a variable"),
        (
            vec![door().signal("a", "der(temperature)")],
            "the terminal door: its member a is der(temperature), which is not an input, output or parameter",
        ),
        (
            vec![door().icon("door", [0.0; 4])],
            "the terminal door: its icon terminalsAndIcons/door.png is missing",
        ),
        (
            vec![door().icon("door", [f64::NAN; 4])],
            "the terminal door: the corners of its icon are not finite",
        ),
    ] {
        let error = terminals(&model::<Room>(), &all, &[icon("door.svg")]).unwrap_err();
        assert_eq!(format!("{error:#}"), message);
    }
    let error = terminals(&model::<Chain>(), &[Terminal::plug("end").signal("a", "x[1]")], &[]).unwrap_err();
    assert_eq!(
        format!("{error:#}"),
        "the terminal end: its member a is x[1], an element of an array, which terminals cannot have"
    );
}
