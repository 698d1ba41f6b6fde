"""Aircraft of one's own: from the figures of a flight manual, and from flight logs."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from airrace import options
from airrace.options import Option

if TYPE_CHECKING:
    from airrace.runs.aircraft import ComparedAircraft


def _figure(help: str, *flags: str) -> Option:
    return Option(help, "FIGURE", flags=flags)


def estimate_aircraft(
    name: Annotated[str, Option("Name of the new aircraft, or of one that exists.", "NAME", completion="configs")],
    *,
    from_: Annotated[
        str | Path | None, Option("Take what is not given from this aircraft.", "FILE", completion="configs")
    ] = None,
    mass: Annotated[str | None, _figure("Mass that flies, with pilot and fuel, e.g. 730kg or 1610lb.")] = None,
    span: Annotated[str | None, _figure("Wing span, e.g. 7.5m or 24.6ft.")] = None,
    area: Annotated[str | None, _figure("Wing area, e.g. 10.4m2 or 112ft2.")] = None,
    power: Annotated[str | None, _figure("Power of the engine, e.g. 315hp, 235kW or 320PS.")] = None,
    speed_max: Annotated[str | None, _figure("Top speed of level flight at sea level, e.g. 185kt or 343km/h.")] = None,
    stall: Annotated[str | None, _figure("Stall speed without flaps, e.g. 55kt.")] = None,
    roll_rate: Annotated[str | None, _figure("Roll rate of full ailerons, deg/s.")] = None,
    roll_speed: Annotated[str | None, _figure("Speed of that; by default V_A, the stall's times sqrt(n_z).")] = None,
    climb: Annotated[str | None, _figure("Best rate of climb at sea level, e.g. 3200ft/min or 16m/s.")] = None,
    n_z: Annotated[str | None, _figure("Largest load factor, g.")] = None,
    n_z_min: Annotated[str | None, _figure("Least load factor, g; by default in proportion.")] = None,
    speed_limit: Annotated[str | None, _figure("Speed that is never exceeded, V_NE, e.g. 220kt.")] = None,
    turn: Annotated[str | None, _figure("Tightest level turn that is held, g; it is only compared.")] = None,
    manual_mass: Annotated[str | None, _figure("Mass at which the figures hold, if not --mass.")] = None,
    manual_power: Annotated[str | None, _figure("Power at which the figures hold, if not --power.")] = None,
    output: Annotated[
        str | Path | None, options.output("FILE.yaml", "Write the aircraft here; by default NAME.yaml.")
    ] = None,
    force: options.Force = False,
) -> "ComparedAircraft":
    """Estimate an aircraft from its flight manual, and compare it with that.

    Figures have units. What they leave open stays as in the aircraft of --from, and is marked so in the file. Without
    --from an aircraft that exists is compared with what its file gives as `published`.

    Raises:
        UsageError: a figure is no measure, or no aircraft has these figures; or the file exists.
        InputError: there is no such aircraft.
        StorageError: the folder does not exist or takes no files.
    """
    figures = dict(locals())
    from airrace.runs.aircraft import compare_with_manual

    for name_of_option in ("name", "from_", "output", "force"):
        del figures[name_of_option]
    figure_texts = {key: text for key, text in figures.items() if text is not None}
    return compare_with_manual(name, figure_texts, template=from_, output=output, force=force)
