"""Builds the wheel of the Python package prw, which contains the FMU and runs on all platforms."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

from libraries import EPOCH
from targets import MODEL, ROOT

PACKAGE = ROOT / "python" / "prw"
LICENCES = ("LICENSE-MIT", "LICENSE-APACHE")


def check_version(version: str) -> None:
    """Exits if the package does not have this version, the version of Cargo.toml."""
    own = tomllib.loads((PACKAGE / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    if own != version:
        raise SystemExit(
            f"error: the version in {PACKAGE.relative_to(ROOT).as_posix()}/pyproject.toml is {own}, in Cargo.toml it is {version}"
        )


def build(fmu: Path, out: Path) -> Path:
    """Builds the wheel in `out`."""
    with tempfile.TemporaryDirectory() as temporary:
        copy, made = Path(temporary, "python", "prw"), Path(temporary, "made")
        inside = copy / "src" / "prw" / "fmu"
        ignored = shutil.ignore_patterns("__pycache__", "*.egg-info", "fmu", "page")
        shutil.copytree(PACKAGE / "src", copy / "src", ignore=ignored)
        inside.mkdir()
        own = (PACKAGE / name for name in ("pyproject.toml", "setup.py", "README.md"))
        for path in (*own, *(ROOT / name for name in LICENCES)):
            shutil.copyfile(path, copy / path.name)
        # setup.py copies the files of the page from these directories.
        for name in ("crates", "docs"):
            Path(temporary, name).symlink_to(ROOT / name)
        shutil.copyfile(fmu, inside / f"{MODEL}.fmu")
        # The installed setuptools builds the wheel; pip would otherwise download one without comparing its hash.
        command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation"]
        command += ["--wheel-dir", str(made), str(copy)]
        environment = {**os.environ, "SOURCE_DATE_EPOCH": EPOCH}
        # The wheel stores the file modes.
        for path in copy.rglob("*"):
            path.chmod(0o755 if path.is_dir() else 0o644)
        if subprocess.run(command, env=environment, umask=0o022).returncode:
            raise SystemExit("error: the wheel of prw could not be made; the messages are above")
        (wheel,) = made.iterdir()
        return Path(shutil.copyfile(wheel, out / wheel.name))
