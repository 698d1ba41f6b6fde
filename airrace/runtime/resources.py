"""Files that come with the package, and packages that only some outputs need.

Nothing heavy is imported here, for completion in the shell asks this module.
"""

from importlib import import_module
from pathlib import Path
from types import ModuleType

from airrace.errors import UsageError

PACKAGE = Path(__file__).parents[1]


def shipped_folder(name: str) -> Path:
    """Return the folder of the courses (`tracks`) or of the aircraft (`configs`) that come with the package.

    In an installed package it lies in the package's own folder `shipped`. In a source tree, and where the package is
    installed from one as editable, it is the folder of that tree, so that an edited file counts at once.
    """
    installed = PACKAGE / "shipped" / name
    return installed if installed.is_dir() else PACKAGE.parent / name


def extra(package: str, what: str, name: str = "") -> ModuleType:
    """Return a package that comes with an extra.

    Args:
        package: its name, or that of a module in it.
        what: what it is needed for.
        name: of the extra; empty where it has the name of the package.

    Raises:
        UsageError: it is not installed; with how to install it.
    """
    try:
        return import_module(package)
    except ModuleNotFoundError as error:
        needed = package.partition(".")[0]
        raise UsageError(f"{what} needs {needed}: pip install 'airrace[{name or needed}]'") from error
