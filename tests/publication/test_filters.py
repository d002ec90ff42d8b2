"""The names with which documents, scripts and workflows choose tests are names of tests. Otherwise a command would run none and
succeed, or run all of them."""

from __future__ import annotations

import re
import shlex
import subprocess

import pytest
from built import ROOT

#: Options of cargo test and of its test programs that have a value.
WITH_VALUE = ("-p", "--package", "--profile", "--test", "--skip")
#: Begin of an item whose name contains the word.
CARGO_ITEM, PYTEST_ITEM = r"\b(fn|mod) \w*{}", r"\bdef test_\w*{}"


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


def test_cargo_filters_name_tests() -> None:
    page = (ROOT / "docs/robustness.md").read_text(encoding="utf-8")
    # "... --test fmu NAME" is the command before it with these arguments.
    commands = re.findall(r"`[^`]*?(?:cargo test|\.\.\.) ([^`]+)`", page)
    filters = {word for command in commands for word in cargo_filters(command)}
    assert "every_guarantee_holds_for_any_calls" in filters and "unloading" in filters
    rust = sources("*.rs")
    assert [word for word in sorted(filters) if not re.search(CARGO_ITEM.format(word), rust)] == []


@pytest.mark.parametrize("pattern", [".github/workflows/*.yml", "Makefile", "dev/sanitize"])
def test_pytest_filters_name_tests(pattern: str) -> None:
    python = sources("tests/*.py")
    filters = pytest_filters(sources(pattern))
    assert [word for word in sorted(filters) if not re.search(PYTEST_ITEM.format(word), python)] == []
