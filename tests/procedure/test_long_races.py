"""How exactly the race time of a long race is known: as exactly, per minute, as that of a short one."""

import dataclasses

import pytest
from test_meshing import LIMITS, RESTLESS, flown

from airrace.optimal_control.certificate import RACE_TIME_CHANGE, Item
from airrace.procedure.certification import certify
from airrace.procedure.refinement import adapt
from airrace.procedure.settings import LONG_RACE


@pytest.mark.parametrize("duration", [1.0, 55.0, 80.0, LONG_RACE])
def test_short_races_share_one_limit(duration: float) -> None:
    assert LIMITS.race_time_of(duration) == LIMITS.race_time


@pytest.mark.parametrize("races", [2, 64])
def test_limit_of_a_long_race_grows_with_its_duration(races: int) -> None:
    assert LIMITS.race_time_of(races * LONG_RACE) == pytest.approx(races * LIMITS.race_time, rel=1e-15)


def test_tightened_limit_grows_likewise() -> None:
    tight = dataclasses.replace(LIMITS, race_time=0.002)
    assert tight.race_time_of(3.0 * LONG_RACE) == pytest.approx(0.006, rel=1e-15)


@pytest.mark.parametrize(("share", "holds"), [(0.9, True), (1.1, False)])
@pytest.mark.parametrize("races", [0.5, 4.0])
def test_certificate_measures_with_the_limit_of_its_race(races: float, share: float, holds: bool) -> None:
    duration = races * LONG_RACE
    optimum = flown(durations=(0.75 * duration, 0.25 * duration))
    audited = dataclasses.replace(optimum.evidence.check, items=(Item("replay_defect", 0.0, 1.0),))
    limit = LIMITS.race_time * max(1.0, races)
    certificate = certify(
        optimum.problem,
        optimum.iterate,
        dataclasses.replace(optimum.evidence, check=audited),
        LIMITS,
        claim=Item("solver", 0.0, 0.0),
        status="solved",
        kkt_error=0.0,
        coarser_race_time=duration + share * limit,
    )
    (item,) = (one for one in certificate.items if one.name == RACE_TIME_CHANGE)
    assert item.limit == pytest.approx(limit, rel=1e-12)
    assert item.value == pytest.approx(share * limit, rel=1e-9)
    assert item.holds is holds


@pytest.mark.parametrize(("minutes", "cut"), [(1.0, True), (2.0, True), (4.0, False)])
def test_error_that_is_too_large_for_a_short_race_needs_no_finer_mesh_in_a_long_one(minutes: float, cut: bool) -> None:
    erring = {3: 0.8 * LIMITS.race_time, 12: 0.4 * LIMITS.race_time}
    optimum = flown({"drift": RESTLESS, "integration": erring}, (40.0 * minutes, 20.0 * minutes))
    assert (adapt(optimum, LIMITS, early=True, joining=True) is not None) is cut
