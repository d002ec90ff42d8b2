"""What a release says of itself: the section of CHANGELOG.md for the version in Cargo.toml.

    python platforms/release_notes.py [--tag TAG]

prints it. With --tag it stops unless TAG is that version's and everything in the changelog belongs to a version.
"""

from __future__ import annotations

import argparse
import re
import tomllib

from targets import ROOT

CHANGELOG = ROOT / "CHANGELOG.md"


def version() -> str:
    """The version of everything here."""
    workspace = tomllib.loads((ROOT / "Cargo.toml").read_text(encoding="utf-8"))["workspace"]
    return str(workspace["package"]["version"])


def notes(changelog: str, version: str) -> str:
    """The section of this version, without its heading."""
    for heading, text in sections(changelog):
        if _version_in(heading) == version:
            return f"{text.strip()}\n"
    raise SystemExit(
        f"error: CHANGELOG.md has no section for {version}, the version in Cargo.toml; "
        f"give what changed a heading that begins with `## {version}`"
    )


def check_tag(tag: str, changelog: str, version: str) -> None:
    """Stops unless what was tagged is this version, and all of it."""
    if tag != f"v{version}":
        raise SystemExit(
            f"error: the tag is {tag}, but the version in Cargo.toml is {version}; "
            f"tag the commit v{version}, or change the version first"
        )
    newest, _ = sections(changelog)[0]
    if _version_in(newest) != version:
        raise SystemExit(f"error: CHANGELOG.md has '## {newest}' above {version}; move it into that section")
    if not re.fullmatch(r"\S+ \(\d{4}-\d\d-\d\d\)", newest):
        raise SystemExit(f"error: CHANGELOG.md has no date in '## {newest}'; write '## {version} (YYYY-MM-DD)'")


def sections(changelog: str) -> list[tuple[str, str]]:
    """Headings and texts."""
    _, *parts = re.split(r"^## (.*)\n", changelog, flags=re.MULTILINE)
    return list(zip(parts[::2], parts[1::2]))


def _version_in(heading: str) -> str:
    return re.split(r"[\s,(:]", heading)[0]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tag")
    options = parser.parse_args()
    changelog = CHANGELOG.read_text(encoding="utf-8")
    text = notes(changelog, version())
    if options.tag is not None:
        check_tag(options.tag, changelog, version())
    print(text, end="")


if __name__ == "__main__":
    main()
