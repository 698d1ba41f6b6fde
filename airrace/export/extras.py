"""Packages that only some exports need."""

from importlib import import_module
from types import ModuleType

from airrace.errors import UsageError


def extra(package: str, what: str) -> ModuleType:
    """Return a package that comes with the extra of the same name.

    Args:
        package: its name.
        what: what it is needed for.

    Raises:
        UsageError: it is not installed; says how to install it.
    """
    try:
        return import_module(package)
    except ModuleNotFoundError as error:
        raise UsageError(f"{what} needs {package}: pip install 'airrace[{package}]'") from error
