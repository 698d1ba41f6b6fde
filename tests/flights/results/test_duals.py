"""Costates, Hamiltonian and multipliers of a stage as named arrays, and its problem as a program of CasADi."""

import itertools

import casadi as ca
import numpy as np
import pytest
from example_flights import half_cuban

from airrace.errors import NotCertified
from airrace.procedure.stage_problem import FULL_THROTTLE


def test_the_hamiltonian_is_minus_one_and_the_costates_of_places_are_constant_within_a_leg() -> None:
    """In calm air nothing depends on x and y, so their costates change at passages alone."""
    stage = half_cuban()["point-mass"]
    np.testing.assert_allclose(stage.hamiltonian["H"], -1.0, atol=0.02)
    ends = stage.trajectory.first_node
    for name in ("x", "y"):
        costate = stage.costates[name]
        for first, last in itertools.pairwise(ends):
            leg = costate[first : last - 1]
            np.testing.assert_allclose(leg, leg[:1].repeat(len(leg)), atol=1e-7)
    assert stage.costates["V_K"][0] < 0.0  # who is faster arrives earlier
    with pytest.raises(KeyError):
        stage.costates["nothing"]


def test_multipliers_press_on_the_bounds_that_are_met() -> None:
    stage = half_cuban()["point-mass"]
    nlp, found = stage.to_casadi(), stage.multipliers
    g = np.asarray(ca.Function("g", [nlp.nlp["x"], nlp.nlp["p"]], [nlp.nlp["g"]])(nlp.x0, nlp.p)).ravel()
    rows = [place for place, name in enumerate(nlp.g_names) if not name.startswith("gap of ")]
    assert [nlp.g_names[row] for row in rows] == [
        f"{name} at node {node}" for name, node in zip(found.names, found.node.tolist(), strict=True)
    ]
    equality = nlp.lbg[rows] == nlp.ubg[rows]
    above, below = nlp.ubg[rows] - g[rows], g[rows] - nlp.lbg[rows]
    assert above.min() > -1e-6
    assert below.min() > -1e-6
    assert np.all(above[~equality & (found.values > 1e-4)] < 1e-2)
    assert np.all(below[~equality & (found.values < -1e-4)] < 1e-2)
    frame = found.to_dataframe()
    assert list(frame.columns) == ["name", "node", "time_s", "value", "unit"]


def test_the_program_of_a_stage_has_its_optimum_where_the_stage_has_it() -> None:
    stage = half_cuban()["point-mass"]
    nlp = stage.to_casadi()
    f = ca.Function("f", [nlp.nlp["x"], nlp.nlp["p"]], [nlp.nlp["f"]])
    regularisation = stage.result.provenance.regularisation
    reward = FULL_THROTTLE * float(stage.trajectory["delta_T"][-1])
    assert float(f(nlp.x0, nlp.p)) == pytest.approx(stage.race_time + regularisation - reward, abs=1e-6)
    assert len(nlp.x_names) == len(nlp.x0) == len(nlp.scale)
    assert nlp.x_names[:2] == ("x at node 0", "y at node 0")
    assert len(set(nlp.x_names)) == len(nlp.x_names)


def test_a_stage_that_is_no_optimum_has_no_costates() -> None:
    with pytest.raises(NotCertified, match="homotopy is no optimum"):
        _ = half_cuban()["homotopy"].costates
