"""Lists what is compiled into the libraries of the FMUs and of fmu-run for Python, with versions and licences.

    python platforms/bill_of_materials.py            writes the lists anew
    python platforms/bill_of_materials.py --check    fails if they are out of date

Those in folders modelDescription/licenses/ go into the FMUs, those in crates/fmu-run/python/ into the wheels:
third-party.txt for people and bill-of-materials.cdx.json (CycloneDX 1.6) for tools. Needs cargo and nothing else.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import uuid
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from targets import CONTROLLER, MODEL, ROOT, TARGETS


@dataclass(frozen=True)
class Product:
    """What the libraries go into, the package that they are compiled from, and where the lists are kept."""

    kind: str
    name: str
    package: str
    folder: Path

    @property
    def bill(self) -> Path:
        """The list for tools."""
        return self.folder / "bill-of-materials.cdx.json"

    @property
    def notice(self) -> Path:
        """The list for people."""
        return self.folder / "third-party.txt"


LICENCES = Path("modelDescription", "licenses")
FMU = Product("FMU", MODEL, MODEL, ROOT / LICENCES)
CONTROLLER_FMU = Product("FMU", CONTROLLER, CONTROLLER, ROOT / "crates" / "prw-controller" / LICENCES)
WHEEL = Product("package", "fmu_run", "fmu-run-python", ROOT / "crates" / "fmu-run" / "python")
PRODUCTS = (FMU, CONTROLLER_FMU, WHEEL)

#: Compiled in, but no packages of Cargo.lock: name, licence, copyright, where it is.
BESIDE_CRATES = (
    ("std", "MIT OR Apache-2.0", "The Rust Project Developers", "all, the Rust standard library"),
    ("libunwind", "Apache-2.0 WITH LLVM-exception", "The LLVM Project contributors", "Linux, from zig"),
    ("libgcc", "GPL-3.0-or-later WITH GCC-exception-3.1", "Free Software Foundation", "Windows, from MinGW"),
    ("mingw-w64", "ZPL-2.1", "The mingw-w64 project", "Windows, start-up code"),
)

#: A line of a licence file that names one.
HOLDER = re.compile(r"\s*Copyright\s+(?:\(c\)\s+|©\s+)?(?=[\dA-Z])(.+?)(?: or)?[.,]?\s*(?:\[.*\])?$")

HEADER = """\
Compiled into the libraries of this {kind}. Where a package offers a choice of licences, the choice is shown.
Packages are used under the Apache License, Version 2.0 (LICENSE-APACHE), if they are available under it; the licences
of the others are at the end.
Each is a published Rust crate of that name and version. For tools: bill-of-materials.cdx.json.

"""

FOOTER = """
What the Rust standard library contains of others is listed in the file COPYRIGHT-library.html of every Rust
distribution. libgcc is linked under the GCC Runtime Library Exception, which asks nothing of this {kind}.
"""


@cache
def packages(product: Product) -> list[dict[str, Any]]:
    """The packages that are compiled into a library for any target, as cargo describes them."""
    names: set[tuple[str, ...]] = set()
    for target in TARGETS:
        # Without build scripts and procedural macros: they run, but nothing of them gets in.
        command = ["cargo", "tree", "--locked", "--no-default-features", "--package", product.package]
        command += ["--target", target.triple, "--edges", "normal,no-proc-macro"]
        lines = _cargo([*command, "--prefix", "none", "--format", "{p}"])
        names.update(tuple(line.split()[:2]) for line in lines.splitlines() if line)
    metadata = json.loads(_cargo(["cargo", "metadata", "--locked", "--format-version", "1"]))
    found = [p for p in metadata["packages"] if (p["name"], f"v{p['version']}") in names]
    return sorted(found, key=lambda package: (package["name"], package["version"]))


def _cargo(command: list[str]) -> str:
    process = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, encoding="utf-8")
    if process.returncode:
        raise SystemExit(f"error: {' '.join(command)}: {process.stderr.strip()}")
    return process.stdout


def copyright_of(package: dict[str, Any]) -> str:
    """The holders named in the package's licence files, else its authors."""
    folder = Path(package["manifest_path"]).parent
    lines = []
    for path in sorted(folder.iterdir()):
        if re.match(r"(licen[cs]e|copyright)", path.name, re.IGNORECASE) and path.is_file():
            for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
                match = HOLDER.match(line)
                if (
                    match
                    and "owner" not in match[1]
                    and match[1] not in lines
                    and not re.fullmatch(r"[\d\s-]+", match[1])
                ):
                    lines.append(match[1])
    authors = [re.sub(r"\s*<.*>", "", author) for author in package["authors"]]
    return "; ".join(lines or authors) or "its authors"


