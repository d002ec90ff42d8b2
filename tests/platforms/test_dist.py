"""What is in dist/ belongs together."""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
import zipfile

import fmpy
import pytest
from bill_of_materials import CONTROLLER_FMU, FMU, PRODUCTS
from conftest import DIST, FMI3, ROOT, prw_wheel, wheel
from cyclonedx.schema import SchemaVersion
from cyclonedx.validation.json import JsonStrictValidator
from fmpy.validation import validate_fmu
from release import SUMS
from release_notes import CHANGELOG, notes, version
from targets import CONTROLLER, FMI3_FOLDERS, FOLDERS, MODEL, MODELS, TARGETS, WEBASSEMBLY

ARM = f"{MODEL}-linux-arm64.fmu"
SOURCE = f"{MODEL}-source.fmu"
MODEL_FMUS = [f"{MODEL}.fmu", ARM, FMI3, SOURCE, f"{CONTROLLER}.fmu", f"{CONTROLLER}-fmi3.fmu"]
SYSTEM = "prw_closed_loop.ssp"


def names(fmu) -> set[str]:
    with zipfile.ZipFile(fmu) as archive:
        assert archive.testzip() is None
        return set(archive.namelist())


def test_all_of_it_and_no_more():
    expected = {
        *MODEL_FMUS,
        SYSTEM,
        f"{MODEL}.html",
        f"{MODEL}-cross-check.zip",
        "RELEASE_NOTES.md",
        "compilers.txt",
        SUMS,
    }
    expected |= {f"{product.name}.cdx.json" for product in PRODUCTS}
    expected |= {path.name for path in (prw_wheel(), *map(wheel, TARGETS))}
    assert {path.name for path in DIST.iterdir()} == expected


