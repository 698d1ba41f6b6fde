"""Margins that keep a reserve: they leave the risk that is asked for, cost least, and tighten what they say."""

import json
import math
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from safety_courses import eight_inputs, eight_optimum, inputs, loop, optimum
from scipy.special import ndtri

import airrace
from airrace.errors import CheckpointError, InputError, OutOfTime, StorageError, UsageError
from airrace.files.checkpoint import ReserveAttempt
from airrace.files.checkpoint.checkpoint import content_digest
from airrace.files.inputs import Inputs, inputs_from_documents
from airrace.files.inputs.variation import Variation
from airrace.flights.safety.closed_loop import fly
from airrace.flights.safety.disturbances import Gusts, Scatter
from airrace.flights.safety.judge import Judge, measure
from airrace.flights.safety.monte_carlo import LOAD, closed_loop_of
from airrace.flights.safety.pilot import PilotModel
from airrace.flights.safety.reserve import STALL, Limit, allocate, limits_of
from airrace.flights.sensitivity.lagrangian import sensitivities
from airrace.model.track.gates import Gate
from airrace.optimal_control.quantities import KNOT
from airrace.procedure.planning.parameters import course_limits, with_margins
from airrace.procedure.result import Silent
from airrace.runs import reserve_search as reserves
from airrace.runs.execute import execute, unreached
from airrace.runs.execution_plan import Changes, in_force, plan_changed_run, plan_new_run, plan_resumed_run
from airrace.runs.reserve_attempts import asked_text, reserve_state
from airrace.runs.reserve_search import fly_reserve
from airrace.runs.run_state import RunState, new_run, open_run

SMALL = Scatter(Gusts.NONE, 0.1 * KNOT, 0.001, 0.001, 0.0, 0.0)
"""Disturbances so small that no limit of stick or stall counts."""


def limit(key: str, sigma: float = 0.3, **other: float) -> Limit:
    return Limit(key, "height", "1:a", 0.1, sigma, 0.1, **other)


@cache
def limits(scatter: Scatter = SMALL) -> tuple[Limit, ...]:
    return tuple(limits_of(inputs().race, optimum(), loop(), scatter, {}))


def with_overrides(*texts: str) -> Inputs:
    one = inputs()
    return inputs_from_documents(one.track, one.aircraft, one.settings_file, texts)


@pytest.mark.parametrize("risk", [0.2, 0.01, 1e-4])
def test_the_margin_from_one_limit_is_a_quantile(risk: float) -> None:
    found = allocate([limit("a", rate=2.0)], {}, risk)
    step = 4.0 * 0.3 / 80
    assert 0.0 <= found.margins["a"] - (-ndtri(risk) * 0.3 - 0.1) / 2.0 <= step
    assert found.reaches
    assert found.risks.sum() <= risk


def test_a_margin_that_costs_more_is_smaller_and_leaves_more_of_the_risk() -> None:
    found = allocate([limit("cheap"), limit("dear")], {"cheap": 0.1, "dear": 1.0}, 0.01)
    assert found.margins["cheap"] > found.margins["dear"]
    assert found.risks[1] > found.risks[0]
    assert found.risks.sum() <= 0.01
    even = allocate([limit("a"), limit("b")], {"a": 1.0, "b": 1.0}, 0.01)
    assert math.isclose(even.margins["a"], even.margins["b"])
    assert 0.1 * found.margins["cheap"] + found.margins["dear"] < 1.1 * even.margins["a"]


def test_what_cannot_be_had_is_reported_and_margins_leave_room_between_opposite_limits() -> None:
    found = allocate([limit("a", between=0.5), limit("", sigma=0.2)], {}, 0.01)
    assert not found.reaches
    assert math.isclose(found.margins["a"], 0.2)
    assert found.risks.sum() > 0.3


def test_a_kind_that_is_broken_more_often_than_predicted_gets_a_larger_margin() -> None:
    load, other = replace(limit("load"), kind=LOAD), limit("other")
    plain = allocate([load, other], {"load": 1.0, "other": 1.0}, 0.01)
    weighted = allocate([load, other], {"load": 1.0, "other": 1.0}, 0.01, {LOAD: 5.0})
    assert math.isclose(plain.margins["load"], plain.margins["other"])
    assert weighted.margins["load"] > weighted.margins["other"]
    assert weighted.risks.sum() <= 0.01
    assert math.isclose(weighted.risks[0], 5.0 * float(load.risk(np.array(weighted.margins["load"]))))


