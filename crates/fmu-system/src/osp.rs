//! Output for libcosim: a directory with `OspSystemStructure.xml` and the FMUs.

use crate::system::{CheckedSystem, file_name, split};
use anyhow::Result;
use fmu_package::files::write_atomically;
use fmu_package::xml::Element;
use std::io::Write;
use std::path::Path;

impl CheckedSystem<'_> {
    /// Writes the directory for libcosim: `OspSystemStructure.xml` and the FMUs.
    ///
    /// # Errors
    /// Fails if a file cannot be written.
    pub fn write_osp(&self, directory: &Path) -> Result<()> {
        for (name, bytes) in self.files()? {
            write_atomically(&directory.join(name), |file| Ok(file.write_all(bytes)?))?;
        }
        let text = self.osp()?.document()?;
        write_atomically(&directory.join("OspSystemStructure.xml"), |file| {
            Ok(file.write_all(text.as_bytes())?)
        })?;
        Ok(())
    }

    fn osp(&self) -> Result<Element> {
        let mut simulators = Vec::new();
        for (component, path) in &self.system.components {
            let inputs = self.system.inputs.iter().map(|(_, to, start)| (*to, start.as_str()));
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
        let connections = self.system.connections.iter();
        let connections = connections
            .map(|(from, to)| Element::new("VariableConnection").containing([variable(from), variable(to)]));
        let root = Element::new("OspSystemStructure")
            .with("xmlns", "http://opensimulationplatform.com/MSMI/OSPSystemStructure")
            .with("version", "0.1");
        Ok(root.containing([
            Element::new("StartTime").saying("0.0"),
            Element::new("EndTime").saying(self.system.stop_time),
            Element::new("BaseStepSize").saying(self.system.step_size),
            Element::new("Algorithm").saying("fixedStep"),
            Element::new("Simulators").containing(simulators),
            Element::new("Connections").containing(connections),
        ]))
    }

    /// Returns the element of an initial value. An item of an enumeration is written as its number.
    fn initial_value(&self, name: &str, start: &str) -> Result<Element> {
        let variable = self.variable(name)?;
        Ok(match variable.number_of(start) {
            Some(number) => Element::new("Integer").with("value", number),
            None => Element::new(variable.kind()).with("value", start),
        })
    }
}
