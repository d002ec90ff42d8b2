//! The FMU as a zip file.

use fmi_abi::stamp::Stamp;
use fmi_abi::write::{unzip, write_atomically};
use fmu_package::{ContentFile, Library, NO_GUID, Packed, Parts, Platform, Standard, pack};
use std::fs;
use std::io::{Cursor, Read, Write};
use std::path::{Path, PathBuf};
use tempfile::TempDir;
use zip::{CompressionMethod, ZipArchive};

/// The parts of an FMU, and a directory with its files.
struct Example {
    directory: TempDir,
    fmi: Standard,
    description: String,
    terminals: Option<String>,
    libraries: Vec<Library>,
    page: String,
    content: Vec<&'static str>,
}

impl Example {
    fn new() -> Self {
        let directory = tempfile::tempdir().unwrap();
        for name in CONTENT {
            fs::write(directory.path().join(name.replace('/', "-")), name).unwrap();
        }
        Self {
            directory,
            fmi: Standard::Fmi2,
            description: format!("<fmiModelDescription guid=\"{NO_GUID}\" author=\"me\"/>"),
            terminals: None,
            libraries: vec![library("win64", "other code"), library("linux64", "machine code")],
            page: "<html>".to_owned(),
            content: vec!["documentation/licenses/license.txt"],
        }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.directory.path().join(name)
    }

    fn pack(&self, destination: &Path) -> anyhow::Result<Packed> {
        let content: Vec<_> = self
            .content
            .iter()
            .map(|name| ContentFile { name: (*name).to_owned(), path: self.path(&name.replace('/', "-")) })
            .collect();
        let page = |guid: &str| {
            Ok(vec![("documentation/index.html".to_owned(), format!("{}{guid}", self.page).into_bytes())])
        };
        let parts = Parts {
            fmi: self.fmi,
            identifier: "model",
            description: &self.description,
            terminals: self.terminals.as_deref(),
            libraries: &self.libraries,
            with_guid: &page,
            content: &content,
        };
        pack(destination, &parts)
    }

    fn guid(&self) -> String {
        self.pack(&self.path("model.fmu")).unwrap().guid
    }

    fn names(&self) -> Vec<String> {
        let fmu = self.path("model.fmu");
        self.pack(&fmu).unwrap();
        let zip = ZipArchive::new(Cursor::new(fs::read(&fmu).unwrap())).unwrap();
        zip.file_names().map(|name| name.unwrap().into_owned()).collect()
    }
}

const CONTENT: [&str; 4] =
    ["documentation/licenses/license.txt", "model.png", "resources/a.csv", "terminalsAndIcons/icon.png"];

/// A library that contains this code and a stamp.
fn library(platform: &str, code: &str) -> Library {
    let mut bytes = code.as_bytes().to_vec();
    bytes.extend([0; Stamp::SIZE]);
    Stamp::new(1).write(&mut bytes, code.len());
    Library::new(Platform::of_directory(platform).unwrap(), bytes)
}

/// Importers that unpack FMUs by their guid show the content of another FMU if both have the same.
#[test]
fn any_changed_byte_changes_the_guid() {
    type Change = fn(&mut Example);
    let changes: [(&str, Change); 16] = [
        ("nothing", |_| ()),
        ("FMI version", |of| of.fmi = Standard::Fmi3),
        ("description", |of| of.description = of.description.replace("me", "we")),
        ("terminals", |of| of.terminals = Some("<terminals/>".into())),
        ("other terminals", |of| of.terminals = Some("<terminals />".into())),
        ("code of a library", |of| of.libraries[0].bytes[3] ^= 1),
        ("last byte of a library", |of| of.libraries[1].bytes.push(0)),
        ("start value in a library", |of| {
            let position = Stamp::positions(&of.libraries[1].bytes)[0];
            Stamp::new(1).with_starts(&[(3, 0.5)]).write(&mut of.libraries[1].bytes, position);
        }),
        ("last digit of a start value in a library", |of| {
            let position = Stamp::positions(&of.libraries[1].bytes)[0];
            Stamp::new(1).with_starts(&[(3, 0.5_f64.next_up())]).write(&mut of.libraries[1].bytes, position);
        }),
        ("platform", |of| of.libraries[1].platform = Platform::of_directory("linux32").unwrap()),
        ("number of libraries", |of| drop(of.libraries.pop())),
        ("page", |of| of.page.push(' ')),
        ("content", |of| fs::write(of.path("documentation-licenses-license.txt"), "other").unwrap()),
        ("additional content", |of| of.content.push("resources/a.csv")),
        ("additional picture", |of| of.content.push("model.png")),
        ("content with another name", |of| of.content[0] = "resources/a.csv"),
    ];
    let mut guids: Vec<(String, &str)> = Vec::new();
    for (what, change) in changes {
        let mut example = Example::new();
        change(&mut example);
        let guid = example.guid();
        assert_eq!(guid, example.guid(), "{what}");
        if let Some((_, other)) = guids.iter().find(|(known, _)| *known == guid) {
            panic!("{what} and {other} have the same guid");
        }
        guids.push((guid, what));
    }
}

