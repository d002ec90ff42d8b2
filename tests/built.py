"""Paths of the project and of the files that `make` has built, the programs that build FMUs, and a check for installed packages."""

from __future__ import annotations

import base64
import importlib.util
import os
import re
import zipfile
import zlib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
#: `make check` tests the FMUs in another directory.
FMUS = Path(os.environ.get("FMUS", ROOT / "target" / "fmu"))
#: The call with which a page decompresses and runs its script.
SCRIPT = re.compile(r'\nbegin\("([^"]*)"\)\.catch\(showFailure\);\n')

#: The parts of a page that run the FMU: the content security policy, the element in which the FMU is drawn (with a note for browsers
#: without scripts), the styles and the scripts.
LIVE = re.compile(
    r'<meta http-equiv="Content-Security-Policy"[^>]*>\n|<div id="live".*?</noscript></div>|<style>\n\.live,.*</script>\n?',
    re.S,
)


def built(name: str, target: str = "closed-loop-fmus") -> Path:
    """Returns the path of a file in target/fmu. If it is missing, exits and names the make target that builds it."""
    path = FMUS / name
    if not path.exists():
        pytest.exit(f"{path} is missing; build it with `make {target}`", returncode=1)
    return path


def program(name: str, package: str = "build_fmu") -> list[str]:
    """Returns the command of a program that builds FMUs. `make test` names the directory of compiled programs in PROGRAMS."""
    if directory := os.environ.get("PROGRAMS"):
        return [str(ROOT / directory / name)]
    return ["cargo", "run", "--quiet", "--locked", "--release", "--package", package, "--bin", name, "--"]


def pages_of(fmu: Path) -> dict[str, str]:
    """Returns the pages in an FMU by name, without the parts that run the FMU."""
    with zipfile.ZipFile(fmu) as archive:
        names = [name for name in ("index.html", "manual.html") if f"documentation/{name}" in archive.namelist()]
        return {name: LIVE.sub("", archive.read(f"documentation/{name}").decode()) for name in names}


def text_of(fmu: Path) -> str:
    """Returns the pages in an FMU one after the other, without the parts that run the FMU."""
    return "".join(pages_of(fmu).values())


def needed(module: str, package: str) -> None:
    """Skips the tests of a file if the package is not installed."""
    if importlib.util.find_spec(module) is None:
        pytest.skip(f"{package} is not installed; `make test-importers` installs it", allow_module_level=True)


def script_of(page: str) -> str:
    """Returns the decompressed script of the page in an FMU."""
    (packed,) = SCRIPT.findall(page)
    return zlib.decompress(base64.b64decode(packed), wbits=-15).decode()
