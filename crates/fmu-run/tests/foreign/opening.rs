//! Opens FMUs and files that are not FMUs.

use crate::built::built;
use crate::end;
use fmi_abi::write::zip;
use fmu_run::{Batch, Composition, Error, Fmu, Interface, Order, Setup, Standard, System, Trajectory, Watch};
use std::path::Path;

fn opened(path: &Path) -> Result<System, String> {
    // SAFETY: an FMU of these tests.
    match unsafe { Fmu::open(path) } {
        Ok(fmu) => Ok(fmu.system().clone()),
        Err(Error::Fmu(why)) => Err(why),
        Err(other) => panic!("{other:?}"),
    }
}

#[test]
fn messages_say_what_a_file_is() {
    let directory = tempfile::tempdir().unwrap();
    let file = |name: &str, content: &[u8]| {
        let path = directory.path().join(name);
        std::fs::write(&path, content).unwrap();
        path
    };
    let archive = |name: &str, entries: &[(&str, &str)]| {
        let entries = entries.iter().map(|(name, text)| ((*name).to_owned(), text.as_bytes().to_vec()));
        file(name, &zip(&entries.collect::<Vec<_>>()).unwrap())
    };
    let xml = |version: &str, rest: &str| {
        format!(
            "<fmiModelDescription fmiVersion=\"{version}\" modelName=\"M\" instantiationToken=\"x\">{rest}</fmiModelDescription>"
        )
    };
    let (one, scheduled) = (xml("1.0", ""), xml("3.0", "<ScheduledExecution modelIdentifier=\"m\"/>"));
    let none = xml("3.0", "");
    let sources = xml("3.0", "<CoSimulation modelIdentifier=\"m\"/>");
    for (path, why) in [
        (directory.path().join("missing.fmu"), "cannot be opened (No such file"),
        (file("empty.fmu", b""), "it is empty"),
        (file("pointer.fmu", b"version https://git-lfs.github.com/spec/v1\noid sha256:0\n"), "git lfs pull"),
        (file("page.fmu", b"<!DOCTYPE html><html></html>"), "it is a web page"),
        (file("model.so", b"\x7fELF\x02\x01\x01"), "it is a shared library"),
        (file("text.fmu", b"hello"), "is not an FMU, which is a zip file: it cannot be read as one"),
        (archive("other.fmu", &[("readme", "x")]), "is not an FMU: the zip file has no modelDescription.xml"),
        (
            archive("deep.fmu", &[("Model/modelDescription.xml", &one)]),
            "has its modelDescription.xml in the directory Model;",
        ),
        (
            archive("system.ssp", &[("SystemStructure.ssd", "<a/>")]),
            "is not an FMU but a system (SSP); open it with System",
        ),
        (archive("one.fmu", &[("modelDescription.xml", &one)]), "FMPy and PyFMI run FMI 1.0"),
        (archive("broken.fmu", &[("modelDescription.xml", "<a")]), "is not well-formed XML"),
        (archive("none.fmu", &[("modelDescription.xml", &none)]), "neither Co-Simulation nor Model Exchange"),
        (archive("scheduled.fmu", &[("modelDescription.xml", &scheduled)]), "only Scheduled Execution"),
        (
            archive("sources.fmu", &[("modelDescription.xml", &sources), ("sources/m.c", "")]),
            "has only C sources, which must be compiled first",
        ),
        (archive("outside.fmu", &[("../outside", "x")]), "would be outside of the directory"),
        (archive("absolute.fmu", &[("/tmp/outside", "x")]), "would be outside of the directory"),
        (archive("windows.fmu", &[("..\\outside", "x")]), "would be outside of the directory"),
        (directory.path().to_owned(), "is not an FMU: the directory has no modelDescription.xml"),
    ] {
        let found = opened(&path).unwrap_err();
        assert!(found.starts_with(&path.display().to_string()), "{found}");
        assert!(found.contains(why), "{found}");
        assert!(!found.contains('\n'), "{found}");
    }
    // SAFETY: the file is rejected, so no library is loaded.
    let system =
        unsafe { System::open(&archive("fmu.ssp", &[("modelDescription.xml", &one)]), Order::Jacobi) };
    assert!(system.unwrap_err().to_string().contains("is not a system (SSP) but an FMU; open it with Fmu"));
}

