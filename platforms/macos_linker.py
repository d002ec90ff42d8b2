#!/usr/bin/env python3
"""Rust's own linker for macOS, told without -Wl what maturin tells a C compiler. The linker is in PRW_RUST_LLD."""

import os
import sys


def main() -> None:
    linker = os.environ["PRW_RUST_LLD"]
    split = [part for a in sys.argv[1:] for part in (a.split(",")[1:] if a.startswith("-Wl,") else [a])]
    os.execv(linker, [linker, *split])


if __name__ == "__main__":
    main()
