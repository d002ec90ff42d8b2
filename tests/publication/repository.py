"""The files that git tracks, and facts about them that several tests need."""

from __future__ import annotations

import re
import subprocess
import tomllib
from typing import Any

from built import ROOT

LISTED = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
FILES = [name for name in LISTED.split("\0") if (ROOT / name).is_file()]
PAGES = [name for name in FILES if name.endswith((".md", ".cff"))]


def text(name: str) -> str:
    """Returns the content of a file."""
    return str((ROOT / name).read_text(encoding="utf-8"))


def texts(paths: str) -> str:
    """Returns the contents of all files whose paths match a regular expression."""
    return "\n".join(text(name) for name in FILES if re.fullmatch(paths, name))


def in_one_line(name: str) -> str:
    """Returns the content of a page without line ends."""
    return " ".join(text(name).split())


def manifest(name: str) -> dict[str, Any]:
    """Returns the content of a TOML file."""
    return tomllib.loads(text(name))


WORKSPACE = manifest("Cargo.toml")["workspace"]
VERSION: str = WORKSPACE["package"]["version"]
#: The manifest of each package of the workspace.
PACKAGES = {
    content["package"]["name"]: content
    for path in ("Cargo.toml", *(f"{member}/Cargo.toml" for member in WORKSPACE["members"]))
    if (content := manifest(path))
}
#: The targets of the Makefile, each with the targets that it needs.
TARGETS = dict(re.findall(r"^([\w-]+):(?!=)(.*)$", text("Makefile"), re.MULTILINE))
#: Whether the newest section of the changelog has the date of a release.
RELEASED = re.search(r"^## [\d.]+ \(\d", text("CHANGELOG.md"), re.MULTILINE) is not None
