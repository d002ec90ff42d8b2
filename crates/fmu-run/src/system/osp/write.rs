//! Writes systems for libcosim: a directory with `OspSystemStructure.xml` and the FMUs.

use super::STRUCTURE;
use crate::error::Error;
use crate::system::structure::{CheckedStructure, document, file_name, split};
use fmi_abi::boolean;
use fmi_abi::write::{Element, write_atomically};
use std::io::Write;
use std::path::Path;

impl CheckedStructure<'_> {
    /// Writes the directory for libcosim: `OspSystemStructure.xml` and the FMUs.
    ///
    /// # Errors
    /// Returns [`Error::Fmu`] if a file cannot be written.
    pub fn write_osp(&self, directory: &Path) -> Result<(), Error> {
        let text = document(&self.osp()?)?;
        for (name, bytes) in self.files()?.into_iter().chain([(STRUCTURE, text.as_slice())]) {
            write_atomically(&directory.join(name), |file| file.write_all(bytes)).map_err(Error::Fmu)?;
        }
        Ok(())
    }

    fn osp(&self) -> Result<Element, Error> {
        let mut simulators = Vec::new();
        for (component, path) in &self.structure.components {
            let inputs = self.structure.inputs.iter().map(|(_, to, start)| (*to, start.as_str()));
            let inputs = inputs.filter(|(to, _)| split(to).0 == *component);
            let mut initial = Vec::new();
            for (name, start) in self.own_start(component).into_iter().chain(inputs) {
                let value = self.initial_value(name, start)?;
                initial
                    .push(Element::new("InitialValue").with("variable", split(name).1).containing([value]));
            }
            let initial = (!initial.is_empty()).then(|| Element::new("InitialValues").containing(initial));
            let simulator =
                Element::new("Simulator").with("name", component).with("source", file_name(path)?);
            simulators.push(simulator.containing(initial));
        }
        let variable = |end: &str| {
            let (simulator, name) = split(end);
            Element::new("Variable").with("simulator", simulator).with("name", name)
        };
        let connections = self.structure.connections.iter();
        let connections = connections
            .map(|(from, to)| Element::new("VariableConnection").containing([variable(from), variable(to)]));
        let root = Element::new("OspSystemStructure")
            .with("xmlns", "http://opensimulationplatform.com/MSMI/OSPSystemStructure")
            .with("version", "0.1");
        Ok(root.containing([
            Element::new("StartTime").saying("0.0"),
            Element::new("EndTime").saying(self.structure.stop_time),
            Element::new("BaseStepSize").saying(self.structure.step_size),
            Element::new("Algorithm").saying("fixedStep"),
            Element::new("Simulators").containing(simulators),
            Element::new("Connections").containing(connections),
        ]))
    }

    /// Returns the element of an initial value. An item of an enumeration is written as its number.
    fn initial_value(&self, name: &str, start: &str) -> Result<Element, Error> {
        let found = self.variable(name)?;
        let items = found.description.items(found.variable).unwrap_or_default();
        Ok(match (items.iter().find(|item| item.name == start), found.variable.kind()) {
            (Some(item), _) => Element::new("Integer").with("value", item.value),
            // Not 0 or 1, which few parsers accept.
            (None, "Boolean") => Element::new("Boolean").with("value", boolean(start) == Some(true)),
            (None, kind) => Element::new(kind).with("value", start),
        })
    }
}
