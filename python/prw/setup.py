"""Adds the files of the page with an animation to the package and, if the package is installed from a clone, the path of the
clone, in which `make fmu` writes the FMU. pyproject.toml has all other settings. The build writes nothing into the clone."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py

CLONE = Path(__file__).resolve().parents[2]
#: The directories that prw.files also lists, and the files that prw.frames needs.
PAGE_DIRECTORIES = ("crates/fmu-package/page", "docs/fmu-page/wrist")
PAGE_FILES = ("live.css", "player.js", "plot.js", "animation.js", "wrist.js", "wrist.json")


class WithClone(build_py):
    """Copies these files next to the modules, and writes the path of the clone. An editable installation needs neither."""

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