/// The description, the libraries and the page contain the guid; it does not depend on a guid that a library had before.
#[test]
fn the_guid_is_written_everywhere() {
    for (fmi, attribute) in [(Standard::Fmi2, "guid"), (Standard::Fmi3, "instantiationToken")] {
        let mut example = Example { fmi, ..Example::new() };
        example.description = example.description.replace("guid", attribute);
        let guid = example.guid();
        let content = fs::read(example.path("model.fmu")).unwrap();
        let read = |name: &str| unzip(&content, name).unwrap();
        let description = String::from_utf8(read("modelDescription.xml")).unwrap();
        assert_eq!(description, format!("<fmiModelDescription {attribute}=\"{guid}\" author=\"me\"/>"));
        let library = read(if fmi == Standard::Fmi2 {
            "binaries/win64/model.dll"
        } else {
            "binaries/x86_64-windows/model.dll"
        });
        assert_eq!(Stamp::read(&library, Stamp::positions(&library)[0]).guid(), guid);
        assert_eq!(read("documentation/index.html"), format!("<html>{guid}").into_bytes());
        example.libraries[0].bytes = library;
        assert_eq!(example.guid(), guid);
    }
}

#[test]
fn the_zip_file_has_the_form_that_fmi_requires() {
    let example = Example::new();
    let fmu = example.path("out/deep/model.fmu");
    let size = example.pack(&fmu).unwrap().size;
    let bytes = fs::read(&fmu).unwrap();
    assert_eq!(bytes.len() as u64, size);

    let mut zip = ZipArchive::new(Cursor::new(&bytes)).unwrap();
    let names: Vec<String> = zip.file_names().map(|name| name.unwrap().into_owned()).collect();
    assert_eq!(
        names,
        [
            "modelDescription.xml",
            "binaries/linux64/model.so",
            "binaries/win64/model.dll",
            "documentation/index.html",
            "documentation/licenses/license.txt"
        ]
    );
    for i in 0..zip.len() {
        let file = zip.by_index(i).unwrap();
        assert_eq!(file.compression(), CompressionMethod::Deflated);
        assert_eq!(file.last_modified(), Some(zip::DateTime::default()));
        assert_eq!(file.unix_mode(), Some(0o100_644));
        // At most version 2.0, no flags, no extra fields and no zip64 (section 2.3 of FMI 2.0).
        let header = usize::try_from(file.header_start()).unwrap();
        assert_eq!(bytes[header + 4..header + 8], [20, 0, 0, 0]);
        assert_eq!(bytes[header + 28..header + 30], [0, 0]);
    }
    let mut library = Vec::new();
    zip.by_name("binaries/win64/model.dll").unwrap().read_to_end(&mut library).unwrap();
    assert!(library.starts_with(b"other code"));
}

#[test]
fn in_fmi_3_directories_and_icon_have_other_names() {
    let terminals = Some("<terminals/>".to_owned());
    let mut example = Example { fmi: Standard::Fmi3, terminals, ..Example::new() };
    example.content.push("model.png");
    let expected = [
        "modelDescription.xml",
        "binaries/x86_64-linux/model.so",
        "binaries/x86_64-windows/model.dll",
        "documentation/index.html",
        "documentation/licenses/license.txt",
        "terminalsAndIcons/icon.png",
        "terminalsAndIcons/terminalsAndIcons.xml",
    ];
    assert_eq!(example.names(), expected);
    example.content.push("terminalsAndIcons/icon.png");
    assert_eq!(example.names(), expected);
}

#[test]
fn the_same_content_gives_the_same_bytes() {
    let (one, other) = (Example::new(), Example::new());
    let (a, b) = (one.path("a.fmu"), other.path("b.fmu"));
    for (example, path) in [(&one, &a), (&other, &b), (&one, &a)] {
        example.pack(path).unwrap();
    }
    assert_eq!(fs::read(a).unwrap(), fs::read(b).unwrap());
}

#[test]
fn errors_name_the_file_and_leave_nothing() {
    let example = Example::new();
    let fmu = example.path("out/model.fmu");
    let error = |example: &Example, fmu: &Path| format!("{:#}", example.pack(fmu).unwrap_err());
    let libraries = vec![library("linux64", "one"), library("linux64", "other")];
    let twice = error(&Example { libraries, ..Example::new() }, &fmu);
    assert!(twice.contains("linux64/model.so occurs twice"), "{twice}");
    let none = error(&Example { libraries: Vec::new(), ..Example::new() }, &fmu);
    assert!(none.contains("at least one library"), "{none}");
    let missing = error(&Example { content: vec!["resources/none"], ..Example::new() }, &fmu);
    assert!(missing.contains("resources-none"), "{missing}");
    assert!(!fmu.exists());

    let blocked = error(&example, &example.path("model.png/model.fmu"));
    assert!(blocked.contains("cannot make the directory") && blocked.contains("model.png"), "{blocked}");
}

#[test]
fn an_interrupted_write_leaves_the_old_file_and_no_other() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("model.fmu");
    let interrupted = |path: &Path| {
        write_atomically(path, |file| {
            file.write_all(b"half")?;
            Err(std::io::Error::other("no space left on device"))
        })
    };
    let error = interrupted(&path).unwrap_err();
    assert!(error.contains("model.fmu") && error.contains("no space"), "{error}");
    assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 0);

    write_atomically(&path, |file| file.write_all(b"complete")).unwrap();
    interrupted(&path).unwrap_err();
    assert_eq!(fs::read(&path).unwrap(), b"complete");
    assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 1);
}
