"""A command made of a public function: its signature says which arguments and options there are."""

import inspect
import re
from collections.abc import Callable, Mapping, Sequence
from enum import Enum
from functools import partial
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

import typer
from typer.core import TyperCommand

from airrace.cli.completion import COMPLETIONS
from airrace.cli.printed_result import printed_result
from airrace.options import Option

# Any, throughout this module: signatures and their types are read at run time, and contexts and parameters belong to
# click, whose place depends on typer's version.

AsJson = Annotated[bool, Option("Print one JSON object on stdout.", flags=("--json",))]
Quiet = Annotated[bool, Option("Print nothing but what goes wrong.", flags=("--quiet", "-q"))]
Verbose = Annotated[bool, Option("Tell on stderr what is read, written and begun.", flags=("--verbose", "-v"))]
_COMMON = {"as_json": AsJson, "quiet": Quiet, "verbose": Verbose}
_SECTION = re.compile(r"^(Args|Examples|Raises|Returns):$", re.MULTILINE)


class Command(TyperCommand):
    """A command whose option `--dry-run`, say, is also read from `AIRRACE_COMMAND_DRY_RUN`."""

    def make_context(self, info_name: str | None, args: list[str], parent: Any = None, **extra: Any) -> Any:
        words = [info_name or ""]
        group = parent
        while group is not None and group.parent is not None:  # up to the program's own
            words.insert(0, group.info_name)
            group = group.parent
        for parameter in self.params:
            with_variable: Any = parameter
            option = max(with_variable.opts, key=len)
            if option.startswith("--") and option != "--help":
                with_variable.envvar = "_".join(["AIRRACE", *words, option[2:]]).replace("-", "_").upper()
                with_variable.show_envvar = False
        return super().make_context(info_name, args, parent, **extra)