def test_a_passing_of_a_fixed_height_leaves_no_margin_beyond_it() -> None:
    found = allocate([limit("a", cap=0.2), limit("b")], {}, 1e-4)
    assert found.margins["a"] <= 0.2
    assert not found.reaches
    assert found.margins["b"] > 0.2
    given = eight_inputs()
    eight = closed_loop_of(given.race, eight_optimum(), PilotModel())
    floors = [one for one in limits_of(given.race, eight_optimum(), eight, Scatter(), {}) if one.key == "rules.floor_m"]
    assert floors
    assert all(math.isclose(one.cap, 0.1) for one in floors)  # entry and exit at 80 m, the floor at 79.9 m
    assert all(one.cap == math.inf for one in limits(Scatter()))


def test_a_limit_that_does_not_bind_needs_no_margin_and_one_that_does_keeps_the_one_it_has() -> None:
    far = replace(limit("a"), room=2.0)
    assert allocate([far], {}, 1e-3).margins == {}
    kept = allocate([limit("a")], {}, 1e-3).margins["a"]
    again = replace(limit("a"), room=0.1 + kept, present=kept)
    assert allocate([again], {}, 1e-3).margins["a"] == kept


def test_an_optimum_leaves_no_room_to_the_limits_that_cost_it_time() -> None:
    one = inputs()
    stated = [each for each in course_limits(one.race) if math.isfinite(each.value)]
    prices = sensitivities(stated, one.race, one.settings, optimum())
    costly = {each.key for each in prices if each.key.startswith("gates.") and each.weight > 1e-3}
    tight = {one.key for one in limits() if one.room < one.allowed + 0.01}
    assert costly & {one.key for one in limits()} <= tight
    assert costly & tight
    assert min(one.room - one.allowed for one in limits() if one.key.startswith("gates.")) > -0.01


def test_a_margin_takes_from_the_room_what_its_rate_says() -> None:
    """Rooms of one and the same flight, by the rules and by tighter ones."""
    amount, compared = 0.1, set[str]()
    for key in {one.key for one in limits(Scatter()) if one.key}:
        tighter = limits_of(with_margins(inputs().race, {key: amount}), optimum(), loop(), Scatter(), {})
        after = {(one.key, one.kind, one.place, round(one.sigma, 3)): one for one in tighter}
        for one in limits(Scatter()):
            other = after.get((one.key, one.kind, one.place, round(one.sigma, 3)))
            if other is not None and one.kind not in (STALL, LOAD):  # which come with the pilot's aircraft
                compared |= {key} if one.key == key else set()
                taken = max(amount - one.idle, 0.0) * one.rate if one.key == key else 0.0
                assert math.isclose(one.room - other.room, taken, abs_tol=2e-4), one
    assert {
        *("gates.last.bank_tolerance_deg", "gates.last.clearance_m", "gates.last.height_min_m"),
        *("gates.side.clearance_m", "gates.side.height_min_m", "rules.floor_m"),
    } <= compared


def test_the_room_beside_a_pylon_scatters_as_flights_do() -> None:
    """Standard deviation of 400 flights, good to 4 %."""
    one, judge = loop(), Judge.from_optimum(inputs().race, optimum(), loop())
    found = measure(judge, one, fly(one, SMALL, 3, range(400)))
    (row,) = (row for row, pylon in enumerate(judge.pylons) if pylon.name == "side")
    (near,) = (each for each in limits() if each.kind == "flight clearance" and each.key == "gates.side.clearance_m")
    assert math.isclose(float(np.std(found.nearest[row])), near.sigma, rel_tol=0.12)


def test_opposite_limits_of_a_gate_share_the_room_between_its_pylons() -> None:
    span = inputs().race.aircraft.airframe.b
    gate = next(one.element for one in inputs().race.course.passages if one.element.name == "last")
    assert isinstance(gate, Gate)
    room = gate.width - 2.0 * gate.tolerances.clearance - span
    found = [one for one in limits(Scatter()) if one.key == "gates.last.clearance_m" and one.kind == "clearance"]
    assert found
    for one in found:
        assert room < one.between < gate.width  # a wing that crosses askew, or banked, takes less than its span
        assert one.most <= 0.4 * one.between + 1e-9


