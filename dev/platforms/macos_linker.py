#!/usr/bin/env python3
"""Rust's own linker for macOS, in RUST_LLD. maturin adds arguments for a C compiler, which begin with -Wl."""

import os
import sys

if __name__ == "__main__":
    arguments = [part for a in sys.argv[1:] for part in (a.split(",")[1:] if a.startswith("-Wl,") else [a])]
    os.execv(os.environ["RUST_LLD"], [os.environ["RUST_LLD"], *arguments])
