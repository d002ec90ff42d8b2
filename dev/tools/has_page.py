"""`python dev/tools/has_page.py FMU` succeeds if the FMU contains the page that runs it. The Makefile calls it before there is an
environment, so it needs the standard library only."""

import sys
import zipfile

#: Only the script of the page contains this call.
MARK = b".catch(showFailure)"


def has_page(path: str) -> bool:
    """Whether the FMU contains the page; False also if the file does not exist or is damaged."""
    try:
        with zipfile.ZipFile(path) as fmu:
            return MARK in fmu.read("documentation/index.html")
    except (OSError, KeyError, zipfile.BadZipFile):
        return False


if __name__ == "__main__":
    sys.exit(not has_page(sys.argv[1]))
