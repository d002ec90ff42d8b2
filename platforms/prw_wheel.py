"""Makes the wheel of the Python package prw, with the FMU for all platforms inside: one wheel for all."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

from targets import MODEL, ROOT

PACKAGE = ROOT / "python" / "prw"
LICENCES = ("LICENSE-MIT", "LICENSE-APACHE")
#: The scripts that an animation as a page is made of (prw.moving).
PAGES = (
    *(Path("crates/fmu-package/page", name) for name in ("live.css", "player.js", "plot.js")),
    *(Path("docs/fmu-page/wrist", name) for name in ("animation.js", "wrist.js", "wrist.json")),
)
#: The first time that a zip can hold: the same sources give the same bytes.
EPOCH = "315532800"


def check_version(version: str) -> None:
    """Stops if the package is not of this version, that of everything else."""
    own = tomllib.loads((PACKAGE / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    if own != version:
        raise SystemExit(
            f"error: the version in {PACKAGE.relative_to(ROOT).as_posix()}/pyproject.toml is {own}, in Cargo.toml it is {version}"
        )


def build(fmu: Path, out: Path) -> Path:
    """The wheel, in `out`."""
    with tempfile.TemporaryDirectory() as folder:
        copy, made = Path(folder, "sources"), Path(folder, "made")
        inside = copy / "src" / "prw" / "fmu"
        ignored = shutil.ignore_patterns("__pycache__", "*.egg-info", "fmu", "page")
        shutil.copytree(PACKAGE / "src", copy / "src", ignore=ignored)
        inside.mkdir()
        for path in (PACKAGE / "pyproject.toml", PACKAGE / "README.md", *(ROOT / name for name in LICENCES)):
            shutil.copyfile(path, copy / path.name)
        (copy / "src" / "prw" / "page").mkdir()
        for path in PAGES:
            shutil.copyfile(ROOT / path, copy / "src" / "prw" / "page" / path.name)
        shutil.copyfile(fmu, inside / f"{MODEL}.fmu")
        command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", str(made), str(copy)]
        environment = {**os.environ, "SOURCE_DATE_EPOCH": EPOCH}
        # A wheel has the modes of its files.
        for path in copy.rglob("*"):
            path.chmod(0o755 if path.is_dir() else 0o644)
        if subprocess.run(command, env=environment, umask=0o022).returncode:
            raise SystemExit("error: the wheel of prw could not be made; the messages are above")
        (wheel,) = made.iterdir()
        return Path(shutil.copyfile(wheel, out / wheel.name))