#[test]
fn unusual_archives_are_read() {
    for standard in [Standard::Fmi2, Standard::Fmi3] {
        let directory = tempfile::tempdir().unwrap();
        // Opens an unpacked FMU. Its files must not be removed.
        let unpacked = directory.path().join("unpacked");
        let archive = built("resources", standard, directory.path(), &[]);
        zip::ZipArchive::new(std::fs::File::open(archive).unwrap()).unwrap().extract(&unpacked).unwrap();
        assert_eq!(opened(&unpacked).and_then(|fmu| end(&fmu)), Ok(3.5));
        assert!(unpacked.join("modelDescription.xml").is_file());
        // Opens an archive with backslashes in its names, and with a model description in ISO-8859-1.
        let text = std::fs::read_to_string(unpacked.join("modelDescription.xml")).unwrap();
        let text = text
            .replace("UTF-8", "ISO-8859-1")
            .replace("modelName=\"Foreign\"", "modelName=\"For\u{eb}ign\"");
        let latin: Vec<u8> = text.chars().map(|char| u8::try_from(char).unwrap()).collect();
        let platform = if standard == Standard::Fmi2 { "linux64" } else { "x86_64-linux" };
        let library = std::fs::read(unpacked.join(format!("binaries/{platform}/integrator.so"))).unwrap();
        let platform = if standard == Standard::Fmi2 { platform } else { "x86_64-linux-gnu" };
        let strange = directory.path().join("strange.fmu");
        let entries = [
            ("modelDescription.xml".to_owned(), latin),
            (format!("binaries\\{platform}\\integrator.so"), library),
            ("resources\\gain.txt".to_owned(), b"1.5".to_vec()),
        ];
        std::fs::write(&strange, zip(&entries).unwrap()).unwrap();
        let fmu = opened(&strange).unwrap();
        assert_eq!((end(&fmu), fmu.name()), (Ok(2.5), "For\u{eb}ign"));
    }
}

/// The library of an FMU may have any plain name, although FMI requires an identifier of C. If it is missing, the message lists the files
/// that are there.
#[test]
fn libraries_have_plain_names() {
    for (standard, platform) in [(Standard::Fmi2, "linux64"), (Standard::Fmi3, "x86_64-linux")] {
        let directory = tempfile::tempdir().unwrap();
        let other = [("modelIdentifier=\"integrator\"", "modelIdentifier=\"2 test-models\"")];
        let why = opened(&built("plain", standard, directory.path(), &other)).unwrap_err();
        let expected = format!("(binaries/{platform}/2 test-models.so); it has: {platform}/integrator.so");
        assert!(why.ends_with(&expected), "{why}");
        let unpacked = directory.path().join("unpacked");
        let archive = std::fs::File::open(directory.path().join("integrator.fmu")).unwrap();
        zip::ZipArchive::new(archive).unwrap().extract(&unpacked).unwrap();
        let libraries = unpacked.join("binaries").join(platform);
        std::fs::rename(libraries.join("integrator.so"), libraries.join("2 test-models.so")).unwrap();
        assert_eq!(opened(&unpacked).and_then(|fmu| end(&fmu)), Ok(1.0));
        let outside = [("modelIdentifier=\"integrator\"", "modelIdentifier=\"../integrator\"")];
        let why = opened(&built("plain", standard, directory.path(), &outside)).unwrap_err();
        assert!(why.contains("modelIdentifier \"../integrator\" is not the name of a library"), "{why}");
    }
}

