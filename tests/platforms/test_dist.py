"""The files in dist/ are complete and consistent."""

from __future__ import annotations

import hashlib
import json
import re
import subprocess
import sys
import zipfile
from email.parser import Parser

import fmpy
import pytest
from bill_of_materials import PRODUCTS
from built import script_of
from conftest import DIST, FMI3, ROOT, binaries, names, prw_wheel, wheel
from cyclonedx.schema import SchemaVersion
from cyclonedx.validation.json import JsonStrictValidator
from fmpy.validation import validate_fmu
from packaging.utils import parse_wheel_filename
from release import CHANGELOG, RUST, SUMS, cargo_version, release_notes
from targets import ARM_DIRECTORIES, CONTROLLER, DIRECTORIES, FMI3_DIRECTORIES, MODEL, MODELS, TARGETS, WINDOWS, Target

ARM, SOURCE = f"{MODEL}-linux-arm64.fmu", f"{MODEL}-source.fmu"
#: The FMUs, each with the directories of `binaries/`.
MODEL_FMUS = {f"{MODEL}.fmu": DIRECTORIES, ARM: ARM_DIRECTORIES, FMI3: FMI3_DIRECTORIES, SOURCE: {}}
MODEL_FMUS |= {f"{CONTROLLER}.fmu": DIRECTORIES, f"{CONTROLLER}-fmi3.fmu": FMI3_DIRECTORIES}
SYSTEM = "prw_closed_loop.ssp"
CRATE = ROOT / "crates" / "fmu-run"


def files_except_binaries(name: str) -> dict[str, bytes]:
    """Returns the files of an FMU except binaries and sources."""
    with zipfile.ZipFile(DIST / name) as archive:
        kept = (file for file in archive.namelist() if not file.startswith(("binaries/", "sources/")))
        return {file: archive.read(file) for file in kept}


def test_all_files_of_one_version() -> None:
    expected = {
        *MODEL_FMUS,
        SYSTEM,
        f"{MODEL}.html",
        "manual.html",
        f"{MODEL}-cross-check.zip",
        "RELEASE_NOTES.md",
        "compilers.txt",
    }
    expected |= {SUMS} | {f"{product}{end}" for product in PRODUCTS for end in (".cdx.json", "-third-party.txt")}
    expected |= {path.name for path in (prw_wheel(), *map(wheel, TARGETS))}
    assert {path.name for path in DIST.iterdir()} == expected
    listed = dict(reversed(line.split("  ")) for line in (DIST / SUMS).read_text().splitlines())
    assert listed == {name: hashlib.sha256((DIST / name).read_bytes()).hexdigest() for name in expected - {SUMS}}
    version = cargo_version()
    assert (DIST / "RELEASE_NOTES.md").read_text("utf-8") == release_notes(CHANGELOG.read_text("utf-8"), version)
    for path in DIST.glob("*.whl"):
        assert path.name.split("-")[1] == version
    for name in MODEL_FMUS:
        assert f'version="{version}"'.encode() in files_except_binaries(name)["modelDescription.xml"], name
    compilers = (DIST / "compilers.txt").read_text(encoding="utf-8")
    assert [line.split(": ")[0] for line in compilers.splitlines()] == ["rustc", "python-zig", "wasm2c"]
    assert compilers.startswith(f"rustc: rustc {RUST['channel']} ")


@pytest.mark.parametrize("name", MODEL_FMUS)
def test_fmus(name: str) -> None:
    fmu, directories = DIST / name, MODEL_FMUS[name]
    model = CONTROLLER if name.startswith(CONTROLLER) else MODEL
    assert validate_fmu(str(fmu)) == []
    assert fmpy.read_model_description(str(fmu), validate=True).fmiVersion == ("3.0" if "fmi3" in name else "2.0")
    assert fmu.stat().st_size < 2_000_000
    libraries = {f"binaries/{directory}/{model}{targets[0].suffix}" for directory, targets in directories.items()}
    assert {file for file in names(fmu) if file.startswith("binaries/")} == libraries


@pytest.mark.parametrize("directories", [DIRECTORIES, FMI3_DIRECTORIES])
def test_every_target_is_in_the_fmus(directories: dict[str, tuple[Target, ...]]) -> None:
    assert {target for targets in directories.values() for target in targets} == set(TARGETS)


@pytest.mark.parametrize("model", MODELS)
def test_fmus_for_fmi_3_have_the_same_libraries_and_documents(model: str) -> None:
    three, two = binaries(DIST / f"{model}-fmi3.fmu"), binaries(DIST / f"{model}.fmu")
    in_fmi2 = {targets: directory for directory, targets in DIRECTORIES.items()}
    for directory, targets in FMI3_DIRECTORIES.items():
        if directory == "x86_64-darwin":
            # This library is the Intel half of the universal library.
            assert three[directory] in two["darwin64"]
        else:
            assert three[directory] == two[in_fmi2[targets]], directory
    documents3, documents2 = files_except_binaries(f"{model}-fmi3.fmu"), files_except_binaries(f"{model}.fmu")
    assert documents3["terminalsAndIcons/icon.png"] == documents2["model.png"]
    for name in {*documents2, *documents3}:
        assert not name.startswith("documentation/") or documents2[name] == documents3[name]


