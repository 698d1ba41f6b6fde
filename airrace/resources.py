"""The places of files that come with the package.

Nothing heavy is imported here, for completion in the shell asks this module.
"""

from pathlib import Path

PACKAGE = Path(__file__).parent


def shipped_folder(name: str) -> Path:
    """Return the folder of the courses (`tracks`) or of the aircraft (`configs`) that come with the package.

    In an installed package it lies in the package's own folder `shipped`. In a source tree, and where the package is
    installed from one as editable, it is the folder of that tree, so that an edited file counts at once.
    """
    installed = PACKAGE / "shipped" / name
    return installed if installed.is_dir() else PACKAGE.parent / name
