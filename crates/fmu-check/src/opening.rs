//! Opens an FMU: unpacks it, and evaluates its files.

use crate::call_sequence::Setting;
use crate::checker::Checker;
use crate::checks::package;
use crate::consistency;
use crate::description::Description;
use crate::options::{INTERFACES, Options};
use crate::rules::Observation;
use crate::run::Workers;
use anyhow::{anyhow, bail};
use fmi_abi::Standard;
use fmi_abi::files::{MAX_XML, Scratch, read};
use std::collections::HashMap;
use std::path::Path;
use std::time::Instant;

/// Maximum number of observations of a rule about the files.
const MOST_OBSERVATIONS: usize = 100;

/// Unpacks an FMU. Returns the temporary directory with its files, and a checker that has recorded the findings in these files
/// and the interface types that cannot be checked.
pub fn opened(path: &Path, options: &Options, begin: Instant) -> anyhow::Result<(Scratch, Checker)> {
    let scratch = Scratch::new("fmu-check-")?;
    let workers = Workers::new(scratch.path().to_owned())?;
    let directory = &scratch.path().join("fmu");
    let zip_observations = package::unpack(path, directory, options.unpacked << 20)?;
    let file = directory.join("modelDescription.xml");
    if !file.exists() {
        bail!("{}: there is no modelDescription.xml in it; it is not an FMU", path.display());
    }
    let text =
        read(&file, MAX_XML).map_err(|why| anyhow!("{}: modelDescription.xml {why}", path.display()))?;
    let encoding = encoding(&text);
    // A file that is not UTF-8 is a finding. It is decoded as Latin-1, so that the other checks can continue.
    let text = match std::str::from_utf8(&text) {
        Ok(text) => text.to_owned(),
        Err(_) => text.iter().map(|byte| char::from(*byte)).collect(),
    };
    let text = text.trim_start_matches('\u{feff}');
    let description = Description::parse(text).map_err(|why| anyhow!("{}: {why}", path.display()))?;
    let mut observations = Vec::new();
    if options.wants("package") {
        observations.extend(zip_observations);
        observations.extend(package::look(directory, &description));
    }
    if options.wants("description") {
        observations.extend(encoding);
        observations.extend(description.wrong.iter().cloned());
        observations.extend(consistency::broken(&description));
    }
    // One mistake of a generator can concern all variables.
    let mut counts: HashMap<&str, usize> = HashMap::new();
    observations.retain(|(rule, _)| {
        let count = counts.entry(*rule).or_default();
        *count += 1;
        *count <= MOST_OBSERVATIONS
    });
    let (setting, without) = setting(options, directory, &description);
    let checker = Checker::new(description, setting, workers, options, begin);
    observations.into_iter().for_each(|(name, observed)| checker.add(checker.broken(name, observed)));
    without.into_iter().for_each(|(name, why)| checker.unchecked(name, why));
    Ok((scratch, checker))
}

/// Returns an observation if the XML declaration of a model description names an encoding other than UTF-8, or if the description
/// is not valid UTF-8.
fn encoding(text: &[u8]) -> Option<Observation> {
    let declaration = text.split(|byte| *byte == b'>').next().unwrap_or_default();
    let declaration = String::from_utf8_lossy(declaration);
    let declared =
        declaration.split_once("encoding=").and_then(|(_, rest)| rest.get(1..)?.split(['"', '\'']).next());
    let why = match declared {
        Some(name) if !name.eq_ignore_ascii_case("utf-8") => {
            format!("the encoding of modelDescription.xml is {name}")
        }
        _ if std::str::from_utf8(text).is_err() => {
            "modelDescription.xml has bytes that are not UTF-8".to_owned()
        }
        _ => return None,
    };
    Some(("description.encoding", why))
}

/// Returns the parameters that all call sequences share, and the interface types that cannot be checked, each with the reason.
fn setting(
    options: &Options,
    directory: &Path,
    description: &Description,
) -> (Setting, Vec<(&'static str, String)>) {
    let mut libraries = [None, None];
    let mut without = Vec::new();
    if description.scheduled_execution.is_some() {
        without.push((INTERFACES[2], "fmu-check has no checks for Scheduled Execution".to_owned()));
    }
    for (index, offer) in [&description.co_simulation, &description.model_exchange].into_iter().enumerate() {
        let Some(offer) = offer else { continue };
        if offer.can(&["needsExecutionTool"]) && !options.execution_tool {
            let why = "it starts another program (needsExecutionTool); to check it, give --execution-tool";
            without.push((INTERFACES[index], why.to_owned()));
            continue;
        }
        match package::library(directory, description.standard, offer) {
            Ok(library) => libraries[index] = Some(library),
            Err(why) => without.push((INTERFACES[index], why)),
        }
    }
    let setting = Setting {
        fmi3: description.standard == Standard::Fmi3,
        libraries,
        resources: directory.join("resources"),
        memory: options.memory << 20,
        soft: false,
        now: false,
        repetitions: options.repeat,
    };
    (setting, without)
}