def test_the_variants_of_the_fmu() -> None:
    """One variant is for importers on ARM that look for the library in linux64. Another one contains C sources, which
    tests/source_fmu compiles."""
    fmu = DIST / f"{MODEL}.fmu"
    assert binaries(DIST / ARM)["linux64"] == binaries(fmu)["aarch64-linux"]
    assert files_except_binaries(ARM) == files_except_binaries(fmu.name)
    source = files_except_binaries(SOURCE)
    for name, content in files_except_binaries(fmu.name).items():
        # The page contains the model description, which lists the source files.
        assert name in ("modelDescription.xml", "documentation/index.html") or source[name] == content, name
    sources = {f"sources/{MODEL}{end}" for end in (".c", "_fmi2.c", ".h", "_runtime.h")}
    assert names(DIST / SOURCE) - names(fmu) == sources
    assert (DIST / SOURCE).read_bytes() == (ROOT / "target" / "fmu" / "source" / f"{MODEL}.fmu").read_bytes()


def test_the_page_and_the_fmus_in_other_files() -> None:
    page = (DIST / f"{MODEL}.html").read_text(encoding="utf-8")
    assert "\nlive([\n{ description: " in script_of(page)
    assert files_except_binaries(f"{MODEL}.fmu")["documentation/index.html"].decode() == page
    with zipfile.ZipFile(DIST / SYSTEM) as system:
        fmus = {name: system.read(name) for name in system.namelist() if name.endswith(".fmu")}
    assert fmus == {f"resources/{model}.fmu": (DIST / f"{model}.fmu").read_bytes() for model in MODELS}
    with zipfile.ZipFile(prw_wheel()) as archive:
        assert archive.read(f"prw/fmu/{MODEL}.fmu") == (DIST / f"{MODEL}.fmu").read_bytes()


@pytest.mark.parametrize("product", PRODUCTS)
def test_the_packages_in_the_libraries(product: str) -> None:
    text = (DIST / f"{product}.cdx.json").read_text(encoding="utf-8")
    assert JsonStrictValidator(SchemaVersion.V1_6).validate_str(text) is None
    components = {component["name"]: component.get("version") for component in json.loads(text)["components"]}
    assert {"libc", "std"} <= components.keys()
    notice = (DIST / f"{product}-third-party.txt").read_text(encoding="utf-8")
    listed = dict(re.findall(r"^\* ([\w-]+)(?: ([\w.+-]+))?:", notice, re.MULTILINE))
    assert listed == {name: version or "" for name, version in components.items()}
    if product in MODELS:
        # These packages are used to pack FMUs, so they must not be in the libraries.
        assert not {"clap", "zip", "serde_json", "anyhow"} & components.keys()
        stated = files_except_binaries(f"{product}.fmu")["documentation/licenses/license.txt"].decode()
        assert components.keys() == set(re.findall(r"^  \* ([\w-]+)", stated, re.MULTILINE))


@pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.triple)
def test_wheels(target: Target) -> None:
    tags = parse_wheel_filename(wheel(target).name)[3]
    assert {(tag.interpreter, tag.abi) for tag in tags} == {("cp311", "abi3")}
    archive = zipfile.ZipFile(wheel(target))
    (info,) = {name.split("/")[0] for name in names(wheel(target)) if ".dist-info/" in name}
    sources = {f"fmu_run/{path.name}": path for path in (CRATE / "python" / "fmu_run").iterdir() if path.is_file()}
    assert {"fmu_run/py.typed", "fmu_run/_native.pyi", "fmu_run/__init__.py"} <= set(sources)
    licences = {name: CRATE / name for name in ("LICENSE-MIT", "LICENSE-APACHE")}
    licences["LICENSE-third-party.txt"] = DIST / "fmu_run-third-party.txt"
    sources |= {f"{info}/licenses/{name}": path for name, path in licences.items()}
    sources[f"{info}/sboms/fmu_run.cdx.json"] = DIST / "fmu_run.cdx.json"
    made = {"fmu_run/_native.pyd" if target is WINDOWS else "fmu_run/_native.abi3.so"}
    made |= {f"{info}/{name}" for name in ("METADATA", "WHEEL", "RECORD")}
    assert set(archive.namelist()) == set(sources) | made
    for name, path in sources.items():
        assert archive.read(name) == path.read_bytes(), name
    metadata = Parser().parsestr(archive.read(f"{info}/METADATA").decode())
    assert metadata["License-Expression"] == "MIT OR Apache-2.0"
    assert sorted(metadata.get_all("License-File")) == sorted(licences)


def test_registries_take_the_wheels() -> None:
    command = [sys.executable, "-m", "twine", "check", "--strict", *sorted(DIST.glob("*.whl"))]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0 and done.stdout.count("PASSED") == len(TARGETS) + 1, done.stdout + done.stderr