def test_an_aircraft_s_own_load_factor_leaves_a_margin_of_the_rules_idle() -> None:
    race = with_overrides("rules.n_z_max=14").race
    own = race.aircraft.envelope.n_z.upper
    own_loop = closed_loop_of(race, optimum(), PilotModel())
    loads = [one for one in limits_of(race, optimum(), own_loop, Scatter(), {}) if one.key == "rules.n_z_max"]
    assert {one.idle for one in loads} == {14.0 - own}


def test_margins_tighten_a_course_and_its_rules_stay() -> None:
    plain = inputs().race
    race = with_overrides("margins.rules.floor_m=2", "margins.gates.last.clearance_m=0.25").race
    assert race.course.rules.height.lower == plain.course.rules.height.lower + 2.0
    gates = {one.element.name: one.element for one in race.course.passages}
    before = {one.element.name: one.element for one in plain.course.passages}
    assert gates["last"].tolerances.clearance == before["last"].tolerances.clearance + 0.25  # pyright: ignore[reportAttributeAccessIssue]  # both are gates
    assert race.by_rules.course == plain.course
    keys = {one.key for one in course_limits(plain) if math.isfinite(one.value)}
    for one in course_limits(with_margins(plain, dict.fromkeys(keys, 0.01))):
        if one.key in keys:
            was = next(other for other in course_limits(plain) if other.key == one.key)
            assert math.isclose(one.value, was.value - math.copysign(0.01, was.relaxing_step), abs_tol=1e-9)


def test_a_margin_costs_what_its_limit_does() -> None:
    given = with_overrides(
        *("margins.gates.side.clearance_m=0", "margins.rules.floor_m=0", "rules.reserve.probability=0.9"),
        *(f"rules.reserve.found.{text}" for text in ("measured=0.9", "lower=0.89", "reached=true")),
    )
    varied, keys = Variation(given), ("gates.side.clearance_m", "rules.floor_m")
    chosen = [varied.parameters[key] for one in keys for key in (one, f"margins.{one}")]
    found = {one.key: one for one in sensitivities(chosen, given.race, given.settings, optimum())}
    for key in keys:
        assert math.isclose(found[f"margins.{key}"].upward, found[key].upward, rel_tol=1e-6, abs_tol=1e-9)
    assert found["gates.side.clearance_m"].upward > 0.0
    race = varied.race("margins.rules.floor_m", 1.0)
    assert race.course.rules.height.lower == inputs().race.course.rules.height.lower + 1.0
    assert not [key for key in varied.parameters if key.startswith("rules.reserve")]


@pytest.mark.parametrize(
    ("text", "key", "told"),
    [
        ("margins.gates.nowhere.clearance_m=1", "margins.gates.nowhere.clearance_m", "no limits there"),
        ("margins.gates.last.clear=1", "margins.gates.last.clear", "`gates.last.clearance_m`"),
        ("margins.rules.ceiling_m=1", "margins.rules.ceiling_m", "`rules.floor_m`"),
        ("margins.gates.last.bank_tolerance_deg=40", "margins.gates.last", "no room"),
        ("margins.rules.n_z_max=9", "margins.rules", "no room"),
        ("margins.gates.last.clearance_m=-1", "margins.gates.last.clearance_m", "at least 0"),
        ("rules.reserve.probability=1", "rules.reserve.probability", "below 1"),
        ("rules.reserve.gusts=mild", "rules.reserve.gusts", "light"),
        ("margins.rules.floor_m=0.5", "margins", "finds its own"),
        ("rules.clearance=crossing", "rules.reserve", "clearance: flight"),
    ],
)
def test_margins_and_reserves_that_make_no_sense_are_refused(text: str, key: str, told: str) -> None:
    asked = any(part in text for part in ("gusts", "floor_m", "crossing"))
    with pytest.raises(InputError) as caught:
        with_overrides(text, *(["rules.reserve.probability=0.9"] if asked else []))
    assert [one.key for one in caught.value.findings] == [key]
    assert told in caught.value.findings[0].message


def test_of_overrides_the_last_ones_are_in_force() -> None:
    assert in_force(["a.b=1", "c=2", "a=null", "a.b=3", "c=4", "ab=5"]) == ("a=null", "a.b=3", "c=4", "ab=5")


def test_a_reserve_is_kept_from_the_last_stage() -> None:
    with pytest.raises(UsageError, match="leave out --until"):
        plan_new_run(with_overrides("rules.reserve.probability=0.9"), until="point-mass")


def flown() -> RunState:
    run = new_run(inputs())
    return run.with_stage(optimum())


