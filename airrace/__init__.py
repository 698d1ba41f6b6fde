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
    from airrace.runtime.public_names import modules_of_names  # not before a name is looked up, for it takes long

    _modules.update(modules_of_names(__file__))


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
