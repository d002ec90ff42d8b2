"""Adds to an installation from a clone what the package shares with other parts of it: the files of the pages, and the place of the
clone, where `make fmu` leaves the FMU. pyproject.toml has all else. Nothing is built in the clone."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py

CLONE = Path(__file__).resolve().parents[2]
#: As in prw.files.
PAGE_FOLDERS = ("crates/fmu-package/page", "docs/fmu-page/wrist")
PAGE_FILES = ("live.css", "player.js", "plot.js", "animation.js", "wrist.js", "wrist.json")


class WithClone(build_py):
    """Copies these files behind the modules."""

    def run(self) -> None:
        super().run()
        if self.editable_mode or not (CLONE / "build_fmu.rs").is_file():
            return
        package = Path(self.build_lib, "prw")
        (package / "page").mkdir(exist_ok=True)
        for path in (CLONE / folder / name for folder in PAGE_FOLDERS for name in PAGE_FILES):
            if path.is_file():
                shutil.copyfile(path, package / "page" / path.name)
        (package / "clone.txt").write_text(str(CLONE), encoding="utf-8")


setup(cmdclass={"build_py": WithClone}, options={"build": {"build_base": tempfile.mkdtemp(prefix="prw-build-")}})
