"""The names with which documents, scripts and workflows choose tests are names of tests, in the packages that the command tests.
Otherwise a command would run none and succeed, or run all of them."""

from __future__ import annotations

import re
import shlex
import subprocess
import tomllib
from typing import Any

import pytest
from built import ROOT

#: Options of cargo test and of its test programs that have a value.
WITH_VALUE = ("-p", "--package", "--bin", "--profile", "--test", "--skip")
#: Begin of an item whose name contains the word.
CARGO_ITEM, PYTEST_ITEM = r"\b(fn|mod) \w*{}", r"\bdef test_\w*{}"
ROBUSTNESS = ROOT / "docs/robustness.md"


def sources(*patterns: str) -> str:
    """Returns the text of the tracked files."""
    command = ["git", "ls-files", *patterns]
    names = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout.split()
    return "\n".join((ROOT / name).read_text(encoding="utf-8") for name in names)


def cargo_filters(command: str) -> list[str]:
    """Returns the parts of test names in a cargo command."""
    words, found = iter(shlex.split(command)), []
    for word in words:
        if word == "--skip":
            found.append(next(words))
        elif word in WITH_VALUE:
            next(words)
        elif not word.startswith("-") and word not in ("cargo", "test", "nextest", "run"):
            found += word.strip(":").split("::")
    return found


def option(command: str, *names: str) -> str | None:
    """Returns the value of an option of a command, or None if the command does not have it."""
    words = shlex.split(command)
    return next((value for word, value in zip(words, words[1:]) if word in names), None)


def manifest(path: str) -> dict[str, Any]:
    """Returns the content of a Cargo.toml."""
    return tomllib.loads((ROOT / path).read_text(encoding="utf-8"))


def sources_tested_by(command: str) -> str:
    """Returns the sources that a cargo command tests: of the named package, or of the default members of the workspace; with
    `--test`, only of this test."""
    workspace = manifest("Cargo.toml")["workspace"]
    packages = {manifest(f"{path}/Cargo.toml")["package"]["name"]: path for path in (".", *workspace["members"])}
    name, test = option(command, "-p", "--package"), option(command, "--test")
    directories = [packages[name]] if name else workspace["default-members"]
    if test:
        return sources(*(f"{path}/tests/{test}{ending}" for path in directories for ending in (".rs", "/*.rs")))
    other = [f":!{path}/" for path in workspace["members"]]
    return "\n".join(sources("*.rs", *other) if path == "." else sources(f"{path}/*.rs") for path in directories)


def pytest_filters(text: str) -> set[str]:
    """Returns the parts of test names in the options -k."""
    options = re.findall(r"pytest[^\n]*(?:\n +[^\n]*)*? -k (?:\"([^\"]+)\"|(\w+))", text)
    return {word for option in options for word in re.findall(r"\w+", "".join(option))} - {"not", "and", "or"}


def test_filters_are_read() -> None:
    assert cargo_filters("cargo test -p fmu-export --test robustness any_calls -- --skip unloading runs::") == [
        "any_calls",
        "unloading",
        "runs",
    ]
    assert pytest_filters('python -m pytest tests/fmpy\n  tests/prw -k "not one and not other"') == {"one", "other"}


def test_only_sources_of_the_tested_packages_are_searched() -> None:
    named = "fn elements_form_arrays"
    assert named in sources_tested_by("cargo test -p fmu-run elements_form_arrays")
    for command in ("cargo test", "cargo test --test fmu"):
        rust = sources_tested_by(command)
        assert "fn loading_and_unloading_leaks_nothing" in rust and named not in rust
    assert not sources_tested_by("cargo test -p fmu-export --test fmu")


def test_cargo_filters_name_tests() -> None:
    page = ROBUSTNESS.read_text(encoding="utf-8")
    assert "`..." not in page, "write the command in full"
    commands = re.findall(r"`[^`]*?(cargo test [^`]+)`", page)
    assert any("every_guarantee_holds_for_any_calls" in command for command in commands) and len(commands) > 8
    for command in commands:
        rust = sources_tested_by(command)
        assert rust, command
        assert [word for word in cargo_filters(command) if not re.search(CARGO_ITEM.format(word), rust)] == [], command


def test_the_command_for_the_table_of_readers_repeats_it() -> None:
    page = ROBUSTNESS.read_text(encoding="utf-8")
    (count,) = re.findall(r"^\| (\d+) mutations of them", page, re.MULTILINE)
    code = (ROOT / "crates/fmu-run/tests/readers/main.rs").read_text(encoding="utf-8")
    (kinds,) = re.findall(r"(\d) \* mutations\(\)", code)
    found = re.findall(r"READERS_MUTATIONS=(\d+)", page + code)
    assert len(found) == 2 and {int(kinds) * int(each) for each in found} == {int(count)}


@pytest.mark.parametrize("pattern", [".github/workflows/*.yml", "Makefile", "dev/sanitize"])
def test_pytest_filters_name_tests(pattern: str) -> None:
    python = sources("tests/*.py")
    filters = pytest_filters(sources(pattern))
    assert [word for word in sorted(filters) if not re.search(PYTEST_ITEM.format(word), python)] == []
