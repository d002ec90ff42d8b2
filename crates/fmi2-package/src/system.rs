//! FMUs wired to a system: as SSP (System Structure and Parameterization 1.0) and for libcosim
//! (`OspSystemStructure.xml`). The same FMUs and wiring give the same bytes.

use crate::pack::{write_atomically, zip};
use crate::variant::Start;
use crate::xml::{self, Element};
use anyhow::{Context, Result, bail, ensure};
use std::collections::{BTreeMap, HashSet};
use std::fs::{self, File};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};

/// FMUs that are wired to each other. Variables of FMUs are written `component.variable`.
#[derive(Clone, Debug)]
pub struct System<'a> {
    /// The name, for people.
    pub name: &'a str,
    /// One sentence.
    pub description: &'a str,
    /// The FMUs: the name of the component, the file.
    pub components: Vec<(&'a str, PathBuf)>,
    /// Inputs of the system: name, the input it feeds, start value in that input's unit.
    pub inputs: Vec<(&'a str, &'a str, f64)>,
    /// Outputs of the system: name, the output it shows.
    pub outputs: Vec<(&'a str, &'a str)>,
    /// Output to input.
    pub connections: Vec<(&'a str, &'a str)>,
    /// Start values that differ from those of the FMUs.
    pub start: Vec<(&'a str, Start)>,
    /// The proposed end of the experiment, s; it starts at 0.
    pub stop_time: f64,
    /// The proposed communication step size, s.
    pub step_size: f64,
}

/// What a system needs to know of an FMU's variable.
struct Variable {
    causality: String,
    kind: String,
    unit: Option<String>,
}

/// A system whose FMUs have been read and whose wiring has been checked.
pub struct CheckedSystem<'a> {
    system: &'a System<'a>,
    fmus: Vec<Vec<u8>>,
    variables: BTreeMap<String, Variable>,
    units: BTreeMap<String, Element>,
}

impl<'a> System<'a> {
    /// Reads the FMUs and checks the wiring against what they say of themselves.
    ///
    /// # Errors
    /// When an FMU cannot be read, two components share a name or two different FMUs a file name, a variable is
    /// not there or has the wrong causality, two ends of a connection differ in type or unit, an input is fed
    /// twice, or a start value or time is no finite number.
    pub fn check(&'a self) -> Result<CheckedSystem<'a>> {
        let mut checked = CheckedSystem {
            system: self,
            fmus: Vec::new(),
            variables: BTreeMap::new(),
            units: BTreeMap::new(),
        };
        for (what, value) in [("stop time", self.stop_time), ("step size", self.step_size)] {
            ensure!(value.is_finite() && value > 0.0, "the {what} must be > 0, it is {value}");
        }
        for (place, (component, path)) in self.components.iter().enumerate() {
            ensure!(
                !component.is_empty() && !component.contains(['.', '/', '\\']),
                "'{component}' cannot name a component, because it is empty or has a dot or slash in it"
            );
            let before = &self.components[..place];
            ensure!(
                before.iter().all(|(other, _)| other != component),
                "two components are named {component}"
            );
            checked.read(component, path).with_context(|| format!("{} is no usable FMU", path.display()))?;
        }
        checked.check_files()?;
        let mut fed = Vec::new();
        for (_, to, start) in &self.inputs {
            checked.find(to, &["input"])?;
            check_finite(to, *start)?;
            fed.push(*to);
        }
        for (_, from) in &self.outputs {
            checked.find(from, &["output"])?;
        }
        for (from, to) in &self.connections {
            let (a, b) = (checked.find(from, &["output"])?, checked.find(to, &["input"])?);
            ensure!(a.kind == b.kind, "{from} is {}, {to} is {}", a.kind, b.kind);
            if let (Some(one), Some(other)) = (&a.unit, &b.unit) {
                ensure!(one == other, "{from} is in {one}, {to} in {other}");
            }
            fed.push(*to);
        }
        fed.sort_unstable();
        if let Some(pair) = fed.windows(2).find(|pair| pair[0] == pair[1]) {
            bail!("{} is fed twice", pair[0]);
        }
        for (name, start) in &self.start {
            let variable = checked.find(name, &["parameter", "input"])?;
            let kind = match start {
                Start::Real(value) => {
                    check_finite(name, *value)?;
                    "Real"
                }
                Start::Integer(_) => "Integer",
                Start::Boolean(_) => "Boolean",
            };
            ensure!(variable.kind == kind, "{name} is {}, its start value is {kind}", variable.kind);
        }
        Ok(checked)
    }
}

impl CheckedSystem<'_> {
    fn read(&mut self, component: &str, path: &Path) -> Result<()> {
        let bytes = fs::read(path).context("it cannot be read")?;
        let mut archive = zip::ZipArchive::new(std::io::Cursor::new(&bytes))?;
        let mut text = String::new();
        archive.by_name("modelDescription.xml")?.read_to_string(&mut text)?;
        let description = xml::parse(&text).context("its modelDescription.xml cannot be read")?;
        for unit in description.children_of("UnitDefinitions") {
            let name = unit.attribute("name").unwrap_or_default();
            let base = unit.children.iter().find(|child| child.name == "BaseUnit");
            let base = base.map(|base| base.attributes.clone()).unwrap_or_default();
            let known = element("ssc:Unit", [("name", name)], [Element::new("ssc:BaseUnit", base, vec![])]);
            let before = self.units.entry(name.to_owned()).or_insert_with(|| known.clone());
            ensure!(*before == known, "its unit {name} differs from that of another FMU");
        }
        for variable in description.children_of("ModelVariables") {
            let (Some(name), Some(kind)) = (variable.attribute("name"), variable.children.first()) else {
                continue;
            };
            let declared = kind.attribute("declaredType");
            let unit_of_type = || {
                let mut types = description.children_of("TypeDefinitions");
                types.find(|of| of.attribute("name") == declared)?.children.first()?.attribute("unit")
            };
            let unit = kind.attribute("unit").or_else(unit_of_type);
            self.variables.insert(
                format!("{component}.{name}"),
                Variable {
                    causality: variable.attribute("causality").unwrap_or("local").to_owned(),
                    kind: kind.name.clone(),
                    unit: unit.map(str::to_owned),
                },
            );
        }
        self.fmus.push(bytes);
        Ok(())
    }

