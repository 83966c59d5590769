"""Packages that only part of condyle needs, with a clear word where one is missing."""

from __future__ import annotations

from importlib.util import find_spec

from .errors import MissingExtraError


def require(package: str, extra: str) -> None:
    """Raises MissingExtraError if a package of an optional part is not installed.

    Args: extra: of `pyproject.toml` that brings the package.
    """
    if find_spec(package) is None:
        raise MissingExtraError(package, extra)
