//! The FMU as a zip file.

use anyhow::bail;
use fmu_package::files::write_atomically;
use fmu_package::{ContentFile, Library, Parts, Platform, Standard, pack};
use std::fs;
use std::io::{Cursor, Read, Write};
use std::path::{Path, PathBuf};
use zip::{CompressionMethod, ZipArchive};

/// A directory with the files to pack.
struct Sources {
    directory: tempfile::TempDir,
}

impl Sources {
    fn new() -> Self {
        let directory = tempfile::tempdir().unwrap();
        for (name, content) in
            [("lib.so", "machine code"), ("lib.dll", "other code"), ("index.html", "<html>")]
        {
            fs::write(directory.path().join(name), content).unwrap();
        }
        Self { directory }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.directory.path().join(name)
    }

    fn library(&self, platform: &str, name: &str) -> Library {
        Library { platform: Platform::of_directory(platform).unwrap(), path: self.path(name) }
    }

    fn content(&self, names: &[&str]) -> Vec<ContentFile> {
        names.iter().map(|name| ContentFile { name: (*name).into(), path: self.path("index.html") }).collect()
    }

    fn pack(&self, destination: &Path, libraries: &[Library]) -> anyhow::Result<u64> {
        let content = self.content(&["documentation/index.html"]);
        pack(destination, &self.parts(Standard::Fmi2, libraries, &content))
    }

    fn parts<'a>(&self, fmi: Standard, libraries: &'a [Library], content: &'a [ContentFile]) -> Parts<'a> {
        Parts {
            fmi,
            identifier: "model",
            description: "<xml/>",
            terminals: None,
            libraries,
            sources: &[],
            content,
        }
    }

    fn pack_both(&self, destination: &Path) -> u64 {
        let libraries = [self.library("win64", "lib.dll"), self.library("linux64", "lib.so")];
        self.pack(destination, &libraries).unwrap()
    }
}

#[test]
fn the_zip_file_has_the_form_that_fmi_requires() {
    let sources = Sources::new();
    let fmu = sources.path("out/deep/model.fmu");
    let size = sources.pack_both(&fmu);
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
            "documentation/index.html"
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
    let mut text = String::new();
    zip.by_name("binaries/win64/model.dll").unwrap().read_to_string(&mut text).unwrap();
    assert_eq!(text, "other code");
}

#[test]
fn in_fmi_3_directories_and_icon_have_other_names() {
    let sources = Sources::new();
    let fmu = sources.path("model.fmu");
    let libraries = [sources.library("win64", "lib.dll"), sources.library("x86_64-linux", "lib.so")];
    let names = |content: &[&str]| {
        let content = sources.content(content);
        let parts = sources.parts(Standard::Fmi3, &libraries, &content);
        pack(&fmu, &Parts { terminals: Some("<terminals/>"), ..parts }).unwrap();
        let zip = ZipArchive::new(Cursor::new(fs::read(&fmu).unwrap())).unwrap();
        zip.file_names().map(|name| name.unwrap().into_owned()).collect::<Vec<_>>()
    };
    let expected = [
        "modelDescription.xml",
        "binaries/x86_64-linux/model.so",
        "binaries/x86_64-windows/model.dll",
        "documentation/licenses/license.txt",
        "terminalsAndIcons/icon.png",
        "terminalsAndIcons/terminalsAndIcons.xml",
    ];
    assert_eq!(names(&["documentation/licenses/license.txt", "model.png"]), expected);
    let both = ["documentation/licenses/license.txt", "model.png", "terminalsAndIcons/icon.png"];
    assert_eq!(names(&both), expected);
}

#[test]
fn the_same_content_gives_the_same_bytes() {
    let (one, other) = (Sources::new(), Sources::new());
    let (a, b) = (one.path("a.fmu"), other.path("b.fmu"));
    one.pack_both(&a);
    other.pack_both(&b);
    one.pack_both(&a);
    assert_eq!(fs::read(a).unwrap(), fs::read(b).unwrap());
}

#[test]
fn errors_name_the_file_and_leave_nothing() {
    let sources = Sources::new();
    let fmu = sources.path("out/model.fmu");
    for (libraries, message) in [
        (vec![], "at least one library"),
        (vec![sources.library("linux64", "none.so")], "none.so"),
        (
            vec![sources.library("linux64", "lib.so"), sources.library("linux64", "lib.dll")],
            "linux64/model.so occurs twice",
        ),
    ] {
        let error = format!("{:#}", sources.pack(&fmu, &libraries).unwrap_err());
        assert!(error.contains(message), "{error}");
    }
    assert!(!fmu.exists());

    let blocked = sources.path("lib.so/model.fmu");
    let error = format!("{:#}", sources.pack(&blocked, &[sources.library("linux64", "lib.so")]).unwrap_err());
    assert!(error.contains("cannot make the directory") && error.contains("lib.so"), "{error}");
}

#[test]
fn an_interrupted_write_leaves_the_old_file_and_no_other() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("model.fmu");
    let interrupted = |path: &Path| {
        write_atomically(path, |file| {
            file.write_all(b"half")?;
            bail!("no space left on device")
        })
    };
    let error = format!("{:#}", interrupted(&path).unwrap_err());
    assert!(error.contains("model.fmu") && error.contains("no space"), "{error}");
    assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 0);

    write_atomically(&path, |file| Ok(file.write_all(b"complete")?)).unwrap();
    interrupted(&path).unwrap_err();
    assert_eq!(fs::read(&path).unwrap(), b"complete");
    assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 1);
}
