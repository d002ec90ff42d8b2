//! Writes systems as SSP files.

use super::FMU;
use crate::error::{Error, request};
use crate::files::STRUCTURE;
use crate::lookup::Found;
use crate::system::structure::{CheckedStructure, SystemStructure, document, file_name, split};
use fmi_abi::BaseUnit;
use fmi_abi::description::Item;
use fmi_abi::write::{Element, write_atomically, zip};
use std::collections::{BTreeMap, HashSet};
use std::io::Write;
use std::path::Path;

const COMMON: &str = "http://ssp-standard.org/SSP1/SystemStructureCommon";

impl CheckedStructure<'_> {
    /// Writes the SSP file and returns its size in bytes.
    ///
    /// The directory `resources` contains the FMUs, and a file with start values for each component that has
    /// any. The file `resources/experiment.ssv` contains the start values of the system's inputs. In each of
    /// these files, the parameter set is named `default`.
    ///
    /// # Errors
    /// Returns [`Error::Fmu`] if the file cannot be written, and [`Error::Request`] if two FMUs have different enumerations with the
    /// same name.
    pub fn write_ssp(&self, destination: &Path) -> Result<u64, Error> {
        let mut entries = vec![(STRUCTURE.to_owned(), document(&self.ssd()?)?)];
        for (name, bytes) in self.files()? {
            entries.push((format!("resources/{name}"), bytes.to_vec()));
        }
        for (component, _) in &self.structure.components {
            let own = self.own_start(component).into_iter().map(|(name, start)| (split(name).1, name, start));
            entries.extend(self.ssv(component, own)?);
        }
        let inputs = self.structure.inputs.iter().map(|(name, to, start)| (*name, *to, start.as_str()));
        entries.extend(self.ssv("experiment", inputs)?);
        entries[1..].sort();
        let bytes = zip(&entries).map_err(Error::Fmu)?;
        write_atomically(destination, |file| file.write_all(&bytes)).map_err(Error::Fmu)
    }

    fn ssd(&self) -> Result<Element, Error> {
        let SystemStructure { name, description, components, inputs, outputs, connections, .. } =
            self.structure;
        let mut elements = Vec::new();
        for (component, path) in components {
            let own = |end: &str| split(end).0 == *component;
            // Writes only connectors that are connected, because some importers fail on others.
            let mut connectors = Vec::new();
            let to = inputs.iter().map(|(_, to, _)| *to).chain(connections.iter().map(|(_, to)| *to));
            for to in to.filter(|to| own(to)) {
                connectors.push(self.connector(split(to).1, to, "input")?);
            }
            let from = outputs.iter().map(|(_, from)| *from).chain(connections.iter().map(|(from, _)| *from));
            let mut listed = HashSet::new();
            for from in from.filter(|from| own(from) && listed.insert(*from)) {
                connectors.push(self.connector(split(from).1, from, "output")?);
            }
            let start = !self.own_start(component).is_empty();
            let element = Element::new("ssd:Component")
                .with("name", component)
                .with("type", FMU)
                .with("source", format!("resources/{}", file_name(path)?))
                .containing(Element::list("ssd:Connectors", connectors))
                .containing(start.then(|| binding(component)));
            elements.push(element);
        }
        let from_inputs = inputs.iter().map(|(name, to, _)| connection(("", *name), split(to)));
        let inside = connections.iter().map(|(from, to)| connection(split(from), split(to)));
        let to_outputs = outputs.iter().map(|(name, from)| connection(split(from), ("", *name)));

        let own_inputs = inputs.iter().map(|(name, to, _)| self.connector(name, to, "input"));
        let own_outputs = outputs.iter().map(|(name, from)| self.connector(name, from, "output"));
        let connectors: Vec<Element> = own_inputs.chain(own_outputs).collect::<Result<_, Error>>()?;
        let system = Element::new("ssd:System")
            .with("name", name)
            .with("description", description)
            .containing(Element::list("ssd:Connectors", connectors))
            .containing((!inputs.is_empty()).then(|| binding("experiment")))
            .containing([Element::new("ssd:Elements").containing(elements)])
            .containing(Element::list("ssd:Connections", from_inputs.chain(inside).chain(to_outputs)))
            .containing([self.omsimulator()]);
        let root = Element::new("ssd:SystemStructureDescription")
            .with("xmlns:ssd", "http://ssp-standard.org/SSP1/SystemStructureDescription")
            .with("xmlns:ssc", COMMON)
            .with("version", "1.0")
            .with("name", name)
            .with("generationTool", concat!("fmu-run ", env!("CARGO_PKG_VERSION")));
        let experiment = Element::new("ssd:DefaultExperiment")
            .with("startTime", 0)
            .with("stopTime", self.structure.stop_time);
        let used = self.connected()?;
        Ok(root
            .containing([system])
            .containing(enumerations(&used)?)
            .containing(Element::list("ssd:Units", self.units_of(&used)))
            .containing([experiment]))
    }

    /// Returns the annotation with simulation settings that OMSimulator requires and other importers
    /// ignore. The tolerances are OMSimulator's defaults; it requires them even for fixed steps.
    fn omsimulator(&self) -> Element {
        let master = Element::new("oms:FixedStepMaster")
            .with("description", "oms-ma")
            .with("stepSize", self.structure.step_size)
            .with("absoluteTolerance", 1e-4)
            .with("relativeTolerance", 1e-4);
        let annotations = Element::new("oms:Annotations")
            .with(
                "xmlns:oms",
                "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd",
            )
            .containing([Element::new("oms:SimulationInformation").containing([master])]);
        let annotation =
            Element::new("ssc:Annotation").with("type", "org.openmodelica").containing([annotations]);
        Element::new("ssd:Annotations").containing([annotation])
    }

    /// Returns the variables at both ends of all connections. Their units and enumerations are defined in the file.
    fn connected(&self) -> Result<Vec<Found<'_>>, Error> {
        let SystemStructure { inputs, outputs, connections, .. } = self.structure;
        let ends = connections.iter().flat_map(|(from, to)| [*from, *to]);
        let ends =
            ends.chain(inputs.iter().map(|(_, to, _)| *to)).chain(outputs.iter().map(|(_, from)| *from));
        ends.map(|end| self.variable(end)).collect()
    }

    /// Returns the definitions of the units that the variables use.
    fn units_of(&self, variables: &[Found]) -> Vec<Element> {
        let used: HashSet<_> = variables.iter().map(|of| of.variable.unit.as_deref()).collect();
        let units = self.units.keys().filter(|name| used.contains(&Some(name.as_str())));
        units.filter_map(|name| self.unit(name)).collect()
    }

    fn unit(&self, name: &str) -> Option<Element> {
        let base = self.units.get(name)?.unwrap_or(BaseUnit::ONE).element("ssc:BaseUnit");
        Some(Element::new("ssc:Unit").with("name", name).containing([base]))
    }

    /// Returns a connector with the type and unit of a variable.
    fn connector(&self, name: &str, of: &str, kind: &str) -> Result<Element, Error> {
        let of = self.variable(of)?;
        let base_type = Element::new(format!("ssc:{}", of.variable.kind()))
            .with_some("unit", of.variable.unit.as_ref())
            .with_some("name", enumeration(of).map(|(name, _)| name));
        Ok(Element::new("ssd:Connector").with("name", name).with("kind", kind).containing([base_type]))
    }

    /// Returns name and content of the file with the start values of a component; `None` if it has none. Each
    /// start value is given as its name in the file, the full name of the variable, and the value.
    fn ssv<'b>(
        &self,
        component: &str,
        start: impl IntoIterator<Item = (&'b str, &'b str, &'b str)>,
    ) -> Result<Option<(String, Vec<u8>)>, Error> {
        let mut units = BTreeMap::new();
        let mut parameters = Vec::new();
        for (name, variable, start) in start {
            let of = self.variable(variable)?;
            let unit = of.variable.unit.as_ref();
            let value = Element::new(format!("ssv:{}", of.variable.kind()))
                .with("value", start)
                .with_some("unit", unit);
            units.extend(unit.and_then(|unit| Some((unit, self.unit(unit)?))));
            parameters.push(Element::new("ssv:Parameter").with("name", name).containing([value]));
        }
        if parameters.is_empty() {
            return Ok(None);
        }
        let root = Element::new("ssv:ParameterSet")
            .with("xmlns:ssv", "http://ssp-standard.org/SSP1/SystemStructureParameterValues")
            .with("xmlns:ssc", COMMON)
            .with("version", "1.0")
            .with("name", "default")
            .containing([Element::new("ssv:Parameters").containing(parameters)])
            .containing(
                (!units.is_empty()).then(|| Element::new("ssv:Units").containing(units.into_values())),
            );
        Ok(Some((format!("resources/{component}.ssv"), document(&root)?)))
    }
}

