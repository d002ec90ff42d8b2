"""Lists the packages that are compiled into the libraries of a release, with versions and licences: third-party licences for people,
and a bill of materials (CycloneDX 1.6) for tools.

cargo-cyclonedx writes paths of this machine into its bills and lists packages that are not compiled in. cargo-about replaces the
copyright notices of libm by a template.
"""

from __future__ import annotations

import json
import re
import uuid
from functools import cache
from pathlib import Path
from typing import Any

from libraries import run
from targets import CONTROLLER, MODEL, TARGETS

#: The FMUs and the Python package of a release, each with the Rust package of its libraries.
PRODUCTS = {MODEL: MODEL, CONTROLLER: CONTROLLER, "fmu_run": "fmu-run-python"}
#: Compiled-in code that is not a package of cargo: name, licence, copyright, and the libraries that contain it.
NO_CRATES = (
    ("std", "MIT OR Apache-2.0", "The Rust Project Developers", "all, the Rust standard library"),
    ("libunwind", "Apache-2.0 WITH LLVM-exception", "The LLVM Project contributors", "Linux and Windows, from zig"),
    ("mingw-w64", "ZPL-2.1", "The mingw-w64 project", "Windows, start-up code, from zig"),
)
LICENCE_FILE = re.compile(r"licen[cs]e|copyright|notice|unlicen[cs]e", re.IGNORECASE)


def write(out: Path, version: str) -> None:
    """Writes both lists of each product of this version."""
    for name, package in PRODUCTS.items():
        (out / f"{name}.cdx.json").write_text(bill(name, package, version), encoding="utf-8")
        (out / f"{name}-third-party.txt").write_text(notice(package), encoding="utf-8")


@cache
def packages(package: str) -> list[dict[str, Any]]:
    """Returns cargo's metadata of the packages of others that are compiled into a library for any target."""
    names: set[tuple[str, ...]] = set()
    for target in TARGETS:
        # Build scripts and procedural macros run, but are not compiled in.
        command = ["cargo", "tree", "--locked", "--no-default-features", "--package", package]
        command += ["--target", target.triple, "--edges", "normal,no-proc-macro", "--prefix", "none", "--format", "{p}"]
        names.update(tuple(line.split()[:2]) for line in run(*command).splitlines() if line)
    metadata = json.loads(run("cargo", "metadata", "--locked", "--format-version", "1"))
    found = [p for p in metadata["packages"] if p["source"] and (p["name"], f"v{p['version']}") in names]
    return sorted(found, key=lambda package: (package["name"], package["version"]))


def licence_of(package: dict[str, Any]) -> str:
    """Returns the licence as an SPDX expression."""
    return str(package["license"]).replace("/", " OR ")


def bill(name: str, package: str, version: str) -> str:
    """Returns the list for tools."""
    components: list[dict[str, Any]] = []
    for found in packages(package):
        purl = f"pkg:cargo/{found['name']}@{found['version']}"
        component = {"type": "library", "bom-ref": purl, "name": found["name"], "version": found["version"]}
        components.append(component | {"purl": purl, "licenses": [{"expression": licence_of(found)}]})
    for other, licence, holder, location in NO_CRATES:
        component = {"type": "library", "bom-ref": other, "name": other, "description": location}
        components.append(component | {"licenses": [{"expression": licence}], "copyright": holder})
    content = {
        "metadata": {"component": {"type": "library", "name": name, "version": version}},
        "components": components,
    }
    # The serial number is a hash of the content, so equal content has an equal serial number.
    serial = uuid.uuid5(uuid.NAMESPACE_URL, json.dumps(content, sort_keys=True))
    head = {"bomFormat": "CycloneDX", "specVersion": "1.6", "serialNumber": f"urn:uuid:{serial}", "version": 1}
    return json.dumps({**head, **content}, indent=2, ensure_ascii=False) + "\n"


def notice(package: str) -> str:
    """Returns the list for people: the packages, and then the text of each licence file with the packages that contain it."""
    lines = ["Compiled into the libraries, with licences and copyright notices:\n"]
    texts: dict[str, dict[str, None]] = {}
    for found in packages(package):
        title = f"{found['name']} {found['version']}"
        lines.append(f"* {title}: {licence_of(found)}")
        for path in sorted(Path(found["manifest_path"]).parent.iterdir()):
            if LICENCE_FILE.match(path.name) and path.is_file():
                texts.setdefault(path.read_text(encoding="utf-8").strip(), {})[title] = None
    lines += [f"* {name}: {licence}, {holder}; {where}" for name, licence, holder, where in NO_CRATES]
    lines.append(
        "\nThe file COPYRIGHT-library.html of every Rust distribution lists the third-party parts of the Rust standard library."
    )
    lines += [f"\n\n==== {', '.join(titles)} ====\n\n{text}" for text, titles in texts.items()]
    return "\n".join(lines) + "\n"
