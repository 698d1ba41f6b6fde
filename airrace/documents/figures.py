"""What one mention of an element in a course is flown as: mostly one passage, two for a quad or a vertical roll."""

from dataclasses import dataclass

from airrace.documents.nodes import KeyPath
from airrace.track.course import Direction
from airrace.track.gates import Element, Gate, Manoeuvre
from airrace.track.limits import Roll
from airrace.track.polygons import Point


@dataclass(frozen=True)
class Step:
    """One passage of a figure.

    Attributes:
        direction: None where the mention says it.
        roll: flown on the leg that ends here.
    """

    element: Element
    direction: Direction | None = None
    roll: Roll | None = None


@dataclass(frozen=True)
class Figure:
    """An element of the file by its name there; `free_directions`: each passing may be planned for itself."""

    name: str
    steps: tuple[Step, ...]
    free_directions: bool = True

    @property
    def path(self) -> KeyPath:
        return ("gates", self.name)

    @property
    def has_direction(self) -> bool:
        return isinstance(self.steps[0].element, Gate)

    @property
    def position(self) -> tuple[Point, float] | None:
        """Where it stands, and its nominal height (m); None where that is free."""
        element = self.steps[0].element
        if not isinstance(element, Manoeuvre):
            return Point(element.north, element.east), element.height
        fixed = element.position
        return None if fixed is None else (Point(fixed[0], fixed[1]), fixed[2])


def base_name(name: str) -> str:
    """The name in the file of an element that is one step of a figure: `q` of `q/1`."""
    return name.partition("/")[0]