/// Other tests determine the platform from files that linkers wrote; this one is about the message.
#[test]
fn a_library_of_another_platform_is_named() {
    let mach = [&[0xcf, 0xfa, 0xed, 0xfe, 0x0c, 0, 0, 1][..], &[0; 24]].concat();
    let universal = [0xcafe_babe, 2, 0x0100_0007, 0, 48, 0, 0, 0x0100_000c, 0, 48, 32, 0];
    let universal = [universal.map(u32::to_be_bytes).concat(), mach].concat();
    let mut pe = vec![0; 0x40 + 4 + 20 + 112];
    pe[..2].copy_from_slice(b"MZ");
    pe[0x3c] = 0x40;
    pe[0x40..0x46].copy_from_slice(b"PE\0\0\x64\x86");
    pe[0x54] = 112;
    pe[0x58..0x5a].copy_from_slice(&[0x0b, 2]);
    for (standard, platform) in [(Standard::Fmi2, "linux64"), (Standard::Fmi3, "x86_64-linux")] {
        let directory = tempfile::tempdir().unwrap();
        let archive = std::fs::File::open(built("plain", standard, directory.path(), &[])).unwrap();
        zip::ZipArchive::new(archive).unwrap().extract(directory.path()).unwrap();
        let library = directory.path().join("binaries").join(platform).join("integrator.so");
        let own = std::fs::read(&library).unwrap();
        // The field e_machine of the ELF header selects the processor.
        let elf = |machine: [u8; 2]| [&own[..18], &machine, &own[20..]].concat();
        let here = "and this is Linux on x86_64";
        for (bytes, why) in [
            (elf([2, 1]), format!("it is for Linux on loongarch64, {here}")),
            (elf([243, 0]), format!("it is for Linux on riscv64, {here}")),
            (universal.clone(), format!("it is for macOS on x86_64 and aarch64, {here}")),
            (pe.clone(), format!("it is for Windows on x86_64, {here}")),
        ] {
            std::fs::write(&library, bytes).unwrap();
            let found = opened(directory.path()).unwrap_err();
            assert!(found.ends_with(&format!("its library cannot be loaded: {why}")), "{found}");
        }
        std::fs::write(&library, &own[..60]).unwrap();
        let found = opened(directory.path()).unwrap_err();
        // The rest of the message comes from the operating system.
        let (_, why) = found.split_once("its library cannot be loaded: ").unwrap();
        assert!(why.contains(&format!("{}: ", library.display())), "{why}");
    }
}

#[test]
fn the_interface_type_must_exist() {
    let directory = tempfile::tempdir().unwrap();
    let run = |fmu: &System, interface| {
        let batch = Batch { time: &[0.0, 1.0], outputs: vec!["y"], interface, ..Batch::default() };
        fmu.run(&batch, &Watch::default()).map(|runs| runs.errors.len())
    };
    for standard in [Standard::Fmi2, Standard::Fmi3] {
        let fmu = opened(&built("plain", standard, directory.path(), &[])).unwrap();
        let why = Err(Error::Fmu("Foreign has no Model Exchange".to_owned()));
        assert_eq!(run(&fmu, Some(Interface::ModelExchange)), why);
        let changes = [("<CoSimulation", "<ModelExchange")];
        let fmu = opened(&built("plain", standard, directory.path(), &changes)).unwrap();
        let integrates = "`run` of this FMU integrates it, but in systems it is not supported";
        let why = format!("Foreign has no Co-Simulation, only Model Exchange; {integrates}");
        assert_eq!(run(&fmu, Some(Interface::CoSimulation)), Err(Error::Fmu(why.clone())));
        assert_eq!(fmu.instances(&Setup::default()).map(drop), Err(Error::Fmu(why)));
        // The run fails, because the library itself supports only Co-Simulation.
        assert_eq!(run(&fmu, None), Ok(1));
    }
}

/// Two variables of one name cannot be told apart, but the others can be used.
#[test]
fn variables_of_one_name_are_an_error() {
    let directory = tempfile::tempdir().unwrap();
    for standard in [Standard::Fmi2, Standard::Fmi3] {
        let path = built("plain", standard, directory.path(), &[("name=\"gain\"", "name=\"tolerance\"")]);
        let fmu = opened(&path).unwrap();
        assert_eq!(end(&fmu), Ok(1.0));
        let why = fmu.select(&["tolerance"]).unwrap_err().to_string();
        assert_eq!(why, "tolerance is the name of several variables in modelDescription.xml");
    }
}

