"""The page of the files of the package: every module with the first sentence of its docstring, room by room."""

import ast
from pathlib import Path

OPENING = """# Files of the package

Every module with the first sentence of its docstring. [Architecture](architecture.md) explains the rooms."""


def module_page(package: Path) -> str:
    """The page in Markdown, a table for each folder of the package that holds modules."""
    parts = [OPENING]
    for folder in sorted({path.parent for path in package.rglob("*.py")}):
        modules = sorted(path for path in folder.glob("*.py") if path.stem != "__init__")
        about = sentence(folder / "__init__.py") if (folder / "__init__.py").exists() else ""
        rows = [f"| `{path.name}` | {sentence(path)} |" for path in modules]
        table = "\n".join(["| file | what it is |", "|---|---|", *rows])
        parts += [
            f"## {folder.relative_to(package.parent).as_posix()}",
            *([about] if about else []),
            *([table] if rows else []),
        ]
    return "\n\n".join(parts) + "\n"


def sentence(path: Path) -> str:
    """The first sentence of a module's docstring."""
    docstring = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
    return " ".join(docstring.split("\n\n")[0].split()).replace("|", "\\|")