def test_the_sums_are_right():
    listed = dict(reversed(line.split("  ")) for line in (DIST / SUMS).read_text().splitlines())
    files = [path for path in DIST.iterdir() if path.name != SUMS]
    assert listed == {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def test_it_is_one_version():
    assert (DIST / "RELEASE_NOTES.md").read_text(encoding="utf-8") == notes(CHANGELOG.read_text("utf-8"), version())
    for path in DIST.glob("*.whl"):
        assert path.name.split("-")[1] == version()
    for name in MODEL_FMUS:
        with zipfile.ZipFile(DIST / name) as archive:
            assert f'version="{version()}"'.encode() in archive.read("modelDescription.xml"), name


def test_the_page_runs_the_fmu():
    page = (DIST / f"{MODEL}.html").read_bytes()
    assert b".catch(withoutIt);" in page
    for name in (f"{MODEL}.fmu", ARM, FMI3):
        with zipfile.ZipFile(DIST / name) as archive:
            assert archive.read("documentation/index.html") == page, name


def test_each_compiler_is_named():
    lines = (DIST / "compilers.txt").read_text(encoding="utf-8").splitlines()
    assert all(": rustc 1." in line for line in lines)
    assert sorted(line.split(":")[0] for line in lines) == sorted(target.triple for target in (*TARGETS, WEBASSEMBLY))
    assert ", wasm2c 1." in lines[-1]


@pytest.mark.parametrize("model", MODELS)
def test_one_fmu_for_all(model):
    fmu = DIST / f"{model}.fmu"
    assert fmu.stat().st_size < 2_000_000
    suffixes = {folder: targets[0].suffix for folder, targets in FOLDERS.items()}
    libraries = {f"binaries/{folder}/{model}{suffix}" for folder, suffix in suffixes.items()}
    assert {name for name in names(fmu) if name.startswith("binaries/")} == libraries
    # FMPy knows none of the ARM folders in FMI 2.0.
    assert set(fmpy.supported_platforms(str(fmu))) == {"linux64", "win64", "darwin64"}


def test_the_system_has_these_fmus():
    with zipfile.ZipFile(DIST / SYSTEM) as system:
        assert {name for name in system.namelist() if name.endswith(".fmu")} == {f"resources/{m}.fmu" for m in MODELS}
        for model in MODELS:
            assert system.read(f"resources/{model}.fmu") == (DIST / f"{model}.fmu").read_bytes()


def test_c_sources(fmu):
    """In the place of the libraries; the same as those of `make source-fmu`, which tests/source_fmu compiles."""
    source, both = names(DIST / SOURCE), names(fmu)
    assert {name for name in source if name.startswith("sources/")} == {
        f"sources/{MODEL}{end}" for end in (".c", "_fmi2.c", ".h", "_runtime.h")
    }
    assert all(name.startswith("sources/") for name in source - both)
    assert all(name.startswith("binaries/") for name in both - source)
    assert (DIST / SOURCE).read_bytes() == (ROOT / "target" / "fmu" / "source" / f"{MODEL}.fmu").read_bytes()


def test_the_other_for_importers_on_arm(fmu):
    arm, both = zipfile.ZipFile(DIST / ARM), zipfile.ZipFile(fmu)
    (name,) = [name for name in names(DIST / ARM) if name.startswith("binaries/")]
    assert name == f"binaries/linux64/{MODEL}.so"
    assert arm.read(name) == both.read(f"binaries/aarch64-linux/{MODEL}.so")
    others = {name for name in arm.namelist() if not name.startswith("binaries/")}
    assert others == {name for name in both.namelist() if not name.startswith("binaries/")}
    assert all(arm.read(name) == both.read(name) for name in others)


@pytest.mark.parametrize("model", MODELS)
def test_one_fmu_of_fmi_3_for_all(model):
    """The same libraries and documentation, under the names of FMI 3.0; of macOS each processor has its own."""
    path = DIST / f"{model}-fmi3.fmu"
    three, two = zipfile.ZipFile(path), zipfile.ZipFile(DIST / f"{model}.fmu")
    binaries = {name for name in names(path) if name.startswith("binaries/")}
    assert binaries == {f"binaries/{folder}/{model}{targets[0].suffix}" for folder, targets in FMI3_FOLDERS.items()}
    assert {target for targets in FMI3_FOLDERS.values() for target in targets} == set(TARGETS)
    in_fmi2 = {targets: folder for folder, targets in FOLDERS.items()}
    same = {folder: in_fmi2[targets] for folder, targets in FMI3_FOLDERS.items() if targets in in_fmi2}
    assert set(FMI3_FOLDERS) - set(same) == {"x86_64-darwin"}
    for folder, other in same.items():
        library = f"{model}{FMI3_FOLDERS[folder][0].suffix}"
        assert three.read(f"binaries/{folder}/{library}") == two.read(f"binaries/{other}/{library}"), folder
    # The Intel half of the universal library.
    assert three.read(f"binaries/x86_64-darwin/{model}.dylib") in two.read(f"binaries/darwin64/{model}.dylib")
    assert three.read("terminalsAndIcons/icon.png") == two.read("model.png")
    documents = {name for name in two.namelist() if name.startswith("documentation/")}
    assert documents == {name for name in three.namelist() if name.startswith("documentation/")}
    assert all(two.read(name) == three.read(name) for name in documents)
    assert fmpy.read_model_description(str(path), validate=True).fmiVersion == "3.0"


@pytest.mark.parametrize("name", MODEL_FMUS)
def test_nothing_to_complain(name):
    assert validate_fmu(str(DIST / name)) == []


@pytest.mark.parametrize("product", PRODUCTS, ids=lambda product: product.name)
def test_the_bills_of_materials(product):
    text = (DIST / f"{product.name}.cdx.json").read_text(encoding="utf-8")
    assert JsonStrictValidator(SchemaVersion.V1_6).validate_str(text) is None
    components = {component["name"]: component for component in json.loads(text)["components"]}
    assert {"libc", "std"} <= set(components)
    # What only packs FMUs is not in it.
    assert not {"clap", "zip", "serde_json", "anyhow"} & set(components) or product not in (FMU, CONTROLLER_FMU)
    if product in (FMU, CONTROLLER_FMU):
        archive = zipfile.ZipFile(DIST / f"{product.name}.fmu")
        assert archive.read(f"documentation/licenses/{product.bill.name}").decode() == text


def test_the_bill_of_materials_is_up_to_date():
    process = subprocess.run(
        [sys.executable, ROOT / "platforms" / "bill_of_materials.py", "--check"], capture_output=True, text=True
    )
    assert process.returncode == 0, process.stderr
