"""The page's script: modules of JavaScript joined into one, so that a page is one file and nothing has to be built.

A module is a file of `airrace/pages/report/script/` or of a library. Joined, each becomes a function that is called
once and returns what the module exports. Two forms of import and of export are known, those that the files use:

    import { A, B as C } from "./module.js";        export function f() { ... }   (class, const likewise)
    import{A as a}from"./module.min.js"             export{a as A,b}              (or, from another module)
"""

import functools
import re
from collections.abc import Callable
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
    return join_modules(FOLDER / "script" / "main.js")


def join_modules(main: Path) -> str:
    """Return a module and all that it imports as one script, in an order in which each stands behind what it imports.

    Raises:
        ValueError: modules import one another in a circle, or a file has an import or an export in another form, or a
            text that would end the script's element in a page.
    """
    modules: dict[Path, str] = {}

    def add(path: Path, above: tuple[Path, ...] = ()) -> str:
        """Put a module behind all that it imports; return the expression that holds its exports."""
        if path in above:
            raise ValueError(f"{path.name} imports itself by way of {', '.join(importer.name for importer in above)}")
        if path not in modules:

            def load(name: str) -> str:
                return add((MODULES.get(name) or path.parent / name).resolve(), (*above, path))

            modules[path] = _as_function(path, load)
        return f"modules[{list(modules).index(path)}]"

    add(main.resolve())
    script = '"use strict";\nconst modules = [];\n' + "".join(modules.values())
    if _ENDS_SCRIPT.search(script):
        raise ValueError("a module holds a text that would end the script in a page")
    return script


def _as_function(path: Path, load: Callable[[str], str]) -> str:
    """Return a module as the call of a function that returns its exports; `load` gives those of another module."""
    text = path.read_text(encoding="utf-8")
    exports: list[str] = [*GLOBALS.get(path, ())]

    def import_names(match: re.Match[str]) -> str:
        pairs = (name if name == own else f"{name}: {own}" for name, own in _names(match[1]))
        return f"const {{{', '.join(pairs)}}} = {load(match[2])};"

    def pass_on(match: re.Match[str]) -> str:
        module = load(match[2])
        exports.extend(f"{name}: {module}.{own}" for own, name in _names(match[1]))
        return ";"

    def export_list(match: re.Match[str]) -> str:
        exports.extend(own if name == own else f"{name}: {own}" for own, name in _names(match[1]))
        return ";"

    for form, by in ((_IMPORT, import_names), (_EXPORT_FROM, pass_on), (_EXPORT_LIST, export_list)):
        text = form.sub(by, text)
    exports += [name for _, name in _EXPORTED.findall(text)]
    text = _EXPORTED.sub(r"\1 \2", text)
    for form in _LEFT_OVER:
        if (left := form.search(text)) is not None:
            raise ValueError(f"{path.name}: {text[left.start() :][:80]!r} has a form that is not known")
    return f"// {path.name}\nmodules.push((() => {{\n{text}\nreturn {{{', '.join(exports)}}};\n}})());\n"


def _names(text: str) -> list[tuple[str, str]]:
    """Return pairs of a name and what it is called on the other side."""
    pairs = (part.strip().partition(" as ") for part in text.split(",") if part.strip())
    return [(name.strip(), alias.strip() or name.strip()) for name, _, alias in pairs]