def again(run: RunState, values: Sequence[str]) -> RunState:
    return airrace.resume(run, set=values, threads=1)


@pytest.mark.parametrize("error", [OutOfTime("no time left"), StorageError("full")])
def test_what_ends_a_run_ends_a_search(error: Exception) -> None:
    def late(*_: object) -> RunState:
        raise error

    wanted = with_overrides("rules.reserve.probability=0.9").reserve
    assert wanted is not None
    with pytest.raises(type(error)):
        fly_reserve(flown(), wanted, late, threads=1)


class Killed(Exception):
    """Stands for a signal that ends the process: nobody handles it."""


@pytest.mark.slow
def test_a_search_that_is_ended_in_its_second_attempt_goes_on_from_the_first(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """With `excess` no attempt is the last one."""
    monkeypatch.setattr(reserves, "FLIGHTS", 100)
    monkeypatch.setattr(reserves, "ALLOCATION_ITERATIONS_MAX", 1)
    monkeypatch.setattr(reserves, "EXCESS_MARGIN_SHARE", 10.0)
    given = with_overrides("rules.reserve.probability=0.6")
    path = tmp_path / "run.h5"
    run = replace(new_run(given).with_stage(optimum()), path=path)
    run.save(path)
    lines: list[str] = []

    class Watching(Silent):
        def remark(self, text: str) -> None:
            lines.append(text)
            if killing and "attempt 2" in text:
                raise Killed

    killing = False
    whole = list(execute(plan_resumed_run(run), threads=1, progress=Watching()))[-1]
    assert any("attempt 2 of 4: begins" in one for one in lines)
    run.save(path)
    killing = True
    with pytest.raises(Killed):
        list(execute(plan_resumed_run(open_run(path)), threads=1, progress=Watching()))
    left = open_run(path)
    assert len(left.attempts) == 1
    assert left.inputs.reserve == given.reserve
    assert left.stages[-1].stamp.reserve_text == (
        "0.6 asked, not reached yet: this is the line without; 1 of 4 attempts made"
    )
    planned = plan_resumed_run(left).reserve
    assert planned is not None
    assert str(planned) == "reserve 0.6: run (attempt 2 of 4 is next)"
    killing = False
    lines.clear()
    renewed = list(execute(plan_resumed_run(left), threads=1, progress=Watching()))[-1]
    assert lines[0] == "reserve 0.6, attempt 1 of 4: kept, not made again"
    assert "reserve 0.6, attempt 1 of 4: begins" not in lines
    assert renewed.race_time == whole.race_time
    assert renewed.inputs.overrides == whole.inputs.overrides
    assert content_digest(renewed.results[-1].trajectory) == content_digest(whole.results[-1].trajectory)
    assert open_run(path).attempts == ()
    assert open_run(path).stages[-1].stamp.reserve_text.startswith("0.")


def test_attempts_are_kept_with_the_stage_and_the_reserve_that_they_are_of() -> None:
    given = with_overrides("rules.reserve.probability=0.9")
    assert given.reserve is not None
    run = new_run(given).with_stage(optimum())
    one = ReserveAttempt(asked_text(given.reserve), 1000, 90, 80, 20, 0.1, 1.0, 0.5, done=False)
    none = replace(one, flights=0, broken=0, outside=0, over_g=0)
    tried = run.with_attempt(one, flown()).with_attempt(none, None)
    assert [stored.attempt for stored in tried.attempts] == [one, none]
    again = tried.attempt_run(tried.attempts[0])
    assert again is not None
    assert again.race_time == run.race_time
    assert tried.attempt_run(tried.attempts[1]) is None
    assert tried.with_stage(optimum()).attempts == ()
    other = with_overrides("rules.reserve.probability=0.8")
    assert tried.with_inputs(other).attempts == ()
    first, second = tried.checkpoint.attempts
    tampered = replace(first, attempt=replace(one, outside=10))
    assert replace(tried, checkpoint=replace(tried.checkpoint, attempts=(tampered, second))).attempts == ()
    assert replace(tried, checkpoint=replace(tried.checkpoint, attempts=(second, first))).attempts == ()


def test_counts_that_flights_do_not_confirm_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reserves, "FLIGHTS", 10)
    given = with_overrides("rules.reserve.probability=0.9", "rules.reserve.gusts=severe")
    assert given.reserve is not None
    run = new_run(given).with_stage(optimum())
    tampered = ReserveAttempt(asked_text(given.reserve), 10, 0, 0, 0, 0.1, 1.0, 0.0, done=True)
    with pytest.raises(CheckpointError, match="attempt 1 of 4 is not what was stored"):
        fly_reserve(run.with_attempt(tampered, flown()), given.reserve, again, threads=1)


