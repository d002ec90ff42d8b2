"""Lists the packages that are compiled into the libraries of the FMUs and of fmu-run for Python, with versions and licences.

    python dev/platforms/bill_of_materials.py            updates the lists
    python dev/platforms/bill_of_materials.py --check    fails if they are out of date

The FMUs contain the lists in modelDescription/licenses/, the wheels the lists in crates/fmu-run/python/: third-party.txt for
people and bill-of-materials.cdx.json (CycloneDX 1.6) for tools.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tomllib
import uuid
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from targets import CONTROLLER, MODEL, ROOT, TARGETS


@dataclass(frozen=True)
class Product:
    """An FMU or a Python package, the Rust package of its libraries, and the directory of its lists."""

    kind: str
    name: str
    package: str
    directory: Path

    @property
    def bill(self) -> Path:
        """The list for tools."""
        return self.directory / "bill-of-materials.cdx.json"

    @property
    def notice(self) -> Path:
        """The list for people."""
        return self.directory / "third-party.txt"


LICENCES = Path("modelDescription", "licenses")
FMU = Product("FMU", MODEL, MODEL, ROOT / LICENCES)
CONTROLLER_FMU = Product("FMU", CONTROLLER, CONTROLLER, ROOT / "examples" / "controller" / LICENCES)
WHEEL = Product("package", "fmu_run", "fmu-run-python", ROOT / "crates" / "fmu-run" / "python")
PRODUCTS = (FMU, CONTROLLER_FMU, WHEEL)

#: Compiled-in code without a package in Cargo.lock: name, licence, copyright, and the libraries that contain it.
NO_CRATES = (
    ("std", "MIT OR Apache-2.0", "The Rust Project Developers", "all, the Rust standard library"),
    ("libunwind", "Apache-2.0 WITH LLVM-exception", "The LLVM Project contributors", "Linux and Windows, from zig"),
    ("mingw-w64", "ZPL-2.1", "The mingw-w64 project", "Windows, start-up code, from zig"),
)

#: A line of a licence file that names a copyright holder.
HOLDER = re.compile(r"\s*Copyright\s+(?:\(c\)\s+|©\s+)?(?=[\dA-Z])(.+?)(?: or)?[.,]?\s*(?:\[.*\])?$")

HEADER = """\
Compiled into the libraries of this {kind}. Where a package offers a choice of licences, the choice is shown.
Packages are used under the Apache License, Version 2.0 (LICENSE-APACHE), if they are available under it; the licences
of the others are at the end.
Each is a published Rust crate of that name and version. For tools: bill-of-materials.cdx.json.

"""

FOOTER = """
The file COPYRIGHT-library.html of every Rust distribution lists the third-party parts of the Rust standard library.
"""


@cache
def packages(product: Product) -> list[dict[str, Any]]:
    """Returns cargo's metadata of the packages that are compiled into a library for any target."""
    names: set[tuple[str, ...]] = set()
    for target in TARGETS:
        # Build scripts and procedural macros run, but are not compiled in.
        command = ["cargo", "tree", "--locked", "--no-default-features", "--package", product.package]
        command += ["--target", target.triple, "--edges", "normal,no-proc-macro", "--prefix", "none", "--format", "{p}"]
        names.update(tuple(line.split()[:2]) for line in _cargo(command).splitlines() if line)
    metadata = json.loads(_cargo(["cargo", "metadata", "--locked", "--format-version", "1"]))
    found = [p for p in metadata["packages"] if (p["name"], f"v{p['version']}") in names]
    return sorted(found, key=lambda package: (package["name"], package["version"]))


def _cargo(command: list[str]) -> str:
    process = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, encoding="utf-8")
    if process.returncode:
        raise SystemExit(f"error: {' '.join(command)}: {process.stderr.strip()}")
    return process.stdout


