"""The page's script: modules of JavaScript joined into one, so that a page is one file and nothing has to be built.

A module is a file of `airrace/report/script/` or of a library. Joined, each becomes a function that is called once and
returns what the module exports. Two forms of import and of export are known, those that the files use:

    import { A, B as C } from "./module.js";        export function f() { ... }   (class, const likewise)
    import{A as a}from"./module.min.js"             export{a as A,b}              (or, from another module)
"""

import functools
import re
from pathlib import Path

FOLDER = Path(__file__).parent
LIBRARIES = FOLDER / "libraries"
MODULES = {
    "three": LIBRARIES / "three" / "three.module.min.js",
    "uplot": LIBRARIES / "uplot" / "uPlot.iife.min.js",
}
"""Libraries by the names by which modules import them."""
GLOBALS = {LIBRARIES / "uplot" / "uPlot.iife.min.js": ("uPlot",)}
"""Libraries that are no modules, and the names that they declare."""

# Each begins with a plain word, which makes the search of a library's single long line fast; a look back sees that the
# word begins a statement.
_IMPORT = re.compile(r'import(?<![^\s;}]import)\s*\{([^}]*)\}\s*from\s*"([^"]+)";?')
_EXPORT_FROM = re.compile(r'export(?<![^\s;}]export)\s*\{([^}]*)\}\s*from\s*"([^"]+)";?')
_EXPORT_LIST = re.compile(r"export(?<![^\s;}]export)\s*\{([^}]*)\};?")
_EXPORTED = re.compile(r"export(?<![^\s;}]export)\s+((?:async\s+)?function|class|const)\s+(\w+)")
_LEFT_OVER = (
    re.compile(r"import(?<![^\n;}]import)\s*[{*\w\"]"),
    re.compile(r"export(?<![^\n;}]export)\s*[{*\w]"),
)
_ENDS_SCRIPT = re.compile(r"<(?:/script|!--)", re.IGNORECASE)


@functools.cache
def page_script() -> str:
    """Return the whole script of a report."""
    return joined(FOLDER / "script" / "main.js")


def joined(main: Path) -> str:
    """Return a module and all that it imports as one script, in an order in which each stands behind what it imports.

    Raises:
        ValueError: modules import one another in a circle, or a file has an import or an export in another form, or a
            text that would end the script's element in a page.
    """
    order: list[Path] = []
    _visit(main.resolve(), order, ())
    number = {path: place for place, path in enumerate(order)}
    parts = [_wrapped(path, number) for path in order]
    script = '"use strict";\nconst modules = [];\n' + "".join(parts)
    if _ENDS_SCRIPT.search(script):
        raise ValueError("a module holds a text that would end the script in a page")
    return script


def _visit(path: Path, order: list[Path], above: tuple[Path, ...]) -> None:
    """Put a module behind all that it imports."""
    if path in above:
        raise ValueError(f"{path.name} imports itself by way of {', '.join(one.name for one in above)}")
    if path in order:
        return
    text = path.read_text(encoding="utf-8")
    for form in (_IMPORT, _EXPORT_FROM):
        for _, name in form.findall(text):
            _visit(_file(path, name), order, (*above, path))
    order.append(path)


def _file(importer: Path, name: str) -> Path:
    return (MODULES[name] if name in MODULES else importer.parent / name).resolve()


def _wrapped(path: Path, number: dict[Path, int]) -> str:
    """Return a module as the call of a function that returns its exports."""
    text = path.read_text(encoding="utf-8")
    exports: list[str] = [*GLOBALS.get(path, ())]

    def imported(found: re.Match[str]) -> str:
        names, name = found.groups()
        return f"const {{{_pairs(names)}}} = {_module(path, name, number)};"

    def passed_on(found: re.Match[str]) -> str:
        names, name = found.groups()
        exports.extend(f"{other}: {_module(path, name, number)}.{one}" for one, other in _names(names))
        return ";"

    def exported(found: re.Match[str]) -> str:
        exports.extend(one if one == other else f"{other}: {one}" for one, other in _names(found[1]))
        return ";"

    for form, by in ((_IMPORT, imported), (_EXPORT_FROM, passed_on), (_EXPORT_LIST, exported)):
        text = form.sub(by, text)
    exports += [name for _, name in _EXPORTED.findall(text)]
    text = _EXPORTED.sub(r"\1 \2", text)
    for form in _LEFT_OVER:
        if (left := form.search(text)) is not None:
            raise ValueError(f"{path.name}: {text[left.start() :][:80]!r} has a form that is not known")
    return f"// {path.name}\nmodules.push((() => {{\n{text}\nreturn {{{', '.join(exports)}}};\n}})());\n"


def _module(importer: Path, name: str, number: dict[Path, int]) -> str:
    return f"modules[{number[_file(importer, name)]}]"


def _names(text: str) -> list[tuple[str, str]]:
    """Return pairs of a name and what it is called on the other side."""
    pairs: list[tuple[str, str]] = []
    for part in filter(None, (part.strip() for part in text.split(","))):
        name, _, other = part.partition(" as ")
        pairs.append((name.strip(), other.strip() or name.strip()))
    return pairs


def _pairs(text: str) -> str:
    return ", ".join(name if name == other else f"{name}: {other}" for name, other in _names(text))
