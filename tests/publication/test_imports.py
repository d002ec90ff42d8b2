"""The modules of every Python package and every Rust crate import each other without cycles, so there is an order in which each
module comes after the modules that it uses."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from importlib.util import resolve_name
from pathlib import Path

import pytest
from built import ROOT
from repository import FILES

Graph = dict[str, set[str]]
PACKAGES = sorted({str(Path(name).parent) for name in FILES if name.endswith("__init__.py")})
CRATES = sorted({name.split("src/")[0] + "src" for name in FILES if re.match(r"(?:.*/)?src/.*\.rs$", name)})


def python_graph(package: Path) -> Graph:
    """Returns the modules of a package, each with the modules that it imports, also in functions and for type checkers."""
    files = {path.relative_to(package.parent).with_suffix(""): path for path in package.rglob("*.py")}
    modules = {".".join(name.parts).removesuffix(".__init__"): path for name, path in files.items()}
    graph: Graph = {name: set() for name in modules}
    for name, path in modules.items():
        home = name if path.name == "__init__.py" else name.rpartition(".")[0]
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            found = [alias.name for alias in node.names] if isinstance(node, ast.Import | ast.ImportFrom) else []
            if isinstance(node, ast.ImportFrom):
                module = resolve_name("." * node.level + (node.module or ""), home)
                found = [f"{module}.{alias}" for alias in found]
            graph[name] |= {each if each in modules else each.rpartition(".")[0] for each in found} & modules.keys()
        graph[name].discard(name)
    return graph


def rust_paths(code: str) -> Iterator[str]:
    """Yields the paths that start with `crate` or `super`, except in comments and tests: `a::{b, c}` is a::b and a::c."""
    code = re.split(r"#\[cfg\(test\)\]\s*mod \w+ \{", re.sub(r"//.*", "", code))[0]
    for names in re.findall(r"\buse ((?:crate|super)\b[^;]*);", code):
        names = " ".join(names.split())
        while group := re.search(r"([\w:]*)\{([^{}]*)\}", names):
            parts = ", ".join(group[1] + part.strip() for part in group[2].split(",") if part.strip())
            names = names[: group.start()] + parts + names[group.end() :]
        yield from (part.strip().split(" ")[0] for part in names.split(","))
    yield from re.findall(r"(?<!\$)\b(?:crate|super)(?:::\w+)+", re.sub(r"\buse [^;]*;", "", code))


def rust_graph(source: Path) -> Graph:
    """Returns the modules of a crate, each with the modules that it uses. The root is left out, because it only lists modules and
    exports their items. Paths that begin with a submodule's name are left out, because a module and its submodules belong together."""
    modules = {}
    for path in source.rglob("*.rs"):
        directories = path.relative_to(source).with_suffix("").parts
        modules["::".join(part for part in directories if part not in ("lib", "main", "mod"))] = path
    graph: Graph = {name: set() for name in modules if name}
    for name in graph:
        for item in rust_paths(modules[name].read_text(encoding="utf-8")):
            parts, above = item.split("::"), name.split("::")
            while parts[:1] == ["super"]:
                parts, above = parts[1:], above[:-1]
            parts = parts[1:] if parts[:1] == ["crate"] else above + parts
            while parts and "::".join(parts) not in graph:
                parts.pop()
            graph[name] |= {"::".join(parts)} - {"", name}
    return graph


@pytest.mark.parametrize("path", [*PACKAGES, *CRATES])
def test_imports_have_an_order(path: str) -> None:
    TopologicalSorter((python_graph if path in PACKAGES else rust_graph)(ROOT / path)).prepare()


def test_cycles_are_found(tmp_path: Path) -> None:
    """In Python, through imports in functions and for types; in Rust, through braces and `super`, but not in comments and tests."""
    files = {
        "p/__init__.py": "",
        "p/a.py": "def f():\n    from p.b import g\n",
        "p/b.py": "if TYPE_CHECKING:\n    from .a import F\n",
        "src/lib.rs": "mod a;\nmod b;\npub use a::A;\n",
        "src/a.rs": "use crate::{\n    b::{self, d::C},\n    D,\n};\n// crate::c\n#[cfg(test)]\nmod tests {\n    use crate::c::E;\n}\n",
        "src/b/mod.rs": "mod d;\n",
        "src/b/d.rs": "fn d() -> super::super::a::A {}\n",
        "src/c.rs": "use super::a;\n",
    }
    for name, content in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(content, encoding="utf-8")
    python, rust = python_graph(tmp_path / "p"), rust_graph(tmp_path / "src")
    assert python == {"p": set(), "p.a": {"p.b"}, "p.b": {"p.a"}}
    assert rust == {"a": {"b", "b::d"}, "b": set(), "b::d": {"a"}, "c": {"a"}}
    for graph in (python, rust):
        with pytest.raises(CycleError):
            TopologicalSorter(graph).prepare()
