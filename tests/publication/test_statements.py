"""Checks statements in pages, for example about make targets, numbers, paths, dependencies, install commands and messages; and that the
docstrings of the Python packages make a reference."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from built import ROOT
from test_readmes import FILES, PAGES, published, released
from test_versions import own_packages, read

from tools.documentation.sources import read_table

MAKEFILE = (ROOT / "Makefile").read_text(encoding="utf-8")
RULES = dict(re.findall(r"^([\w-]+):(?!=)(.*)$", MAKEFILE, re.MULTILINE))
HELP = set(re.findall(r"^\t@echo 'make ([\w-]+)", MAKEFILE, re.MULTILINE))
CODE = re.compile(r"^```.*?^```|`[^`\n]+`", re.DOTALL | re.MULTILINE)
PATH = re.compile(r"`([\w.-]+/[\w./-]*|[\w-]+\.(?:rs|py|md|xml|lock))`")
#: Directories that builds create and git does not track.
MADE = ("out/", "dist/", "target/", ".venv")
INSTALL = re.compile(r"(?:pip|cargo) install ([^`\n#;)]*)")
#: The rows of the first table of importers.
AT_A_GLANCE = read_table(ROOT / "docs/compatibility.md", "At a glance").rows
TEXTS = [name for name in FILES if name.endswith((".md", ".py", ".rs", ".toml", ".html", ".yml", "Makefile"))]


def text(name: str) -> str:
    return str((ROOT / name).read_text(encoding="utf-8"))


def test_named_targets_exist() -> None:
    for name in TEXTS:
        code = "\n".join(CODE.findall(text(name))) if name.endswith(".md") else text(name)
        named = set(re.findall(r"(?:`|^|&& )make ([a-z][\w-]*)", code, re.MULTILINE))
        assert name == "CHANGELOG.md" or named <= RULES.keys(), name


def test_the_readme_names_the_command_of_the_continuous_integration() -> None:
    called = re.findall(r"^make .*$", (ROOT / ".ci" / "run").read_text(encoding="utf-8"), re.MULTILINE)
    named = re.findall(r"^\| `(make \w+)` \|", (ROOT / "README.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert called == ["make test"] and named == ["make demo", "make test"]


def test_the_numbers_of_the_readme() -> None:
    """The numbers for accuracy, speed and importers come from the tests, from `make bench` and from docs/compatibility.md."""
    rows = dict(re.findall(r"^\| \*\*(\w+)\*\* \| (.*?) \| \[", text("README.md"), re.MULTILINE))
    tolerance = re.search(r"assert_close\(values, true_values, (\S+)\)", text("tests/fmpy/test_exactness.py"))
    assert tolerance and f"within {tolerance[1]} of" in rows["Exact"]
    fmpy_ratios = {name: ratios[4] for name, ratios in json.loads(text("dev/benches/ratios.json"))["runs"].items()}
    assert f"takes 1/{fmpy_ratios['testbed']:.0f} of the time" in rows["Fast"]
    bounds = re.search(r"run (\d+) to (\d+) times\s+as fast as with FMPy", text("crates/fmu-run/README.md"))
    assert bounds and all(int(bounds[1]) <= ratio <= int(bounds[2]) for ratio in fmpy_ratios.values()), fmpy_ratios
    ran = {row[0].split("]")[0].removesuffix("'s runtime") for row in AT_A_GLANCE if {"✓", "(✓)"} & {*row}}
    others = ran - {"[fmu_run", "[Programs in C"}
    assert f"{len(others)} other tools have run it" in rows["Portable"], others
    listed = re.search(
        r"`make test` runs (.*) and the programs in C\.", text("docs/compatibility.md").replace("\n", " ")
    )
    assert listed and all(any(name.split()[0] in tool for tool in ran) for name in listed[1].split(", ")), ran
    words = ("four", "five", "six", "seven", "eight", "nine", "ten")
    assert f"{words[len(listed[1].split(', ')) - 5]} of them" in rows["Portable"]  # without fmu_run


def test_the_numbers_of_the_readmes_of_crates() -> None:
    """They come from docs/checking.md and from `make bench`."""
    section = text("docs/checking.md").split("## Reference FMUs")[1].split("\n## ")[0]
    counts = re.search(r"(\d+) FMUs for FMI 2\.0 and (\d+) for FMI 3\.0", " ".join(section.split()))
    # Rows with a violation in all FMUs of FMI 2.0, and in all of FMI 3.0.
    assert counts and "| violation | all of 2.0 |" in section and "| violation in 3.0, note in 2.0 | all |" in section
    assert f"In each of the {int(counts[1]) + int(counts[2])} Reference FMUs" in text("crates/fmu-check/README.md")
    step = json.loads(text("dev/benches/ratios.json"))["steps"]["angles set, step, 4 outputs, as vectors"][0]
    stated = re.search(
        r"takes about ([\d.]+) times as long as in C", " ".join(text("crates/fmu-export/README.md").split())
    )
    assert stated and abs(float(stated[1]) - step) <= 0.1, step


def test_the_severities_of_findings() -> None:
    """The severities in docs/checking.md are those that the rules have in the FMI versions of the FMUs."""
    rules = dict(re.findall(r"^## (\S+)\n(.*?)(?=^## |\Z)", text("crates/fmu-check/RULES.md"), re.S | re.M))
    compared = 0
    for section, versions in {"Reference FMUs": (2, 3), "PythonFMU": (2,)}.items():
        rows = text("docs/checking.md").split(f"## {section}\n")[1].split("\n## ")[0]
        row = r"^\| `([\w.-]+)`.*? \| ((?:violation|fragile|note)\b.*?) \|"
        for name, stated in re.findall(row, rows, re.MULTILINE):
            rule = rules.get(name) or rules[name.rpartition(".")[0]]
            severities = re.findall(r"^\* (?:FMI \d\.0: )?(\w+)", rule, re.MULTILINE)
            expected = {severities[version - 2] for version in versions}
            assert set(re.findall(r"violation|fragile|note", stated)) == expected, f"{section}: {name}"
            compared += 1
    assert compared > 12


def test_models_are_created_outside_of_the_clone() -> None:
    """In the clone, `cargo fmu new` would change Cargo.toml, because cargo adds the model to the workspace."""
    found = 0
    for name in PAGES:
        for block in re.findall(r"^```.*?^```", text(name), re.DOTALL | re.MULTILINE):
            if "cargo install --path crates/fmu-package" in block and "cargo fmu new" in block:
                found += 1
                assert re.search(r"crates/fmu-package.*^(?:\$ )?cd \.\..*cargo fmu new", block, re.DOTALL | re.M), name
    assert found >= 2


def test_the_number_of_seeded_faults() -> None:
    lists = [name for name in FILES if re.match(r"tests/faults/.*\.toml$", name)]
    count = sum(len(tomllib.loads(text(name))["fault"]) for name in lists)
    assert f"puts the {count} faults of `tests/faults`" in text("docs/robustness.md")


def test_help_lists_every_target_that_no_other_needs() -> None:
    (phony,) = re.findall(r"^\.PHONY: (.*)$", MAKEFILE, re.MULTILINE)
    internal = {name for needed in RULES.values() for name in needed.split()}
    assert HELP <= set(phony.split()) == RULES.keys()
    assert set(phony.split()) - internal - {"help"} <= HELP


@pytest.mark.parametrize("name", [name for name in PAGES if not name.startswith(("CHANGELOG", "crates/"))])
def test_named_paths_exist(name: str) -> None:
    """Checks all paths in CONTRIBUTING.md; in other pages, paths that begin with a directory of the project."""
    kept, directories = [f"/{path}/" for path in FILES], {path.split("/")[0] for path in FILES if "/" in path}
    for path in PATH.findall(text(name)):
        if not path.startswith(MADE) and (name == "CONTRIBUTING.md" or path.split("/")[0] in directories):
            assert any(f"/{path.rstrip('/')}/" in other for other in kept), path


def test_contributing_lists_every_directory_and_every_file_of_the_model() -> None:
    tree, tables = re.split(r"^```\n", text("CONTRIBUTING.md").split("## Directories")[1], flags=re.MULTILINE)[1:3]
    named = set(re.findall(r"^([\w/-]+)/ ", tree, re.MULTILINE))
    assert all((ROOT / path).is_dir() for path in named)
    for path in {path.split("/")[0] for path in FILES if "/" in path and not path.startswith(".")}:
        assert any(f"{other}/".startswith(f"{path}/") for other in named), path
    sources = {path.name for path in (ROOT / "src").glob("*.rs")} - {"lib.rs"}
    assert sources <= set(re.findall(r"`(\w+\.rs)`", tables))


def test_the_diagram_of_the_crates() -> None:
    """The diagram in docs/architecture.md has an arrow for each dependency among the crates, dashed if the dependency is optional."""
    expected = set()
    for name, manifest in own_packages().items():
        for needed, how in read(manifest).get("dependencies", {}).items():
            if needed in own_packages():
                arrow = "-.->" if isinstance(how, dict) and how.get("optional") else "-->"
                expected.add(f"{name} {arrow} {needed}")
    (diagram,) = re.findall(r"^```mermaid\ngraph TD\n(.*?)^```", text("docs/architecture.md"), re.DOTALL | re.MULTILINE)
    assert {line.strip() for line in diagram.splitlines()} == expected


def test_unsafe_code_is_where_the_page_states() -> None:
    """The table lists exactly the crates with unsafe code. So it does not list the model in src/, which has none."""
    sources = [name for name in FILES if re.match(r"(?:src|(?:crates|examples)/.*/src)/.*\.rs$", name)]
    code = re.compile(r"^(?!\s*//).*\bunsafe (?:\{|fn|extern|impl|trait)", re.MULTILINE)
    found = {re.sub(r"/src/.*", "/src", name) for name in sources if code.search(text(name))}
    section = text("docs/architecture.md").split("## Where unsafe")[1].split("\n## ")[0]
    assert set(re.findall(r"^\| `(crates/\S+)`", section, re.MULTILINE)) == found


def test_dependencies_are_as_stated() -> None:
    tables = {name: read(manifest).get("dependencies", {}) for name, manifest in own_packages().items()}
    needs = {
        package: {name for name, needed in table.items() if not (isinstance(needed, dict) and needed.get("optional"))}
        for package, table in tables.items()
    }
    assert needs["fmu-export"] == {"fmi-abi"} and needs["fmi-abi"] == {"libc"}
    assert "only dependency is `fmi-abi`, whose only one is `libc`" in " ".join(
        text("crates/fmu-export/README.md").split()
    )
    for name, own in {
        "fmi-client": {"fmi-abi"},
        "fmu-export": {"fmi-abi"},
        "fmu-check": {"fmi-abi"},
        "fmu-run": {"fmi-abi", "fmi-client"},
    }.items():
        assert needs[name] & own_packages().keys() == own, name
    for home in published():
        assert not needs[home.name] & {"prw_testbed", "prw_controller"}


@pytest.mark.skipif(released(), reason="the packages are in their registries")
def test_no_package_of_the_project_is_installed_from_a_registry() -> None:
    """Before the project publishes its packages, anyone could register their names."""
    own = {*own_packages(), "fmu-run", "prw"}
    for name in TEXTS:
        for arguments in INSTALL.findall(text(name)):
            words = [word.strip("\"'").lower().replace("_", "-") for word in arguments.split()]
            asked = {re.split(r"[\[=<>~@]", word)[0] for word in words}
            assert {"--no-index", "--git"} & set(words) or not asked & own, f"{name}: {arguments}"
        links = re.findall(r"docs\.rs/([\w-]+)", text(name))
        assert not own & {*links}, name


def test_docstrings_make_a_reference_without_warnings(tmp_path: Path) -> None:
    """Sphinx warns of unresolved links, undocumented parameters and missing sections."""
    options = ["--quiet", "--fail-on-warning", "--keep-going", "--doctree-dir", str(tmp_path / "trees")]
    command = [sys.executable, "-m", "sphinx", *options, str(ROOT / "docs/reference"), str(tmp_path / "html")]
    finished = subprocess.run(command, capture_output=True, text=True)
    assert finished.returncode == 0 and not finished.stderr, finished.stderr
    assert "Estimate parameters of the testbed" in (tmp_path / "html/prw.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("page", "message", "sources"),
    [
        ("python/prw/tutorial.md", r"(?<![*\w])\*([^*\s][^*\n]*)\*(?!\*)", r"python/prw/src/.*\.(?:py|j2)"),
        ("docs/author-guide.md", r"^\| `([^`]+)` \|", r"crates/fmu-(?:package|export)/src/.*\.rs"),
    ],
)
def test_messages_in_pages_are_in_the_sources(page: str, message: str, sources: str) -> None:
    """Looks for two consecutive words of each message, or its only word. The whole message is not in the sources, because they insert
    names and numbers."""
    code = " ".join(text(name) for name in FILES if re.fullmatch(sources, name))
    # A string may continue on the next line.
    code = re.sub(r"\\\n\s*|\"\s*\n\s*f?\"|`", "", code)
    messages = re.findall(message, text(page), re.MULTILINE)
    assert len(messages) > 9
    for words in (found.split() for found in messages):
        count = min(2, len(words))
        runs = [" ".join(words[start : start + count]) for start in range(len(words) - count + 1)]
        assert any(run in code for run in runs), words
