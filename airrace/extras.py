"""Packages that only some outputs need, each an extra of the installation."""

from importlib import import_module
from types import ModuleType

from airrace.errors import UsageError


def extra(package: str, what: str, name: str = "") -> ModuleType:
    """Return a package that comes with an extra.

    Args:
        package: its name, or that of a module in it.
        what: what it is needed for.
        name: of the extra; empty where it has the name of the package.

    Raises:
        UsageError: it is not installed; says how to install it.
    """
    try:
        return import_module(package)
    except ModuleNotFoundError as error:
        needed = package.partition(".")[0]
        raise UsageError(f"{what} needs {needed}: pip install 'airrace[{name or needed}]'") from error
