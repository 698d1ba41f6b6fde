"""Features: what one mention of an element in a course is flown as.

It is mostly one passage; a quad or a vertical roll is flown as two.
"""

from airrace.inputs.nodes import KeyPath
from airrace.records import record
from airrace.track.course import Direction
from airrace.track.element import Element
from airrace.track.limits import Roll
from airrace.track.polygons import Point


@record
class Step:
    """A passage of a feature.

    Attributes:
        direction: None where the mention says it.
        roll: flown on the leg that ends here.
    """

    element: Element
    direction: Direction | None = None
    roll: Roll | None = None


@record
class Feature:
    """An entry of `gates` by its name, as the passages it is flown as.

    With `free_directions` each passing may be planned for itself.
    """

    name: str
    steps: tuple[Step, ...]
    free_directions: bool = True

    @property
    def path(self) -> KeyPath:
        return ("gates", self.name)

    @property
    def has_direction(self) -> bool:
        return self.steps[0].element.directed

    @property
    def position(self) -> tuple[Point, float] | None:
        """The place of the feature, and its nominal height (m); None if they are free."""
        position = self.steps[0].element.position
        return None if position is None else (Point(position[0], position[1]), position[2])


def base_name(name: str) -> str:
    """Return the name in the file of an element that is one step of a feature: `q` of `q/1`."""
    return name.partition("/")[0]