def test_another_reserve_is_searched_for_anew_and_margins_that_stay_say_where_they_were_measured() -> None:
    found = [f"rules.reserve.found.{text}" for text in ("measured=0.93", "lower=0.91", "reached=true")]
    given = with_overrides("margins.rules.floor_m=0.1", "rules.reserve.probability=0.9", *found)
    run = replace(new_run(given).with_stage(optimum()), path=Path("calm.h5"))
    harder = plan_changed_run(run, Changes(overrides=["rules.reserve.probability=0.95"]))
    assert harder.run.inputs.margins == {}
    assert harder.reserve is not None
    windy = plan_changed_run(run, Changes(overrides=["environment.wind.speed_m_s=6"]))
    assert windy.run.inputs.margins == given.margins
    assert windy.reserve is None
    state = reserve_state(windy.run.inputs.reserve)
    assert state is not None
    assert state.source == "calm.h5"
    without = plan_changed_run(run, Changes(overrides=["rules.reserve=null", "margins=null"]))
    assert without.run.inputs.reserve is None


@pytest.mark.slow
@pytest.mark.parametrize("probability", [0.5, 0.9])
def test_a_reserve_is_reached_and_costs_what_its_limits_add_up_to(
    probability: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reserves, "FLIGHTS", 400)
    wanted = with_overrides(f"rules.reserve.probability={probability}").reserve
    assert wanted is not None
    case = fly_reserve(flown(), wanted, again, threads=1)
    assert case.reached
    assert case.measured.lower >= probability - 0.01
    assert case.run.race_time > case.optimum
    assert math.isclose(sum(one.cost for one in case.margins), case.run.race_time - case.optimum, rel_tol=0.2)
    assert case.run.inputs.race.by_rules.course == inputs().race.course
    json.dumps(case.as_object(), allow_nan=False)
    assert case.run.certified
    assert case.run.inputs.reserve is not None
    assert case.run.inputs.reserve.found is not None
    assert case.run.inputs.reserve.found.reached
    kept = [text.partition("=")[0] for text in case.run.inputs.overrides]
    assert len(kept) == len(set(kept))
    harder = fly_reserve(case.run, wanted.model_copy(update={"probability": 0.95}), again, threads=1)
    assert math.isclose(harder.optimum, case.optimum, abs_tol=1e-3)
    assert harder.run.race_time > case.run.race_time


@pytest.mark.slow
def test_a_reserve_that_cannot_be_had_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reserves, "FLIGHTS", 20)
    monkeypatch.setattr(reserves, "ALLOCATION_ITERATIONS_MAX", 1)
    monkeypatch.setattr(reserves, "ATTEMPTS_MAX", 1)
    wanted = with_overrides("rules.reserve.probability=0.999", "rules.reserve.gusts=severe").reserve
    assert wanted is not None
    case = fly_reserve(flown(), wanted, again, threads=1)
    assert not case.reached
    assert unreached(case.run.inputs.reserve)
    assert "was not reached" in case.message
    assert case.table().notes[-1] == case.message


@pytest.mark.slow
def test_the_command_keeps_a_reserve_stores_it_and_searches_no_more(tmp_path: Path) -> None:
    course = tmp_path / "course.yaml"
    course.write_text(inputs().track.text + "\naircraft: edge540\n")
    words = ["--reserve", "0.5", "--set", "settings.guess=plan", "--set", "settings.search=off", "--json"]
    code, told = command("optimize", str(course), "-o", str(tmp_path / "run.h5"), *words)
    assert code == 0
    assert told["reserve"]["reached"]
    assert told["reserve"]["measured_lower"] >= 0.49
    assert [one["stage"] for one in told["stages"]] == ["six-dof"]
    run = airrace.open(tmp_path / "run.h5")
    assert run.certified
    assert all(one.objection == "" for one in run.verify())
    code, again = command("resume", str(tmp_path / "run.h5"), "--json")
    assert code == 0
    assert "reserve" not in again


def command(*words: str) -> tuple[int, dict[str, Any]]:
    """Return the exit code of a command, and what it says."""
    done = subprocess.run([sys.executable, "-m", "airrace", *words], capture_output=True, text=True, check=False)
    return done.returncode, json.loads(done.stdout)