/// Returns the name and the items of the enumeration of a variable, if it has one.
fn enumeration<'a>(of: Found<'a>) -> Option<(&'a str, &'a [Item])> {
    Some((of.variable.declared_type.as_deref()?, of.description.items(of.variable)?))
}

/// Returns the enumerations of variables, if there are any.
fn enumerations(variables: &[Found]) -> Result<Option<Element>, Error> {
    let mut known: BTreeMap<&str, &[Item]> = BTreeMap::new();
    for (name, items) in variables.iter().filter_map(|of| enumeration(*of)) {
        let before = known.entry(name).or_insert(items);
        if !Item::are_same(before, items) {
            return request(format!("two FMUs have different enumerations with the name {name}"));
        }
    }
    let element = |(name, items): (&str, &[Item])| {
        let item = |of: &Item| Element::new("ssc:Item").with("name", &of.name).with("value", of.value);
        Element::new("ssc:Enumeration").with("name", name).containing(items.iter().map(item))
    };
    Ok(Element::list("ssd:Enumerations", known.into_iter().map(element)))
}

fn connection(from: (&str, &str), to: (&str, &str)) -> Element {
    let ends = [("start", from), ("end", to)];
    ends.into_iter().fold(Element::new("ssd:Connection"), |connection, (side, (component, name))| {
        let component = Some(component).filter(|component| !component.is_empty());
        connection.with_some(&format!("{side}Element"), component).with(format!("{side}Connector"), name)
    })
}

fn binding(component: &str) -> Element {
    let binding = Element::new("ssd:ParameterBinding").with("source", format!("resources/{component}.ssv"));
    Element::new("ssd:ParameterBindings").containing([binding])
}
