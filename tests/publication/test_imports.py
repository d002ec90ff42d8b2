"""The modules of every Python package and every Rust crate import each other without cycles, so there is an order in which each
module comes after the modules that it uses."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest
from built import ROOT
from test_readmes import FILES

PACKAGES = sorted({str(Path(name).parent) for name in FILES if name.endswith("__init__.py")})
CRATES = sorted({name.split("/src/")[0] + "/src" for name in FILES if re.search(r"(?:^|/)src/.*\.rs$", f"/{name}")})


def cycle(graph: dict[str, set[str]]) -> list[str]:
    """Returns modules of which each imports the next; empty if there is no cycle."""
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return list(reversed(error.args[1]))
    return []


def python_imports(name: str, is_package: bool, code: str) -> Iterator[str]:
    """Yields the absolute names that a module imports, including imports in functions and imports for type checkers."""
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = name.split(".")[: (None if is_package else -1) if node.level == 1 else -node.level + is_package]
            module = ".".join([*(above if node.level else []), *filter(None, [node.module])])
            yield from (f"{module}.{alias.name}" for alias in node.names)


def python_graph(package: Path) -> dict[str, set[str]]:
    files = {path.relative_to(package.parent).with_suffix(""): path for path in package.rglob("*.py")}
    modules = {".".join(name.parts).removesuffix(".__init__"): path for name, path in files.items()}
    graph: dict[str, set[str]] = {}
    for name, path in modules.items():
        found = python_imports(name, path.name == "__init__.py", path.read_text(encoding="utf-8"))
        own = (other if other in modules else other.rpartition(".")[0] for other in found)
        graph[name] = {other for other in own if other in modules and other != name}
    return graph


def without_groups(names: str) -> list[str]:
    """Returns the paths of a `use`: `a::{b, c::{d, e}}` is a::b, a::c::d and a::c::e."""
    while group := re.search(r"([\w:]*)\{([^{}]*)\}", names):
        parts = [group[1] + part.strip() for part in group[2].split(",") if part.strip()]
        names = names[: group.start()] + ", ".join(parts) + names[group.end() :]
    return [part.strip().split(" ")[0] for part in names.split(",")]


def rust_paths(code: str) -> Iterator[str]:
    """Yields the paths that start with `crate` or `super`, except in comments and tests."""
    code = re.split(r"#\[cfg\(test\)\]\s*mod \w+ \{", re.sub(r"//.*", "", code))[0]
    for names in re.findall(r"\buse ((?:crate|super)\b[^;]*);", code):
        yield from without_groups(" ".join(names.split()))
    yield from re.findall(r"(?<!\$)\b(?:crate|super)(?:::\w+)+", re.sub(r"\buse [^;]*;", "", code))


def rust_graph(source: Path) -> dict[str, set[str]]:
    """Returns the modules of a crate, each with the modules that it uses. The root is left out, because it only lists modules and
    exports their items. Paths that begin with a submodule's name are left out, because a module and its submodules belong together."""
    modules = {}
    for path in source.rglob("*.rs"):
        directories = path.relative_to(source).with_suffix("").parts
        modules["::".join(part for part in directories if part not in ("lib", "main", "mod"))] = path
    graph: dict[str, set[str]] = {name: set() for name in modules if name}
    for name in graph:
        for path_of_item in rust_paths(modules[name].read_text(encoding="utf-8")):
            parts, above = path_of_item.split("::"), name.split("::")
            while parts[:1] == ["super"]:
                parts, above = parts[1:], above[:-1]
            parts = parts[1:] if parts[:1] == ["crate"] else above + parts
            while parts and "::".join(parts) not in graph:
                parts.pop()
            graph[name] |= {"::".join(parts)} - {"", name}
    return graph


@pytest.mark.parametrize("package", PACKAGES)
def test_python_packages(package: str) -> None:
    assert cycle(python_graph(ROOT / package)) == []


@pytest.mark.parametrize("source", CRATES)
def test_rust_crates(source: str) -> None:
    assert cycle(rust_graph(ROOT / source)) == []


def test_cycles_are_found(tmp_path: Path) -> None:
    """Finds a Python cycle through imports in a function and for types. In Rust, finds paths in braces, but not in comments and tests.
    The Rust modules have a cycle only if the use of a submodule by its module counts, too."""
    files = {
        "p/__init__.py": "",
        "p/a.py": "def f():\n    from p.b import g\n",
        "p/b.py": "if TYPE_CHECKING:\n    from .a import F\n",
        "p/c.py": "from p import a, b\n",
        "src/lib.rs": "mod a;\nmod b;\npub use a::A;\n",
        "src/a.rs": "use crate::{\n    b::{self, B as C},\n    D,\n};\n// crate::c\n#[cfg(test)]\nmod tests {\n    use crate::c::E;\n}\n",
        "src/b/mod.rs": "mod d;\n",
        "src/b/d.rs": "fn d() -> super::super::a::A {}\n",
        "src/c.rs": "use super::a;\n",
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text, encoding="utf-8")
    graph = python_graph(tmp_path / "p")
    assert graph == {"p": set(), "p.a": {"p.b"}, "p.b": {"p.a"}, "p.c": {"p.a", "p.b"}}
    assert set(cycle(graph)) == {"p.a", "p.b"}
    rust = rust_graph(tmp_path / "src")
    assert rust == {"a": {"b"}, "b": set(), "b::d": {"a"}, "c": {"a"}}
    assert cycle(rust) == []
    assert set(cycle(rust | {"b": {"b::d"}})) == {"a", "b", "b::d"}
