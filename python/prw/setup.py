"""Adds the files of the page, which the package shares with the FMU, and to an installation from a clone the path of the
clone, where `make fmu` leaves the FMU. pyproject.toml has all else. Nothing is built in the clone."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py

CLONE = Path(__file__).resolve().parents[2]
#: Directories as in prw.files, and the files that prw.frames needs.
PAGE_DIRECTORIES = ("crates/fmu-package/page", "docs/fmu-page/wrist")
PAGE_FILES = ("live.css", "player.js", "plot.js", "animation.js", "wrist.js", "wrist.json")


class WithClone(build_py):
    """Adds these files to the modules."""

    def run(self) -> None:
        super().run()
        if self.editable_mode:
            return
        package = Path(self.build_lib, "prw")
        (package / "page").mkdir(exist_ok=True)
        for path in (CLONE / directory / name for directory in PAGE_DIRECTORIES for name in PAGE_FILES):
            if path.is_file():
                shutil.copyfile(path, package / "page" / path.name)
        if (CLONE / "build_fmu.rs").is_file():
            (package / "clone.txt").write_text(str(CLONE), encoding="utf-8")


setup(cmdclass={"build_py": WithClone}, options={"build": {"build_base": tempfile.mkdtemp(prefix="prw-build-")}})
