"""Sphinx configuration of the reference of both Python packages: `make reference`."""

import tomllib
from pathlib import Path

project = "Pitch-roll wrist testbed"
release = tomllib.loads(Path(__file__).parents[2].joinpath("Cargo.toml").read_text())["workspace"]["package"]["version"]
extensions = ["sphinx.ext.autodoc", "numpydoc"]
html_theme = "alabaster"
html_theme_options = {"page_width": "72rem", "code_font_size": "0.8em", "sidebar_width": "14rem"}
default_role = "py:obj"
add_module_names = False
autodoc_default_options = {"members": True}
autodoc_typehints = "signature"
autodoc_type_aliases = {
    name: name for name in ("ArrayLike", "Array", "Given", "Source", "Start", "Trajectory", "Measure")
}
numpydoc_show_class_members = False
numpydoc_class_members_toctree = False
# Each parameter is documented, and no other name; each value and exception has a description.
numpydoc_validation_checks = {"GL08", "PR01", "PR02", "PR07", "RT03", "YD01"}
# Methods, and classes whose instances only functions of the package make.
numpydoc_validation_exclude = {
    r"[A-Z]\w+\.\w",
    r"\.(AutoresetMode|MissingPackage|Runs|Instances|Variable|Run|Recording|Identification|Excitation|StateSpace|Agreement)$",
}
