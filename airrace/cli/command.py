"""A command whose options can also be given as environment variables."""

from collections.abc import Iterator
from typing import Any

from typer.core import TyperCommand


class Command(TyperCommand):
    """A command whose option `--dry-run`, say, is also read from `AIRRACE_COMMAND_DRY_RUN`."""

    # Any: contexts and parameters belong to click, whose place depends on typer's version.
    def make_context(self, info_name: str | None, args: list[str], parent: Any = None, **extra: Any) -> Any:
        words = [*reversed(list(_words(parent))), info_name or ""]
        for parameter in self.params:
            one: Any = parameter
            option = max(one.opts, key=len)
            if option.startswith("--") and option != "--help":
                one.envvar = "_".join(["AIRRACE", *words, option[2:]]).replace("-", "_").upper()
                one.show_envvar = False
        return super().make_context(info_name, args, parent, **extra)


def _words(context: Any) -> Iterator[str]:
    """Yield the names of the groups that a command belongs to, the innermost first and without the program's own."""
    while context is not None and context.parent is not None:
        yield context.info_name
        context = context.parent
