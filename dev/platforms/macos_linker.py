#!/usr/bin/env python3
"""Starts Rust's linker for macOS, named by RUST_LLD. Converts the -Wl arguments of maturin, which are for a C compiler."""

import os
import sys

if __name__ == "__main__":
    arguments = [part for a in sys.argv[1:] for part in (a.split(",")[1:] if a.startswith("-Wl,") else [a])]
    os.execv(os.environ["RUST_LLD"], [os.environ["RUST_LLD"], *arguments])