def licence_of(package: dict[str, Any]) -> str:
    """The licence as an SPDX expression."""
    return str(package["license"]).replace("/", " OR ")


def other_licences(product: Product) -> str:
    """The licence files of the packages that are not available under the Apache License."""
    texts = []
    for package in packages(product):
        if package["source"] and "Apache-2.0" not in licence_of(package):
            for path in sorted(Path(package["manifest_path"]).parent.glob("LICEN[CS]E*")):
                heading = f"==== {package['name']} {package['version']} ===="
                texts.append(f"\n\n{heading}\n\n{path.read_text(encoding='utf-8')}")
    return "".join(texts)


def checksums() -> dict[tuple[str, str], str]:
    """The SHA-256 of the packages in Cargo.lock."""
    text = (ROOT / "Cargo.lock").read_text(encoding="utf-8")
    pattern = r'name = "(.+)"\nversion = "(.+)"\nsource = .+\nchecksum = "(.+)"'
    return {(name, version): checksum for name, version, checksum in re.findall(pattern, text)}


def bill(product: Product) -> str:
    """The list for tools."""
    sums = checksums()
    main, components = None, []
    for package in packages(product):
        name, version = package["name"], package["version"]
        component = {
            "type": "library",
            "bom-ref": f"pkg:cargo/{name}@{version}",
            "name": name,
            "version": version,
            "licenses": [{"expression": licence_of(package)}],
        }
        if package["source"]:
            component["copyright"] = copyright_of(package)
            component["purl"] = component["bom-ref"]
            component["hashes"] = [{"alg": "SHA-256", "content": sums[name, version]}]
        if name == product.package:
            main = component
        else:
            components.append(component)
    for name, licence, holder, where in BESIDE_CRATES:
        components.append(
            {
                "type": "library",
                "bom-ref": name,
                "name": name,
                "description": where,
                "licenses": [{"expression": licence}],
                "copyright": holder,
            }
        )
    content = {"metadata": {"component": main}, "components": components}
    # The serial number follows from the content, so that it stays when the content does.
    serial = uuid.uuid5(uuid.NAMESPACE_URL, json.dumps(content, sort_keys=True))
    head = {"bomFormat": "CycloneDX", "specVersion": "1.6", "serialNumber": f"urn:uuid:{serial}", "version": 1}
    return json.dumps({**head, **content}, indent=2, ensure_ascii=False) + "\n"


def notice(product: Product) -> str:
    """The list for people."""
    rows = [("package", "version", "licence", "copyright")]
    for package in packages(product):
        if package["source"]:
            rows.append((package["name"], package["version"], licence_of(package), copyright_of(package)))
    table = [_row(rows, row) for row in rows]
    beside = [("beside packages", "licence", "copyright", "in the libraries for")]
    beside += [(name, licence, holder, where) for name, licence, holder, where in BESIDE_CRATES]
    lists = "".join(table) + "\n" + "".join(_row(beside, row) for row in beside)
    return HEADER.format(kind=product.kind) + lists + FOOTER.format(kind=product.kind) + other_licences(product)


def _row(rows: Sequence[tuple[str, ...]], row: tuple[str, ...]) -> str:
    widths = [max(len(line[column]) for line in rows) for column in range(len(row))]
    return "  ".join(cell.ljust(width) for cell, width in zip(row, widths)).rstrip() + "\n"


def _lists() -> list[tuple[Path, str]]:
    return [(path, text) for p in PRODUCTS for path, text in ((p.bill, bill(p)), (p.notice, notice(p)))]


def check() -> None:
    """Stops if a list is out of date."""
    for path, text in _lists():
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            name = path.relative_to(ROOT).as_posix()
            raise SystemExit(f"error: {name} is out of date; write it anew: python3 platforms/bill_of_materials.py")


def write() -> None:
    """Writes the lists."""
    for path, text in _lists():
        if path.is_file() and path.read_text(encoding="utf-8") == text:
            print(f"{path.relative_to(ROOT)} is up to date")
            continue
        unfinished = path.with_name(f".{path.name}.unfinished")
        unfinished.write_bytes(text.encode())
        os.replace(unfinished, path)
        print(f"{path.relative_to(ROOT)} written")


if __name__ == "__main__":
    if sys.argv[1:] == ["--check"]:
        check()
    elif not sys.argv[1:]:
        write()
    else:
        raise SystemExit(__doc__)
