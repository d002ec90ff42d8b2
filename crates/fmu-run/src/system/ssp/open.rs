//! Opens systems in SSP files (System Structure and Parameterization 1.0).

use super::parameters::Target;
use super::read::{Read, child};
use super::source::Base;
use crate::description::Variable;
use crate::error::Error;
use crate::files::{Files, Kind, STRUCTURE};
use crate::fmu::Loaded;
use crate::start::StartValues;
use crate::system::{Component, Definition, Order, System};
use fmi_abi::files::Limits;
use fmi_abi::{shown, xml};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

impl System {
    /// Unpacks an SSP file, then loads and connects its FMUs. Systems may be nested. A connector of the outer system is an input or
    /// output of the system, with the same name, if connections lead to a component. Start values are read from parameter bindings.
    /// All files to which the system refers must be in the archive. `path` may also be the directory of an unpacked system, or the
    /// directory or the `OspSystemStructure.xml` of a system for libcosim that has no functions, groups and signals.
    ///
    /// # Safety
    /// The requirement of [`Fmu::open`](crate::Fmu::open), for each FMU in the file.
    ///
    /// # Errors
    /// Returns [`Error::Fmu`] if the file is not an SSP file, if one of its FMUs cannot be loaded, and for unsupported content:
    /// components that are not FMUs, and signal dictionaries. Returns [`Error::Request`] if a start value does not fit its variable, or
    /// if a connection names a connector that does not exist or has no direction. Also returns the errors of
    /// [`connect`](Self::connect).
    pub unsafe fn open(path: &Path, order: Order) -> Result<Self, Error> {
        if let Some(directory) = Self::osp_directory(path) {
            // SAFETY: the caller has met the requirement.
            return unsafe { Self::open_osp(&directory, order) };
        }
        let fail = |why: String| Error::Fmu(format!("{}: {why}", path.display()));
        let mut limits = Limits::default();
        let directory = Files::open(path, Kind::Ssp, &mut limits).map_err(fail)?;
        let text = directory.xml(STRUCTURE).map_err(fail)?;
        let mut declared = String::new();
        let document = xml::parse_undeclared(&text, STRUCTURE, &mut declared).map_err(fail)?;
        let root = document.root_element();
        let system = child(root, "System").ok_or_else(|| fail(format!("{STRUCTURE} has no System")))?;
        let is_archive = matches!(directory, Files::Temporary(_));
        let mut read =
            Read::of(path, Base { directory: directory.path(), is_archive }, root).map_err(fail)?;
        if let Some(other) = root.attribute("version").filter(|version| *version != "1.0") {
            read.warn(|| format!("{STRUCTURE} is of version {} and is read as SSP 1.0", shown(other)));
        }
        read.warn_of_others(root);
        read.outer_system(system).map_err(fail)?;

        let names =
            |(element, source): &(usize, PathBuf)| (read.elements[*element].name.clone(), source.clone());
        let components: Vec<_> = read.components.iter().map(names).collect();
        // SAFETY: the caller of this function has met the requirement for each FMU in the file.
        let components = unsafe { Self::load(&components, directory.path(), &mut limits) }.map_err(fail)?;
        for Component { name, fmu } in &components {
            // Each variable gets a name that begins with the name of its component.
            let length = |of: &Variable| name.len() + of.name.len() + size_of::<String>();
            fmu.description.variables.iter().try_for_each(|of| read.take(length(of))).map_err(fail)?;
        }
        let mut definition = Definition::of(root.attribute("name").unwrap_or("system"), components);
        definition.check_components()?;
        let links = read.links(&definition)?;
        let routes = read.routes(&definition, &links)?;
        read.connect(&mut definition, &links, &routes)?;
        let start = Target::of(&read, &definition, &links, &routes).start_values()?;
        (definition.start, definition.warnings) = (start, read.take_warnings());
        let stop_time = child(root, "DefaultExperiment").map(|of| xml::attribute(of, "stopTime"));
        definition.stop_time = stop_time.transpose().map_err(fail)?.flatten();
        let system = definition.finish(order)?;
        StartValues::of(&system, &[])?;
        Ok(system)
    }

    /// Loads the FMUs of components, each with its name and the path of its FMU. Components with one FMU share it.
    ///
    /// # Safety
    /// The requirement of [`Fmu::open`](crate::Fmu::open), for each FMU.
    pub(in crate::system) unsafe fn load(
        sources: &[(String, PathBuf)],
        directory: &Path,
        limits: &mut Limits,
    ) -> Result<Vec<Component>, String> {
        let inside = format!("{}/", directory.canonicalize().unwrap_or_default().display());
        let mut loaded: BTreeMap<&Path, Arc<Loaded>> = BTreeMap::new();
        let mut components = Vec::new();
        for (name, source) in sources {
            let fmu = match loaded.get(source.as_path()) {
                Some(fmu) => Arc::clone(fmu),
                None => {
                    // SAFETY: the caller of this function has met the requirement.
                    let opened = unsafe { Loaded::open(source, false, limits) };
                    let opened = opened.map_err(|error| {
                        format!("component {}: {}", shown(name), error.to_string().replace(&inside, ""))
                    })?;
                    Arc::clone(loaded.entry(source).or_insert_with(|| Arc::new(opened)))
                }
            };
            components.push(Component { name: name.clone(), fmu });
        }
        Ok(components)
    }
}
