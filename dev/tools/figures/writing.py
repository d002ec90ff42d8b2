"""Writes figures as reproducible files: SVG, PNG, and SVG for the page, which follows its light or dark style."""

from __future__ import annotations

import io
import re
from pathlib import Path
from typing import Any

import matplotlib
from lxml import etree
from matplotlib.figure import Figure
from PIL import Image

from prw.files import replacing
from prw.plots import BLUE, GREEN, PAGE_STYLE, PURPLE, VERMILION

#: CSS colour for each colour that matplotlib writes, with a fallback for SVG files outside of the page.
COLOURS = {
    "#000000": "currentColor",
    BLUE.lower(): f"var(--curve-1, {BLUE})",
    VERMILION.lower(): f"var(--curve-2, {VERMILION})",
    GREEN.lower(): f"var(--curve-3, {GREEN})",
    PURPLE.lower(): f"var(--curve-4, {PURPLE})",
    "#e6e6e6": "var(--grid, #e5e5e5)",
    "#e5e5e5": "var(--grid, #e5e5e5)",
}
#: Prefixes of matplotlib's ids, and their replacements.
ID_WORDS = {"p": "clip", "m": "mark", "h": "hatch"}
#: Font size of the numbers at the ticks, which is stated once, because they are most of the text.
TICK_SIZE = "8px"
SVG = "{http://www.w3.org/2000/svg}"
XLINK = "{http://www.w3.org/1999/xlink}"


def write_svg(path: Path, figure: Figure) -> None:
    """Write the figure as SVG with text, not paths."""
    with replacing(path) as temporary:
        temporary.write_bytes(_svg(figure))


def write_png(path: Path, figure: Figure) -> None:
    """Write the figure as PNG."""
    with replacing(path) as temporary, matplotlib.rc_context(PAGE_STYLE):
        figure.savefig(temporary, dpi=150)


def write_small_png(path: Path, figure: Figure) -> None:
    """Write the figure as PNG of 128 colours, some ten kilobytes. With fewer, thin curves get the colour of the grid."""
    pixels = io.BytesIO()
    with matplotlib.rc_context(PAGE_STYLE):
        figure.savefig(pixels, dpi=110, format="png")
    with replacing(path) as temporary:
        few = Image.open(pixels).convert("RGB").quantize(128, dither=Image.Dither.NONE)
        few.save(temporary, format="PNG", optimize=True)


def write_for_page(path: Path, figure: Figure) -> None:
    """Write the figure as an SVG element for the page: with the page's fonts, sizes and colours, and unique ids."""
    with replacing(path) as temporary:
        temporary.write_bytes(for_page(_svg(figure, transparent=True), path.stem))


def _svg(figure: Figure, transparent: bool = False) -> bytes:
    file = io.BytesIO()
    # A fifth of a point is less than a pixel of the page.
    with matplotlib.rc_context({**PAGE_STYLE, "path.simplify_threshold": 0.2}):
        figure.savefig(file, format="svg", metadata={"Date": None}, transparent=transparent)
    return _with_counted_ids(file.getvalue().decode()).encode()


def _with_counted_ids(svg: str) -> str:
    """The SVG with ids clip1, clip2, mark1 in order of appearance. matplotlib's ids are hashes of coordinates with all
    digits, and the last digit is not the same on every processor."""
    for kind, word in ID_WORDS.items():
        ids = dict.fromkeys(re.findall(rf'["#]({kind}[0-9a-f]{{10}})[")]', svg))
        for number, identifier in enumerate(ids, 1):
            svg = svg.replace(identifier, f"{word}{number}")
    return svg


def for_page(svg: bytes, name: str) -> bytes:
    """matplotlib's SVG, tidied for a page that holds several; `name` makes its ids unique."""
    root = etree.fromstring(svg, etree.XMLParser(remove_comments=True, remove_blank_text=True))
    for element in [*root.findall(f".//{SVG}metadata"), *root.findall(f".//{SVG}style")]:
        element.getparent().remove(element)
    for attribute in ("width", "height", "version"):
        root.attrib.pop(attribute, None)
    used = set(re.findall(r'(?:url\(#|href="#)([^)"]+)', etree.tostring(root, encoding="unicode")))
    for element in root.iter():
        _make_unique(element, name, used)
        for attribute in ("d", "points", "x", "y", "width", "height", "transform"):
            if attribute in element.attrib:
                element.attrib[attribute] = _shorter(element.attrib[attribute])
        if element.get("transform", "").startswith(("rotate(0 ", "rotate(-0 ")):
            del element.attrib["transform"]
        _restyle(element)
    _draw_marks(root)
    for element in reversed(list(root.iter(f"{SVG}g", f"{SVG}defs", f"{SVG}path"))):
        parent, style = element.getparent(), element.get("style", "")
        if element.tag == f"{SVG}path":
            if style == "fill:none":  # paints nothing
                parent.remove(element)
        elif len(element) == 0:
            parent.remove(element)
        elif element.tag == f"{SVG}g" and not element.attrib:  # carried an id only
            position = parent.index(element)
            parent[position : position + 1] = list(element)
    _join_paths(root)
    etree.cleanup_namespaces(root)
    # Texts inherit their colour.
    root.attrib.update({"style": f"font-size:{TICK_SIZE}", "fill": "currentColor"})
    return re.sub(rb"\n +", b"\n", bytes(etree.tostring(root, encoding="utf-8", pretty_print=True)))


