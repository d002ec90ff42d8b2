#!/usr/bin/env python3
"""MinGW's linker, told of cargo's files by names that do not begin with where cargo's target folder happens to be.

It sorts what is imported from Windows by the names of files, and the same sources must give the same bytes wherever they
are. The folder is in PRW_TARGET_FOLDER.
"""

import os
import sys

LINKER = "x86_64-w64-mingw32-gcc"


def main() -> None:
    folder = os.environ["PRW_TARGET_FOLDER"] + os.sep
    # With ./ they come before all that are absolute, like MinGW's own.
    short = [f"./{os.path.relpath(a)}" if a.startswith(folder) else a for a in sys.argv[1:]]
    os.execvp(LINKER, [LINKER, *short])


if __name__ == "__main__":
    main()
