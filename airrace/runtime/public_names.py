"""The public names of a package, read from its stub, so that importing the package loads none of their modules."""

import ast
from pathlib import Path


def modules_of_names(package_file: str) -> dict[str, str]:
    """Return the module of every name that the stub beside a package's `__init__.py` imports.

    Args:
        package_file: the package's `__file__`.
    """
    modules: dict[str, str] = {}
    for statement in ast.parse(Path(package_file).with_suffix(".pyi").read_text(encoding="utf-8")).body:
        if isinstance(statement, ast.ImportFrom) and statement.module is not None:
            modules.update({alias.name: statement.module for alias in statement.names})
    return modules
