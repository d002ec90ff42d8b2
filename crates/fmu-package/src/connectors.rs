//! Terminals: groups of variables that are connected together (section 2.4.9 of FMI 3.0; section 2.3 of FMI 2.0.4 allows them).

use crate::check::{check_line, check_name};
use crate::content::ContentFile;
use crate::model::LoadedModel;
use anyhow::{Context, Result, ensure};
use fmi_abi::Causality;
use fmi_abi::write::{Element, filled};
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
    /// A terminal whose members are connected by name to another terminal, which must have the same members.
    pub fn plug(name: &'static str) -> Self {
        Self::new(name, "plug")
    }

    /// A terminal whose members are connected by name to the members of another terminal, as far as both have them.
    pub fn bus(name: &'static str) -> Self {
        Self::new(name, "bus")
    }

    /// A terminal whose members are connected in order to the members of another terminal.
    pub fn sequence(name: &'static str) -> Self {
        Self::new(name, "sequence")
    }

    fn new(name: &'static str, rule: &'static str) -> Self {
        Self { name, rule, kind: "", description: "", members: Vec::new(), icon: None }
    }

    /// Sets the kind. Anyone may define one; its name is a reversed domain name, such as `org.example.Shaft`.
    #[must_use]
    pub fn kind(self, kind: &'static str) -> Self {
        Self { kind, ..self }
    }

    /// Sets the description, a sentence for the user.
    #[must_use]
    pub fn description(self, description: &'static str) -> Self {
        Self { description, ..self }
    }

    /// Adds a variable as a member. Connected members are equal.
    #[must_use]
    pub fn signal(self, member: &'static str, variable: &'static str) -> Self {
        self.member(member, variable, "signal")
    }

    /// Adds a variable as a member that flows into the FMU. Connected flows add up to zero.
    #[must_use]
    pub fn inflow(self, member: &'static str, variable: &'static str) -> Self {
        self.member(member, variable, "inflow")
    }

    /// Adds a variable as a member that flows out of the FMU.
    #[must_use]
    pub fn outflow(self, member: &'static str, variable: &'static str) -> Self {
        self.member(member, variable, "outflow")
    }

    /// Adds a variable as a member of any kind, for example of a kind that a third party has defined.
    #[must_use]
    pub fn member(mut self, member: &'static str, variable: &'static str, kind: &'static str) -> Self {
        self.members.push(Member { name: member, variable, kind });
        self
    }

    /// Sets the icon: the image `terminalsAndIcons/NAME.png` in the FMU, and `NAME.svg` if it exists. The corners x1, y1, x2, y2 are
    /// coordinates in the icon of the FMU, which extends from -100 to 100 in both directions.
    #[must_use]
    pub fn icon(self, name: &'static str, corners: [f64; 4]) -> Self {
        Self { icon: Some((name, corners)), ..self }
    }

    fn check(&self, model: &LoadedModel, content: &[ContentFile]) -> Result<()> {
        for text in [self.kind, self.description] {
            check_line(format_args!("'{}'", text.escape_debug()), text)?;
        }
        let mut names = HashSet::new();
        for Member { name, variable, kind } in &self.members {
            check_name("the member", name)?;
            check_name("the kind of a member", kind)?;
            ensure!(names.insert(name), "it has two members with the name {name}");
            let found = model.table.variables.iter().find(|known| known.name == *variable);
            let found =
                found.with_context(|| format!("its member {name} is {variable}, which is not a variable"))?;
            ensure!(
                found.shape.is_empty(),
                "its member {name} is {variable}, an element of an array, which terminals cannot have"
            );
            use Causality::*;
            ensure!(
                !["signal", "inflow", "outflow"].contains(kind)
                    || matches!(found.causality, Input | Output | Parameter | CalculatedParameter),
                "its member {name} is {variable}, which is not an input, output or parameter"
            );
        }
        if let Some((icon, corners)) = self.icon {
            ensure!(
                corners.iter().all(|number| number.is_finite()),
                "the corners of its icon are not finite"
            );
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

/// Returns `terminalsAndIcons.xml` of a model with these terminals, in an FMU with these files; `None` if there are no terminals.
///
/// # Errors
/// When two terminals, or two members of one, share a name, a member is not a variable that can be connected, an icon is missing, or a
/// text is not a single line.
pub fn terminals(
    model: &LoadedModel,
    terminals: &[Terminal],
    content: &[ContentFile],
) -> Result<Option<String>> {
    let mut names = HashSet::new();
    for terminal in terminals {
        let name = terminal.name;
        check_name("the terminal", name)?;
        ensure!(names.insert(name), "there are two terminals with the name {name}");
        terminal.check(model, content).with_context(|| format!("the terminal {name}"))?;
    }
    let Some(list) = Element::list("Terminals", terminals.iter().map(Terminal::element)) else {
        return Ok(None);
    };
    // FMI 3.0 defines this file, so an FMU for FMI 2.0 would have this version as well (section 2.4.9 of FMI 3.0).
    let root = Element::new("fmiTerminalsAndIcons").with("fmiVersion", "3.0");
    Ok(Some(root.containing([list]).document()?))
}