/// A state or an event indicator that does not exist is an error in Model Exchange. Co-Simulation does not need it.
#[test]
fn a_model_structure_with_unknown_variables_is_an_error_in_model_exchange() {
    let directory = tempfile::tempdir().unwrap();
    for (standard, entry) in [
        (Standard::Fmi2, "<ModelStructure><Derivatives><Unknown index=\"777\"/></Derivatives>"),
        (Standard::Fmi3, "<ModelStructure><EventIndicator valueReference=\"777\"/>"),
    ] {
        let structure = ("<ModelStructure>", entry);
        let path = built("plain", standard, directory.path(), &[structure]);
        assert_eq!(opened(&path).and_then(|fmu| end(&fmu)), Ok(1.0));
        let changes = [structure, ("<CoSimulation", "<ModelExchange")];
        let path = built("plain", standard, directory.path(), &changes);
        let why = opened(&path).and_then(|fmu| end(&fmu)).unwrap_err();
        assert_eq!(why, "modelDescription.xml: ModelStructure refers to 777, which does not exist");
    }
}

#[test]
fn clocks_are_named() {
    let directory = tempfile::tempdir().unwrap();
    let clock = "<ModelVariables><Clock name=\"tick\" valueReference=\"99\" causality=\"input\" intervalVariability=\"triggered\"/>\
        <Float64 name=\"ticks\" valueReference=\"98\" causality=\"output\" variability=\"discrete\" clocks=\"99\"/>";
    let path = built("plain", Standard::Fmi3, directory.path(), &[("<ModelVariables>", clock)]);
    let fmu = opened(&path).unwrap();
    assert_eq!(end(&fmu), Ok(1.0));
    let why = fmu.select(&["tick"]).unwrap_err().to_string();
    assert!(
        why.starts_with("tick is a clock; only the function run, for a single FMU, ticks clocks"),
        "{why}"
    );
    let why = fmu.select(&["ticks"]).unwrap_err().to_string();
    assert!(why.starts_with("ticks has a value only while its clock ticks"), "{why}");
    // The importer need not activate a triggered clock, but without ticks at its own times another clock has no effect.
    let run = |path: &Path| {
        // SAFETY: the FMU of this test.
        let fmu = unsafe { Fmu::open(path) }.unwrap();
        let run = |system: &System, output| {
            let batch = Batch { time: &[0.0, 1.0], outputs: vec![output], ..Batch::default() };
            system.run(&batch, &Watch::default()).map(drop)
        };
        let composition = Composition { components: vec![("a", &fmu)], ..Composition::default() };
        let connected = System::connect(&composition).unwrap();
        let made = fmu.system().instances(&Setup::default()).map(drop);
        [run(fmu.system(), "y"), run(&connected, "a.y"), made]
    };
    assert_eq!(run(&path), [Ok(()), Ok(()), Ok(())]);
    // Nor is its input set, so that the caller is told.
    let input = clock.replace("\"output\" variability", "\"input\" start=\"0\" variability");
    let path = built("plain", Standard::Fmi3, directory.path(), &[("<ModelVariables>", &input)]);
    // SAFETY: the FMU of this test.
    let fmu = unsafe { Fmu::open(&path) }.unwrap();
    let inputs = vec![("ticks", Trajectory::Constant(1.0))];
    let batch = Batch { time: &[0.0, 1.0], outputs: vec!["y"], inputs, ..Batch::default() };
    let why = fmu.system().run(&batch, &Watch::default()).unwrap_err().to_string();
    assert!(why.starts_with("tick is a clock, but in Co-Simulation "), "{why}");
    let periodic = clock.replace("\"triggered\"", "\"constant\" intervalDecimal=\"0.1\"");
    let path = built("plain", Standard::Fmi3, directory.path(), &[("<ModelVariables>", &periodic)]);
    let why = |name| {
        let what = "is an input clock that must tick at its own times, but only the function run, for a single FMU, ticks clocks";
        Err(Error::Fmu(format!("{name} {what}")))
    };
    let [alone, connected, made] = run(&path);
    assert_eq!((connected, made), (why("a.tick"), why("tick")));
    // The description of this FMU has no hasEventMode.
    let alone = alone.unwrap_err().to_string();
    assert!(
        alone.starts_with("tick is a clock, but in Co-Simulation ") && alone.ends_with("which clocks need"),
        "{alone}"
    );
}
