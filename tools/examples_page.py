"""Runs the examples and writes docs/examples.md: what each is for, its figure, what it prints, and its code.

python tools/examples_page.py
"""

from __future__ import annotations

import contextlib
import importlib
import inspect
import io
import sys
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "examples"), str(ROOT / "tests" / "examples")]
import interim  # noqa: E402

PAGE, FIGURES = ROOT / "docs" / "examples.md", ROOT / "docs" / "examples"
EXAMPLES = ("lqr", "quiet_motion", "identify", "tolerances")
HEAD = """# Examples

<!-- written by make docs -->

Short programs on top of the FMU and of the Python package `prw`, to read and to change. `make examples` installs what
they need and builds the FMUs; each runs from the project's folder."""


def section(name: str) -> str:
    """The part of the page about one example, which is run; its figure is written beside the page."""
    module = importlib.import_module(name)
    assert module.__file__ is not None
    source = Path(module.__file__).read_text(encoding="utf-8")
    title, _, about = (inspect.getdoc(module) or "").partition("\n\n")
    about, _, command = about.rpartition("\n\n    ")
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        found = module.main()
    parts = [f"## {title}", about, f"```sh\n{command}\n```"]
    if isinstance(found, tuple):
        pixels = io.BytesIO()
        found[0].savefig(pixels, dpi=110, format="png")
        few = Image.open(pixels).convert("RGB").quantize(48, dither=Image.Dither.NONE)
        few.save(FIGURES / f"{name}.png", optimize=True)
        parts.append(f"![{title}](examples/{name}.png)")
    parts.append(f"It prints\n\n```text\n{said.getvalue().strip()}\n```")
    code = source.split('"""\n', 1)[1].strip()
    parts.append(f"<details><summary><code>examples/{name}.py</code></summary>\n\n```python\n{code}\n```\n\n</details>")
    return "\n\n".join(parts)


def main() -> None:
    """Run all, write the page."""
    interim.install()
    FIGURES.mkdir(parents=True, exist_ok=True)
    sections = [section(name) for name in EXAMPLES if name not in interim.waiting()]
    PAGE.write_text("\n\n".join([HEAD, *sections]) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
