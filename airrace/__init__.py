"""Minimum-time air races: the fastest flight through a course, certified.

    import airrace

    run = airrace.optimize("rovinj_2014", until="point-mass")
    run.race_time, run.splits, run["point-mass"].to_dataframe(), run.save("rovinj.h5")

The functions are the commands, their keyword arguments the commands' options. The public names and their modules are
those that the stub `__init__.pyi` imports; each is looked up when it is first used, so that `import airrace` (and
`airrace --help`) stays quick.
"""

_modules: dict[str, str] = {}
"""The module of every public name."""


def _load_names() -> None:
    """Read the stub."""
    import ast  # not before a name is looked up, for it takes as long to load as the rest of this module
    from pathlib import Path

    for statement in ast.parse(Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8")).body:
        if isinstance(statement, ast.ImportFrom) and statement.module is not None:
            _modules.update({alias.name: statement.module for alias in statement.names})


def __getattr__(name: str) -> object:
    from importlib import import_module

    if not _modules:
        _load_names()
    if name == "__all__":
        return sorted(_modules)
    if name not in _modules:
        raise AttributeError(f"module 'airrace' has no attribute {name!r}")
    return getattr(import_module(_modules[name]), name)


def __dir__() -> list[str]:
    if not _modules:
        _load_names()
    return sorted(_modules)