    /// Several components may be instances of one FMU; it is packed once.
    fn check_files(&self) -> Result<()> {
        let mut files = BTreeMap::new();
        for ((_, path), bytes) in self.system.components.iter().zip(&self.fmus) {
            let (first, content) = files.entry(file_name(path)?).or_insert((path, bytes));
            ensure!(
                *content == bytes,
                "{} and {} are different and have the same file name; rename one of them",
                first.display(),
                path.display()
            );
        }
        Ok(())
    }

    /// The FMUs, each once: file name and content.
    fn files(&self) -> Result<BTreeMap<&str, &[u8]>> {
        let fmus = self.system.components.iter().zip(&self.fmus);
        fmus.map(|((_, path), bytes)| Ok((file_name(path)?, bytes.as_slice()))).collect()
    }

    fn find(&self, name: &str, causalities: &[&str]) -> Result<&Variable> {
        let variable = self.variables.get(name).with_context(|| format!("no FMU has a variable {name}"))?;
        ensure!(
            causalities.contains(&variable.causality.as_str()),
            "{name} is {}, not {}",
            variable.causality,
            causalities.join(" or ")
        );
        Ok(variable)
    }

    /// Writes the SSP and tells its size in bytes.
    ///
    /// The FMUs are in `resources`, with a file of start values beside each that needs one; the start values
    /// of the system's inputs are in `resources/experiment.ssv`. All sets of start values are named `default`.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write_ssp(&self, destination: &Path) -> Result<u64> {
        let mut entries = vec![("SystemStructure.ssd".to_owned(), self.ssd()?.into_bytes())];
        for (name, bytes) in self.files()? {
            entries.push((format!("resources/{name}"), bytes.to_vec()));
        }
        for (component, _) in &self.system.components {
            let own = self.own_start(component);
            if !own.is_empty() {
                entries.push((format!("resources/{component}.ssv"), self.ssv(&own)?.into_bytes()));
            }
        }
        if !self.system.inputs.is_empty() {
            let inputs = self.system.inputs.iter();
            let inputs: Vec<_> = inputs.map(|(name, to, start)| (*name, *to, Start::Real(*start))).collect();
            entries.push(("resources/experiment.ssv".to_owned(), self.ssv(&inputs)?.into_bytes()));
        }
        entries[1..].sort();
        for pair in entries.windows(2) {
            ensure!(pair[0].0 != pair[1].0, "{} is there twice", pair[0].0);
        }
        let bytes = zip(&entries).context("cannot make the zip file")?;
        write_atomically(destination, |file: &mut File| Ok(file.write_all(&bytes)?))
    }

    /// Writes the folder that libcosim takes: `OspSystemStructure.xml` and the FMUs.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub fn write_osp(&self, folder: &Path) -> Result<()> {
        for (name, bytes) in self.files()? {
            write_atomically(&folder.join(name), |file| Ok(file.write_all(bytes)?))?;
        }
        let text = self.osp()?;
        write_atomically(
            &folder.join("OspSystemStructure.xml"),
            |file| Ok(file.write_all(text.as_bytes())?),
        )?;
        Ok(())
    }

    /// The start values of a component's own variables: name, full name, value.
    fn own_start(&self, component: &str) -> Vec<(&str, &str, Start)> {
        let start = self.system.start.iter().map(|(name, start)| (split(name), *name, *start));
        start
            .filter(|((of, _), ..)| *of == component)
            .map(|((_, own), name, start)| (own, name, start))
            .collect()
    }

    fn ssd(&self) -> Result<String> {
        let System { name, description, components, inputs, outputs, connections, .. } = self.system;
        let mut elements = Vec::new();
        for (component, path) in components {
            let own = |end: &str| split(end).0 == *component;
            // Only what is connected: masters trip over the rest.
            let mut connectors = Vec::new();
            let to = inputs.iter().map(|(_, to, _)| *to).chain(connections.iter().map(|(_, to)| *to));
            for to in to.filter(|to| own(to)) {
                connectors.push(self.connector(split(to).1, to, "input"));
            }
            let from = outputs.iter().map(|(_, from)| *from).chain(connections.iter().map(|(from, _)| *from));
            let mut listed = HashSet::new();
            for from in from.filter(|from| own(from) && listed.insert(*from)) {
                connectors.push(self.connector(split(from).1, from, "output"));
            }
            let mut children = vec![element("ssd:Connectors", [], connectors)];
            if !self.own_start(component).is_empty() {
                children.push(binding(&format!("resources/{component}.ssv")));
            }
            let source = format!("resources/{}", file_name(path)?);
            let attributes =
                [("name", *component), ("type", "application/x-fmu-sharedlibrary"), ("source", &source)];
            elements.push(element("ssd:Component", attributes, children));
        }
        let connect = |[from, to]: [(&str, &str); 2]| {
            let mut attributes = Vec::new();
            for (side, (component, name)) in [("start", from), ("end", to)] {
                if !component.is_empty() {
                    attributes.push((format!("{side}Element"), component.to_owned()));
                }
                attributes.push((format!("{side}Connector"), name.to_owned()));
            }
            Element::new("ssd:Connection", attributes, vec![])
        };
        let from_inputs = inputs.iter().map(|(name, to, _)| connect([("", *name), split(to)]));
        let inside = connections.iter().map(|(from, to)| connect([split(from), split(to)]));
        let to_outputs = outputs.iter().map(|(name, from)| connect([split(from), ("", *name)]));
        let wires: Vec<Element> = from_inputs.chain(inside).chain(to_outputs).collect();

        let mut connectors: Vec<Element> =
            inputs.iter().map(|(name, to, _)| self.connector(name, to, "input")).collect();
        connectors.extend(outputs.iter().map(|(name, from)| self.connector(name, from, "output")));
        let mut children = vec![element("ssd:Connectors", [], connectors)];
        if !inputs.is_empty() {
            children.push(binding("resources/experiment.ssv"));
        }
        children.push(element("ssd:Elements", [], elements));
        children.push(element("ssd:Connections", [], wires));
        let system = element("ssd:System", [("name", *name), ("description", *description)], children);
        let ends = connections.iter().map(|(_, to)| *to).chain(inputs.iter().map(|(_, to, _)| *to));
        let ends = ends.chain(outputs.iter().map(|(_, from)| *from));
        let used: HashSet<_> = ends.map(|end| self.variables[end].unit.as_deref()).collect();
        let in_use = |unit: &&Element| used.contains(&unit.attribute("name"));
        let stop_time = self.system.stop_time.to_string();
        let root = element(
            "ssd:SystemStructureDescription",
            [
                ("xmlns:ssd", "http://ssp-standard.org/SSP1/SystemStructureDescription"),
                ("xmlns:ssc", "http://ssp-standard.org/SSP1/SystemStructureCommon"),
                ("version", "1.0"),
                ("name", *name),
                ("generationTool", concat!("fmi2-package ", env!("CARGO_PKG_VERSION"))),
            ],
            [
                system,
                element("ssd:Units", [], self.units.values().filter(in_use).cloned()),
                element("ssd:DefaultExperiment", [("startTime", "0"), ("stopTime", &stop_time)], []),
            ],
        );
        xml::document(&root)
    }

    /// A connector with the type and unit of a variable.
    fn connector(&self, name: &str, of: &str, kind: &str) -> Element {
        let Variable { kind: base_type, unit, .. } = &self.variables[of];
        let unit = unit.iter().map(|unit| ("unit", unit.as_str()));
        let base_type = element(&format!("ssc:{base_type}"), unit, []);
        element("ssd:Connector", [("name", name), ("kind", kind)], [base_type])
    }

    fn ssv(&self, start: &[(&str, &str, Start)]) -> Result<String> {
        let mut units = BTreeMap::new();
        let mut parameters = Vec::new();
        for (name, variable, start) in start {
            let (base_type, value) = written(*start);
            let mut attributes = vec![("value".to_owned(), value)];
            if let (Start::Real(_), Some(unit)) = (start, &self.variables[*variable].unit) {
                attributes.push(("unit".to_owned(), unit.clone()));
                units.extend(self.units.get(unit).map(|known| (unit, known.clone())));
            }
            let value = Element::new(&format!("ssv:{base_type}"), attributes, vec![]);
            parameters.push(element("ssv:Parameter", [("name", *name)], [value]));
        }
        let mut children = vec![element("ssv:Parameters", [], parameters)];
        if !units.is_empty() {
            children.push(element("ssv:Units", [], units.into_values()));
        }
        let root = element(
            "ssv:ParameterSet",
            [
                ("xmlns:ssv", "http://ssp-standard.org/SSP1/SystemStructureParameterValues"),
                ("xmlns:ssc", "http://ssp-standard.org/SSP1/SystemStructureCommon"),
                ("version", "1.0"),
                ("name", "default"),
            ],
            children,
        );
        xml::document(&root)
    }

    fn osp(&self) -> Result<String> {
        let mut simulators = Vec::new();
        for (component, path) in &self.system.components {
            let inputs = self.system.inputs.iter().map(|(_, to, start)| (split(to), Start::Real(*start)));
            let inputs =
                inputs.filter(|((of, _), _)| of == component).map(|((_, name), start)| (name, start));
            let own = self.own_start(component).into_iter().map(|(name, _, start)| (name, start));
            let mut initial = Vec::new();
            for (name, start) in own.chain(inputs) {
                let (base_type, value) = written(start);
                let value = element(base_type, [("value", value.as_str())], []);
                initial.push(element("InitialValue", [("variable", name)], [value]));
            }
            let initial = (!initial.is_empty()).then(|| element("InitialValues", [], initial));
            let attributes = [("name", *component), ("source", file_name(path)?)];
            simulators.push(element("Simulator", attributes, initial));
        }
        let variable = |end: &str| {
            let (simulator, name) = split(end);
            element("Variable", [("simulator", simulator), ("name", name)], [])
        };
        let connections = self.system.connections.iter();
        let connections: Vec<Element> = connections
            .map(|(from, to)| element("VariableConnection", [], [variable(from), variable(to)]))
            .collect();
        let text = |name: &str, text: String| Element { text, ..element(name, [], []) };
        let root = element(
            "OspSystemStructure",
            [("xmlns", "http://opensimulationplatform.com/MSMI/OSPSystemStructure"), ("version", "0.1")],
            [
                text("StartTime", "0.0".to_owned()),
                text("EndTime", self.system.stop_time.to_string()),
                text("BaseStepSize", self.system.step_size.to_string()),
                text("Algorithm", "fixedStep".to_owned()),
                element("Simulators", [], simulators),
                element("Connections", [], connections),
            ],
        );
        xml::document(&root)
    }
}

