"""The page of the Python API: every public name of the package, with its docstring."""

import inspect

import airrace

MODULES = {
    "Exports": ("airrace.files.export",),
    "Sensitivities": ("airrace.flights.sensitivity",),
    "Checkpoints": ("airrace.files.checkpoint",),
    "Fidelities, kinds of gates and limits": (
        "airrace.procedure.fidelity",
        "airrace.model.track.element",
        "airrace.files.inputs.kinds.kind",
        "airrace.model.dynamics.own_limits",
    ),
    "Problems of one's own": (
        "airrace.optimal_control.definition",
        "airrace.optimal_control.first_guess",
        "airrace.optimal_control.solve_problem",
        "airrace.optimal_control.solution",
        "airrace.optimal_control.own_certificate",
        "airrace.optimal_control.problem",
        "airrace.optimal_control.quantities",
        "airrace.optimal_control.system",
    ),
    "Errors": ("airrace.errors",),
}
"""Modules whose public names are shown as well, by heading."""

OPENING = """# Python API

Everything in the first two sections can be imported from `airrace`; names are looked up when they are first used, so
`import airrace` is quick. [The tutorial](../tutorial.md) shows how they are used together. The optimizer knows
nothing of aircraft: [A problem of your own](../engine.md) shows how the last modules are used.
"""


def api_page() -> str:
    """The page in Markdown, with a directive to mkdocstrings for every name."""
    functions = [name for name in public_names() if not inspect.isclass(getattr(airrace, name))]
    classes = [name for name in public_names() if name not in functions]
    sections = {"Functions": map(home_of, functions), "Classes": map(home_of, classes), **MODULES}
    directives = [
        "\n\n".join([f"## {heading}", *(f"::: {path}" for path in paths)]) for heading, paths in sections.items()
    ]
    return "\n\n".join([OPENING.strip(), *directives]) + "\n"


def public_names() -> list[str]:
    """What the package offers, in alphabetical order."""
    return sorted(name for name in dir(airrace) if not name.startswith("_"))


def home_of(name: str) -> str:
    """Where a public name is defined: its documentation is read there."""
    found = getattr(airrace, name)
    return f"{found.__module__}.{found.__qualname__}"
