"""Optimal control of any system: problems in phases, solved, certified and looked at by name.

    from airrace.optimal_control import Interval, Phase, Quantity, at, define_problem, solve, uniform

The public names and their modules are those that the stub `__init__.pyi` imports; each is looked up when it is first
used, so that a part of the package loads nothing of the others.
"""

_modules: dict[str, str] = {}
"""The module of every public name."""


def __getattr__(name: str) -> object:
    from importlib import import_module

    names = __dir__()
    if name == "__all__":
        return names
    if name not in names:
        raise AttributeError(f"module 'airrace.optimal_control' has no attribute {name!r}")
    return getattr(import_module(_modules[name]), name)


def __dir__() -> list[str]:
    if not _modules:
        from airrace.runtime.public_names import modules_of_names

        _modules.update(modules_of_names(__file__))
    return sorted(_modules)
