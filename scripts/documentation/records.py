"""Records, told to mkdocstrings as the dataclasses that they are, so that their parameters are shown.

It knows dataclasses by their decorator alone.
"""

from griffe import Class, Expr, ExprCall, ExprName, Extension

RECORD = "airrace.records.record"
DATACLASS = ExprName("dataclass", parent=ExprName("dataclasses"))


class Records(Extension):
    """Gives every record the decorator of a dataclass."""

    def on_class_instance(self, *, cls: Class, **_: object) -> None:
        """Called for every class as it is read, before dataclasses are looked for."""
        for decorator in cls.decorators:
            value = decorator.value
            if isinstance(value, Expr) and value.canonical_path == RECORD:
                decorator.value = ExprCall(DATACLASS, value.arguments) if isinstance(value, ExprCall) else DATACLASS
                cls.labels.add("dataclass")