def _make_unique(element: Any, name: str, used: set[str]) -> None:
    """Prefix the ids that are referred to, and drop the others."""
    identifier = element.attrib.pop("id", None)
    if identifier in used:
        element.attrib["id"] = f"{name}-{identifier}"
    if XLINK + "href" in element.attrib:
        element.attrib["href"] = f"#{name}-{element.attrib.pop(XLINK + 'href')[1:]}"
    if "clip-path" in element.attrib:
        element.attrib["clip-path"] = element.attrib["clip-path"].replace("url(#", f"url(#{name}-")


def _shorter(numbers: str) -> str:
    """Rounds numbers to two decimals, a hundredth of a point, and removes spaces."""
    text = re.sub(r"-?\d+\.\d+", lambda match: f"{float(match[0]):.2f}".rstrip("0").rstrip("."), numbers)
    text = re.sub(r"-0(?![.\d])", "0", re.sub(r"\s+", " ", text))
    return re.sub(r" ?([A-Za-z]) (?=-?\d)", r"\1", text).strip()


def _restyle(element: Any) -> None:
    """Replace the colours and fonts of matplotlib by the colours and fonts of the page."""
    style = element.attrib.pop("style", "")
    if not style and element.tag != f"{SVG}text":
        return
    rules = dict(re.split(r":\s*", rule.strip(), maxsplit=1) for rule in style.split(";") if rule.strip())
    for key in ("stroke-linecap", "stroke-linejoin", "font-family"):
        rules.pop(key, None)
    if "font" in rules:  # matplotlib 3.9 and 3.10: one rule for all
        font = rules.pop("font")
        rules["font-size"] = re.findall(r"[\d.]+px", font)[0]
        if re.match(r"(bold|[67]00)\b", font):
            rules["font-weight"] = "bold"
    if element.tag == f"{SVG}text":
        rules.pop("fill", None)
    for key, value in (("font-size", TICK_SIZE), ("text-anchor", "start"), ("stroke-dashoffset", "0")):
        if rules.get(key) == value:  # inherited, or the default of SVG
            del rules[key]
    for key in ("fill", "stroke"):
        if key in rules:
            rules[key] = COLOURS.get(rules[key].lower(), rules[key])
    if rules:
        element.attrib["style"] = ";".join(f"{key}:{value}" for key, value in rules.items())


def _draw_marks(root: Any) -> None:
    """Replaces the copies of a mark by the lines (ticks) or circles that they are, which takes a third less space. A circle has the style
    of its group, because all marks of a group are alike. Other marks keep their style only in their definition."""
    defined = {f"#{path.get('id')}": path for path in root.iter(f"{SVG}path") if path.get("id")}
    for use in list(root.iter(f"{SVG}use")):
        path, style = defined[use.get("href")], use.attrib.pop("style", None)
        if style is not None:
            path.attrib["style"] = style
        x, y, style = use.get("x"), use.get("y"), path.get("style")
        if line := re.fullmatch(r"M0 0 ?L(\S+ \S+)", path.get("d")):
            drawn, attributes = "path", {"d": f"M{x} {y}l{line[1]}", "style": style}
        elif circle := re.fullmatch(r"M0 ([\d.]+)(?:C[^A-Za-z]+){8}z", path.get("d")):
            drawn, attributes = "circle", {"cx": x, "cy": y, "r": circle[1]}
            use.getparent().attrib["style"] = style
        else:
            continue
        use.tag = f"{SVG}{drawn}"
        use.attrib.clear()
        use.attrib.update(attributes)
    still_used = {use.get("href") for use in root.iter(f"{SVG}use")}
    for href, path in defined.items():
        if href not in still_used:
            path.getparent().remove(path)


def _join_paths(root: Any) -> None:
    """Join the paths of a parent that differ in their points only, such as grid lines, ticks and curves of one colour."""
    known: dict[Any, Any] = {}
    for path in list(root.iter(f"{SVG}path")):
        attributes = {name: value for name, value in path.attrib.items() if name != "d"}
        first = known.setdefault((path.getparent(), *sorted(attributes.items())), path)
        if first is not path and "id" not in attributes:
            first.attrib["d"] += path.get("d")
            path.getparent().remove(path)
    for path in known.values():
        path.attrib["d"] = _packed(_relative(path.get("d")))


def _packed(path: str) -> str:
    """Removes spaces before a minus and zeros before a decimal point, which SVG does not need. Writes `v` and `h` for vertical and
    horizontal lines."""
    path = re.sub(r"l0 (\S+?)(?=M|$)", r"v\1", re.sub(r"l(\S+) 0(?=M|$)", r"h\1", path))
    return re.sub(r"(?<![\d.])0(?=\.\d)", "", re.sub(r" (?=-)", "", path))


def _relative(points: str) -> str:
    """The points of straight lines, all but the first of each line relative to the point before them. Other paths do not
    change."""
    found = re.findall(r"([ML])(-?[\d.]+) (-?[\d.]+)", points)
    if "".join(f"{command}{x} {y}" for command, x, y in found) != points:
        return points
    text, drawn, before = "", "", ("0", "0")
    for command, *point in found:
        numbers = point if command == "M" else [f"{float(b) - float(a):.2f}" for a, b in zip(before, point)]
        text += f"{'M' if command == 'M' else 'l' if drawn == 'M' else ' '}{' '.join(numbers)}"
        drawn, before = command, (point[0], point[1])
    return _shorter(text)