def copyright_of(package: dict[str, Any]) -> str:
    """Returns the copyright holders in the package's licence files, or its authors if there are none."""
    lines: dict[str, None] = {}
    for path in sorted(Path(package["manifest_path"]).parent.iterdir()):
        if re.match(r"(licen[cs]e|copyright)", path.name, re.IGNORECASE) and path.is_file():
            named = map(HOLDER.match, path.read_text(encoding="utf-8", errors="replace").splitlines())
            holders = (match[1] for match in named if match)
            lines |= dict.fromkeys(h for h in holders if "owner" not in h and not re.fullmatch(r"[\d\s-]+", h))
    authors = [re.sub(r"\s*<.*>", "", author) for author in package["authors"]]
    return "; ".join(lines or authors) or "its authors"


def licence_of(package: dict[str, Any]) -> str:
    """Returns the licence as an SPDX expression."""
    return str(package["license"]).replace("/", " OR ")


def bill(product: Product) -> str:
    """Returns the list for tools."""
    locked = tomllib.loads((ROOT / "Cargo.lock").read_text(encoding="utf-8"))["package"]
    sums = {(package["name"], package["version"]): package.get("checksum") for package in locked}
    components = {}
    for package in packages(product):
        name, version = package["name"], package["version"]
        purl = f"pkg:cargo/{name}@{version}"
        component = {"type": "library", "bom-ref": purl, "name": name, "version": version}
        component["licenses"] = [{"expression": licence_of(package)}]
        if package["source"]:
            component |= {"copyright": copyright_of(package), "purl": purl}
            component["hashes"] = [{"alg": "SHA-256", "content": sums[name, version]}]
        components[name, version] = component
    (main,) = (key for key in components if key[0] == product.package)
    metadata = {"component": components.pop(main)}
    every = list(components.values())
    for name, licence, holder, location in NO_CRATES:
        component = {"type": "library", "bom-ref": name, "name": name, "description": location}
        every.append(component | {"licenses": [{"expression": licence}], "copyright": holder})
    content = {"metadata": metadata, "components": every}
    # The serial number is a hash of the content, so equal content has an equal serial number.
    serial = uuid.uuid5(uuid.NAMESPACE_URL, json.dumps(content, sort_keys=True))
    head = {"bomFormat": "CycloneDX", "specVersion": "1.6", "serialNumber": f"urn:uuid:{serial}", "version": 1}
    return json.dumps({**head, **content}, indent=2, ensure_ascii=False) + "\n"


def notice(product: Product) -> str:
    """Returns the list for people, with the licence files of packages that are not available under the Apache License."""
    rows, licences = [("package", "version", "licence", "copyright")], []
    for package in packages(product):
        if package["source"]:
            name, version, licence = package["name"], package["version"], licence_of(package)
            rows.append((name, version, licence, copyright_of(package)))
            if "Apache-2.0" not in licence:
                paths = sorted(Path(package["manifest_path"]).parent.glob("LICEN[CS]E*"))
                licences += [f"\n\n==== {name} {version} ====\n\n{path.read_text(encoding='utf-8')}" for path in paths]
    others = [("no packages", "licence", "copyright", "in the libraries for"), *NO_CRATES]
    return "".join([HEADER.format(kind=product.kind), _table(rows), "\n", _table(others), FOOTER, *licences])


def _table(rows: Sequence[tuple[str, ...]]) -> str:
    widths = [max(map(len, column)) for column in zip(*rows)]
    lines = ("  ".join(cell.ljust(width) for cell, width in zip(row, widths)) for row in rows)
    return "".join(f"{line.rstrip()}\n" for line in lines)


def check(write: bool = False) -> None:
    """Exits with an error if a list is out of date; with `write`, writes the list instead."""
    for product in PRODUCTS:
        for path, content in ((product.bill, bill(product)), (product.notice, notice(product))):
            if path.is_file() and path.read_text("utf-8") == content:
                continue
            name = path.relative_to(ROOT).as_posix()
            if not write:
                raise SystemExit(f"error: {name} is out of date; run python3 dev/platforms/bill_of_materials.py")
            path.write_bytes(content.encode())
            print(f"{name} written")


if __name__ == "__main__":
    if sys.argv[1:] not in ([], ["--check"]):
        raise SystemExit(__doc__)
    check(write=not sys.argv[1:])
