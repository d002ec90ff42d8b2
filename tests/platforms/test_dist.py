"""What is in dist/ belongs together."""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
import zipfile

import fmpy
import pytest
from conftest import DIST, FMI3, ROOT
from cyclonedx.schema import SchemaVersion
from cyclonedx.validation.json import JsonStrictValidator
from fmpy.validation import validate_fmu
from targets import FMI3_FOLDERS, FOLDERS, MODEL, TARGETS

BILL = "bill-of-materials.cdx.json"
ARM = f"{MODEL}-linux-arm64.fmu"


def names(fmu) -> set[str]:
    with zipfile.ZipFile(fmu) as archive:
        assert archive.testzip() is None
        return set(archive.namelist())


def test_the_sums_are_right():
    listed = dict(reversed(line.split("  ")) for line in (DIST / "SHA256SUMS").read_text().splitlines())
    assert {f"{MODEL}.fmu", ARM, FMI3, BILL} <= set(listed)
    for name, digest in listed.items():
        assert hashlib.sha256((DIST / name).read_bytes()).hexdigest() == digest, name


def test_one_fmu_for_all(fmu):
    assert fmu.stat().st_size < 2_000_000
    suffixes = {folder: targets[0].suffix for folder, targets in FOLDERS.items()}
    libraries = {f"binaries/{folder}/{MODEL}{suffix}" for folder, suffix in suffixes.items()}
    assert {name for name in names(fmu) if name.startswith("binaries/")} == libraries
    # FMPy knows none of the ARM folders in FMI 2.0.
    assert set(fmpy.supported_platforms(str(fmu))) == {"linux64", "win64", "darwin64"}


def test_the_other_for_importers_on_arm(fmu):
    arm, both = zipfile.ZipFile(DIST / ARM), zipfile.ZipFile(fmu)
    (name,) = [name for name in names(DIST / ARM) if name.startswith("binaries/")]
    assert name == f"binaries/linux64/{MODEL}.so"
    assert arm.read(name) == both.read(f"binaries/aarch64-linux/{MODEL}.so")
    others = {name for name in arm.namelist() if not name.startswith("binaries/")}
    assert others == {name for name in both.namelist() if not name.startswith("binaries/")}
    assert all(arm.read(name) == both.read(name) for name in others)


def test_one_fmu_of_fmi_3_for_all(fmu):
    """The same libraries and documentation, under the names of FMI 3.0; of macOS each processor has its own."""
    three, two = zipfile.ZipFile(DIST / FMI3), zipfile.ZipFile(fmu)
    binaries = {name for name in names(DIST / FMI3) if name.startswith("binaries/")}
    assert binaries == {f"binaries/{folder}/{MODEL}{targets[0].suffix}" for folder, targets in FMI3_FOLDERS.items()}
    assert {target for targets in FMI3_FOLDERS.values() for target in targets} == set(TARGETS)
    in_fmi2 = {targets: folder for folder, targets in FOLDERS.items()}
    same = {folder: in_fmi2[targets] for folder, targets in FMI3_FOLDERS.items() if targets in in_fmi2}
    assert set(FMI3_FOLDERS) - set(same) == {"x86_64-darwin"}
    for folder, other in same.items():
        library = f"{MODEL}{FMI3_FOLDERS[folder][0].suffix}"
        assert three.read(f"binaries/{folder}/{library}") == two.read(f"binaries/{other}/{library}"), folder
    # The Intel half of the universal library.
    assert three.read(f"binaries/x86_64-darwin/{MODEL}.dylib") in two.read(f"binaries/darwin64/{MODEL}.dylib")
    assert three.read("terminalsAndIcons/icon.png") == two.read("model.png")
    documents = {name for name in two.namelist() if name.startswith("documentation/")}
    assert documents == {name for name in three.namelist() if name.startswith("documentation/")}
    assert all(two.read(name) == three.read(name) for name in documents)
    assert fmpy.read_model_description(str(DIST / FMI3), validate=True).fmiVersion == "3.0"


@pytest.mark.parametrize("name", [f"{MODEL}.fmu", ARM, FMI3])
def test_nothing_to_complain(name):
    assert validate_fmu(str(DIST / name)) == []


def test_the_bill_of_materials(fmu):
    text = (DIST / BILL).read_text(encoding="utf-8")
    assert JsonStrictValidator(SchemaVersion.V1_6).validate_str(text) is None
    assert zipfile.ZipFile(fmu).read(f"documentation/licenses/{BILL}").decode() == text
    components = {component["name"]: component for component in json.loads(text)["components"]}
    assert {"nalgebra", "libc", "fmu-export", "std"} <= set(components)
    # What only packs the FMU is not in it.
    assert not {"clap", "zip", "serde_json", "anyhow"} & set(components)


def test_the_bill_of_materials_is_up_to_date():
    process = subprocess.run(
        [sys.executable, ROOT / "platforms" / "bill_of_materials.py", "--check"], capture_output=True, text=True
    )
    assert process.returncode == 0, process.stderr
