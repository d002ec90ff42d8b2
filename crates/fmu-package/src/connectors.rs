//! Terminals: variables that belong together where an FMU is connected (section 2.4.9 of FMI 3.0; FMI 2.0 may have the same
//! since 2.0.4, section 2.3).

use crate::content::ContentFile;
use crate::definitions::{filled, list};
use crate::model::LoadedModel;
use crate::xml::Element;
use anyhow::{Context, Result, ensure};
use fmi_abi::Causality;
use std::collections::HashSet;

/// A terminal of an FMU for FMI 3.0: a connector with variables as its members.
///
/// ```
/// use fmu_package::Terminal;
///
/// let shaft = Terminal::plug("shaft")
///     .description("The motor's shaft")
///     .kind("org.example.RotationalShaft")
///     .signal("angle", "theta")
///     .signal("torque", "tau")
///     .icon("shaft", [-110.0, -10.0, -90.0, 10.0]);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Terminal {
    name: &'static str,
    rule: &'static str,
    kind: &'static str,
    description: &'static str,
    members: Vec<Member>,
    icon: Option<(&'static str, [f64; 4])>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Member {
    name: &'static str,
    variable: &'static str,
    kind: &'static str,
}

impl Terminal {
    /// A terminal that is connected to one with the same members, by their names.
    pub fn plug(name: &'static str) -> Self {
        Self::new(name, "plug")
    }

    /// A terminal that may be connected to one with some of its members, by their names.
    pub fn bus(name: &'static str) -> Self {
        Self::new(name, "bus")
    }

    /// A terminal that is connected to one with as many members, by their order.
    pub fn sequence(name: &'static str) -> Self {
        Self::new(name, "sequence")
    }

    fn new(name: &'static str, rule: &'static str) -> Self {
        Self { name, rule, kind: "", description: "", members: Vec::new(), icon: None }
    }

    /// With a kind, which others may have defined: a reversed domain name, as `org.example.Shaft`.
    #[must_use]
    pub fn kind(self, kind: &'static str) -> Self {
        Self { kind, ..self }
    }

    /// With one sentence for the user.
    #[must_use]
    pub fn description(self, description: &'static str) -> Self {
        Self { description, ..self }
    }

    /// With a variable as member: connected ones are equal.
    #[must_use]
    pub fn signal(self, member: &'static str, variable: &'static str) -> Self {
        self.member(member, variable, "signal")
    }

    /// With a variable as member that flows into the FMU: connected flows add up to nothing.
    #[must_use]
    pub fn inflow(self, member: &'static str, variable: &'static str) -> Self {
        self.member(member, variable, "inflow")
    }

    /// With a variable as member that flows out of the FMU.
    #[must_use]
    pub fn outflow(self, member: &'static str, variable: &'static str) -> Self {
        self.member(member, variable, "outflow")
    }

    /// With a variable as member, of a kind that others have defined.
    #[must_use]
    pub fn member(mut self, member: &'static str, variable: &'static str, kind: &'static str) -> Self {
        self.members.push(Member { name: member, variable, kind });
        self
    }

    /// With a picture: `terminalsAndIcons/NAME.png` of what goes into the FMU, and `NAME.svg` if that is there; and
    /// where it is, as x1, y1, x2, y2 of the FMU's own icon, which reaches from -100 to 100.
    #[must_use]
    pub fn icon(self, name: &'static str, place: [f64; 4]) -> Self {
        Self { icon: Some((name, place)), ..self }
    }

    fn check(&self, model: &LoadedModel, content: &[ContentFile]) -> Result<()> {
        for text in [self.kind, self.description] {
            ensure!(!text.contains(char::is_control), "'{}' is more than one line", text.escape_debug());
        }
        let mut names = HashSet::new();
        for Member { name, variable, kind } in &self.members {
            for text in [name, kind] {
                ensure!(is_name(text), "'{}' is empty or more than one line", text.escape_debug());
            }
            ensure!(names.insert(name), "it has two members with the name {name}");
            let of = model.table.variables.iter().find(|of| of.name == *variable);
            let of = of.with_context(|| format!("its member {name} is {variable}, which is no variable"))?;
            ensure!(
                of.dimensions.is_empty(),
                "its member {name} is {variable}, an element of an array, which terminals cannot have"
            );
            use Causality::*;
            ensure!(
                !["signal", "inflow", "outflow"].contains(kind)
                    || matches!(of.causality, Input | Output | Parameter | CalculatedParameter),
                "its member {name} is {variable}, which is no input, output or parameter"
            );
        }
        if let Some((icon, place)) = self.icon {
            ensure!(place.iter().all(|number| number.is_finite()), "its icon has no place");
            let file = format!("terminalsAndIcons/{icon}.png");
            ensure!(content.iter().any(|known| known.name == file), "its icon {file} is missing");
        }
        Ok(())
    }

    fn element(&self) -> Element {
        let member = |member: &Member| {
            Element::new("TerminalMemberVariable")
                .with("variableName", member.variable)
                .with("memberName", member.name)
                .with("variableKind", member.kind)
        };
        let icon = self.icon.map(|(name, [x1, y1, x2, y2])| {
            Element::new("TerminalGraphicalRepresentation")
                .with("x1", x1)
                .with("y1", y1)
                .with("x2", x2)
                .with("y2", y2)
                .with("iconBaseName", name)
        });
        Element::new("Terminal")
            .with("name", self.name)
            .with("matchingRule", self.rule)
            .with_some("terminalKind", filled(self.kind))
            .with_some("description", filled(self.description))
            .containing(self.members.iter().map(member))
            .containing(icon)
    }
}

fn is_name(text: &str) -> bool {
    !text.is_empty() && !text.contains(char::is_control)
}

/// The text of `terminalsAndIcons.xml` for a model with these terminals, in an FMU with these files; `None` if there are
/// no terminals.
///
/// # Errors
/// When two terminals, or two members of one, share a name, a member is no variable that can be connected, or an icon is
/// missing.
pub fn terminals(
    model: &LoadedModel,
    terminals: &[Terminal],
    content: &[ContentFile],
) -> Result<Option<String>> {
    let mut names = HashSet::new();
    for terminal in terminals {
        let name = terminal.name;
        ensure!(is_name(name), "the terminal '{}' is empty or more than one line", name.escape_debug());
        ensure!(names.insert(name), "there are two terminals with the name {name}");
        terminal.check(model, content).with_context(|| format!("the terminal {name}"))?;
    }
    let Some(list) = list("Terminals", terminals.iter().map(Terminal::element)) else { return Ok(None) };
    // In an FMU for FMI 2.0, too: there it is the version that defines this file (section 2.4.9 of FMI 3.0).
    let root = Element::new("fmiTerminalsAndIcons").with("fmiVersion", "3.0");
    root.containing([list]).document().map(Some)
}