def command(
    function: Callable[..., object], *, without: Sequence[str] = (), help: str = ""
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Make a command of a public function and of what renders what that returns.

    What renders takes a result to fill in, the function with the user's arguments, and options of the command line
    alone. The command takes the arguments and options of both, and `--json`, `--quiet` and `--verbose`; it prints the
    result, and ends with its exit code.

    Args:
        function: its arguments with an `Option` are those of the command, its docstring is the help.
        without: names of parameters that the command does not have, `as_json` and `quiet` among them.
        help: another help.
    """

    def decorate(render: Callable[..., None]) -> Callable[..., None]:
        own = list(inspect.signature(render).parameters.values())[2:]
        common = [
            inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=False, annotation=annotation)
            for name, annotation in _COMMON.items()
        ]
        called = [parameter for parameter in inspect.signature(function).parameters.values() if _option(parameter)]
        shown = [parameter for parameter in (*called, *own, *common) if parameter.name not in without]
        renderers = {parameter.name for parameter in own}
        outputs = [parameter.name for parameter in shown if (option := _option(parameter)) and option.written]
        signature = inspect.Signature(
            [_typer_parameter(parameter, is_first=parameter is shown[0]) for parameter in shown]
        )

        def run(*arguments: Any, **keywords: Any) -> None:
            bound = signature.bind(*arguments, **keywords)
            bound.apply_defaults()
            values = {parameter.name: _value(parameter, bound.arguments[parameter.name]) for parameter in shown}
            as_json, quiet, verbose = (bool(values.pop(name, False)) for name in _COMMON)
            with printed_result(as_json=as_json, quiet=quiet, verbose=verbose) as command_result:
                command_result.ensure_room(*(values[name] for name in outputs))
                rendering = {name: values.pop(name) for name in renderers}
                render(command_result, _call(function, values), **rendering)

        run.__name__, run.__module__ = render.__name__, render.__module__
        prose, *_ = _SECTION.split(inspect.getdoc(function) or "")  # sections tell of arguments, results and errors
        run.__doc__ = help or prose.strip()
        run.__annotations__ = {name: parameter.annotation for name, parameter in signature.parameters.items()}
        run.__signature__ = signature  # pyright: ignore[reportFunctionMemberAccess]  # what `inspect` and typer look up
        return run

    return decorate


def _call(function: Callable[..., object], values: Mapping[str, Any]) -> partial[object]:
    """Return the function with its arguments; where it takes any number of them, they are given by position."""
    keywords, positional = dict(values), list[Any]()
    parameters = inspect.signature(function).parameters.values()
    if any(parameter.kind is parameter.VAR_POSITIONAL for parameter in parameters):
        for parameter in parameters:
            if parameter.kind is parameter.POSITIONAL_OR_KEYWORD:
                positional.append(keywords.pop(parameter.name))
            elif parameter.kind is parameter.VAR_POSITIONAL:
                positional += keywords.pop(parameter.name)
    return partial(function, *positional, **keywords)


def _option(parameter: inspect.Parameter) -> Option | None:
    """Return the option that a parameter is annotated with; None where it has none."""
    metadata = get_args(parameter.annotation)[1:] if get_origin(parameter.annotation) is Annotated else ()
    return next((entry for entry in metadata if isinstance(entry, Option)), None)


def _typer_parameter(parameter: inspect.Parameter, *, is_first: bool) -> inspect.Parameter:
    """Return a parameter as typer reads it: positional ones are arguments unless they have flags, all others options.

    Of any number of arguments one is needed if they are the first ones, unless the option says otherwise.
    """
    option = _option(parameter)
    if option is None:
        raise TypeError(f"the parameter {parameter.name} has no option")
    type_, several = _command_type(parameter, option)
    is_argument = parameter.kind is not parameter.KEYWORD_ONLY and not option.flags
    default = parameter.empty if option.required else parameter.default
    if several and (default is not parameter.empty or (is_argument and (option.optional or not is_first))):
        default = None
    info: Any
    common: dict[str, Any] = {"help": option.help, "metavar": option.metavar, "readable": False}
    common["autocompletion"] = COMPLETIONS.get(option.completion)
    if option.min is not None or option.max is not None:
        common |= {"min": option.min, "max": option.max}
    if is_argument:
        info = typer.Argument(**common)
    else:
        name = parameter.name.rstrip("_").replace("_", "-")
        info = typer.Option(*option.flags or [f"--no-{name}" if default is True else f"--{name}"], **common)
    annotation: Any = list[type_] if several else type_
    if default is None:
        annotation = annotation | None
    if default is True:
        default = False
    kind = inspect.Parameter.POSITIONAL_OR_KEYWORD if is_argument else inspect.Parameter.KEYWORD_ONLY
    return parameter.replace(kind=kind, default=default, annotation=Annotated[annotation, info])


def _command_type(parameter: inspect.Parameter, option: Option) -> tuple[Any, bool]:
    """Return the type that the command line reads, and whether there may be several values.

    Of several types that Python takes it is the narrowest: a path rather than a text, a choice rather than both.
    """
    several = parameter.kind is parameter.VAR_POSITIONAL
    annotations, classes = [get_args(parameter.annotation)[0]], list[Any]()
    while annotations:
        annotation = annotations.pop()
        origin = get_origin(annotation)
        if origin in (Union, UnionType):
            annotations += get_args(annotation)
        elif origin is Sequence:
            several = True
            annotations += get_args(annotation)
        elif isinstance(annotation, type):
            classes.append(annotation)
    if option.choices:
        return Enum(parameter.name, {text: text for text in option.choices}), several
    enums = [type_ for type_ in classes if issubclass(type_, Enum)]
    return next(type_ for type_ in (*enums, bool, Path, float, int, str) if type_ in classes), several


def _value(parameter: inspect.Parameter, value: Any) -> Any:
    """Return a value as the function takes it, of one that typer has read."""
    option = _option(parameter)
    if option is not None and option.choices and isinstance(value, Enum):
        return value.value
    if parameter.default is True:  # the option is the one that says no
        return not value
    if value is None and parameter.kind is parameter.VAR_POSITIONAL:
        return ()
    if value is None and parameter.default is not parameter.empty:
        return parameter.default
    return value
