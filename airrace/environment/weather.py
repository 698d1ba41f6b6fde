"""The weather in which a model flies: the numbers of the day's air, and its wind."""

from collections.abc import Sequence

from airrace.environment.atmosphere import AtmosphereParameters
from airrace.environment.wind import WindField
from airrace.frames import Scalar
from airrace.records import record


@record
class Weather:
    """The air and the wind as the equations of a model see them, in symbols or numbers.

    Attributes:
        atmosphere: the numbers of the day's atmosphere.
        field: the structure of the wind, which equations depend on.
        wind: the values of `field.parameters`, which equations do not depend on.
    """

    atmosphere: AtmosphereParameters[Scalar]
    field: WindField
    wind: Sequence[Scalar] = ()