fn check_finite(name: &str, start: f64) -> Result<()> {
    ensure!(start.is_finite(), "the start value of {name} must be a finite number, it is {start}");
    Ok(())
}

/// Component and variable.
fn split(end: &str) -> (&str, &str) {
    end.split_once('.').unwrap_or(("", end))
}

fn file_name(path: &Path) -> Result<&str> {
    let name = path.file_name().and_then(|name| name.to_str());
    name.with_context(|| format!("the file name of {} is not UTF-8", path.display()))
}

fn written(start: Start) -> (&'static str, String) {
    match start {
        Start::Real(value) => ("Real", value.to_string()),
        Start::Integer(value) => ("Integer", value.to_string()),
        Start::Boolean(value) => ("Boolean", value.to_string()),
    }
}

fn binding(source: &str) -> Element {
    let binding = element("ssd:ParameterBinding", [("source", source)], []);
    element("ssd:ParameterBindings", [], [binding])
}

fn element<'a>(
    name: &str,
    attributes: impl IntoIterator<Item = (&'a str, &'a str)>,
    children: impl IntoIterator<Item = Element>,
) -> Element {
    let attributes = attributes.into_iter().map(|(name, value)| (name.to_owned(), value.to_owned()));
    Element::new(name, attributes.collect(), children.into_iter().collect())
}
