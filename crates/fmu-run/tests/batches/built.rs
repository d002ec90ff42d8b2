//! Compiles and packs the FMU of `resets.c`.

use fmu_run::{Fmu, System};
use fmu_test_kit::c_programs::headers;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;
use tempfile::TempDir;
use zip::write::SimpleFileOptions;

const DESCRIPTION: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="Resets" guid="GUID">
  <CoSimulation modelIdentifier="resets" canHandleVariableCommunicationStepSize="true"/>
  <ModelVariables>
    <ScalarVariable name="u" valueReference="0" causality="input" variability="continuous"><Real start="0"/></ScalarVariable>
    <ScalarVariable name="y" valueReference="1" causality="output" variability="continuous"><Real/></ScalarVariable>
    <ScalarVariable name="factor" valueReference="2" causality="parameter" variability="fixed"><Real start="1"/></ScalarVariable>
    <ScalarVariable name="bias" valueReference="3" causality="parameter" variability="fixed"><Real start="0"/></ScalarVariable>
    <ScalarVariable name="fails" valueReference="4" causality="parameter" variability="fixed"><Real start="-1"/></ScalarVariable>
    <ScalarVariable name="hidden" valueReference="5" variability="discrete"><Real/></ScalarVariable>
  </ModelVariables>
  <ModelStructure><Outputs><Unknown index="2"/></Outputs></ModelStructure>
</fmiModelDescription>
"#;

/// The FMU of `resets.c` with one of its manners, and the directory with its record: a file to which the FMU writes when an
/// instance is created, reset or freed.
pub struct Recorded {
    pub fmu: Option<System>,
    directory: TempDir,
}

/// Returns the library, compiled once.
fn library() -> &'static Path {
    static COMPILED: OnceLock<(TempDir, PathBuf)> = OnceLock::new();
    let (_, path) = COMPILED.get_or_init(|| {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("resets.so");
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/batches/resets.c");
        let flags =
            ["-std=c99", "-Wall", "-Wextra", "-Werror", "-O2", "-ffp-contract=off", "-shared", "-fPIC", "-I"];
        let status =
            Command::new("cc").args(flags).arg(headers(&source)).arg(&source).arg("-o").arg(&path).status();
        assert!(status.expect("these tests need a C compiler").success());
        (directory, path)
    });
    path
}

impl Recorded {
    /// Builds and opens the FMU with this manner and with an attribute that is added to its element CoSimulation.
    pub fn open(manner: &str, attribute: &str) -> Self {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("resets.fmu");
        let guid = format!("{{{manner}:{}}}", directory.path().join("record").display());
        let xml = DESCRIPTION
            .replace("GUID", &guid)
            .replace("<CoSimulation", &format!("<CoSimulation {attribute}"));
        let mut archive = zip::ZipWriter::new(File::create(&path).unwrap());
        for (name, content) in [
            ("modelDescription.xml", xml.into_bytes()),
            ("binaries/linux64/resets.so", std::fs::read(library()).unwrap()),
        ] {
            archive.start_file(name, SimpleFileOptions::default()).unwrap();
            archive.write_all(&content).unwrap();
        }
        archive.finish().unwrap();
        // SAFETY: the FMU of these tests.
        let fmu = unsafe { Fmu::open(&path) }.unwrap().system().clone();
        Self { fmu: Some(fmu), directory }
    }

    pub fn fmu(&self) -> &System {
        self.fmu.as_ref().unwrap()
    }

    /// Returns how many instances have been created, reset and freed so far.
    pub fn counts(&self) -> [usize; 3] {
        let record = std::fs::read_to_string(self.directory.path().join("record")).unwrap_or_default();
        ['+', 'r', '-'].map(|of| record.matches(of).count())
    }
}
