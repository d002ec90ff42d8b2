"""Optional packages."""

from __future__ import annotations

import importlib.util

from prw.errors import MissingPackage


def need(*packages: str) -> None:
    """Raise MissingPackage unless the packages are installed."""
    missing = [name for name in packages if importlib.util.find_spec(name) is None]
    if missing:
        raise MissingPackage(f"{', '.join(missing)} missing; install with: pip install {' '.join(missing)}")
