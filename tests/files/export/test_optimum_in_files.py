"""Mesh, phases and duals of an optimum in files: the same by name in every format, with units and signs."""

import io
from dataclasses import replace

import h5py
import numpy as np
import pytest
from example_flights import circling, half_cuban, rovinj
from scipy.io import loadmat

from airrace.files.export.earth import earth_histories
from airrace.files.export.formats import formats
from airrace.files.export.globe import BEGIN
from airrace.files.export.optimum import optimum_variables
from airrace.flights.results import Basis, Flight, History
from airrace.optimal_control.quantities import Quantity

# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false
# pyright: reportUnknownParameterType=false


def optimum() -> Flight:
    return half_cuban()["point-mass"].flight("eight")


def written(name: str, *flights: Flight) -> io.BytesIO:
    return io.BytesIO(formats()[name].write(flights, BEGIN))


def test_every_dual_quantity_is_there_by_name() -> None:
    view = half_cuban()["point-mass"]
    variables = {variable.name: variable for variable in optimum_variables(optimum())}
    costates, multipliers = view.costates, view.multipliers
    signs = {"x": ("north", 1.0), "y": ("east", 1.0), "z": ("height", -1.0)}
    for quantity in view.trajectory.states:
        name, sign = signs.get(quantity.name, (quantity.name, 1.0))
        variable = variables[f"costate_{name}"]
        np.testing.assert_array_equal(variable.values, sign * costates[quantity.name])
        assert variable.attributes["units"] == f"s/({quantity.unit})"
        assert "grows" in variable.attributes["sign"]
    np.testing.assert_array_equal(variables["hamiltonian"].values, view.hamiltonian["H"])
    assert variables["hamiltonian"].attributes["units"] == "1"
    np.testing.assert_array_equal(variables["limit_multiplier"].values, multipliers.values)
    assert tuple(variables["limit_name"].values) == multipliers.names
    own = [name.endswith(": lift coefficient") for name in multipliers.names]
    assert any(own)
    limits = np.bincount(multipliers.node[own], multipliers.values[own], minlength=len(view.trajectory.time))
    np.testing.assert_allclose(variables["multiplier_C_L"].values, limits, atol=1e-15)
    assert tuple(variables["phase_name"].values) == view.trajectory.phases
    assert variables["phase_duration"].values.sum() == pytest.approx(view.race_time)
    mesh = view.result.mesh
    np.testing.assert_array_equal(variables["mesh_reason"].values, mesh.why)
    sizes = {"node": len(view.trajectory.time), "interval": len(mesh.why), "phase": len(view.trajectory.phases)}
    for variable in variables.values():
        assert len(variable.values) == sizes.get(variable.dimension, len(multipliers.names)), variable.name


def test_hdf5_mat_and_netcdf_hold_the_same() -> None:
    xarray = pytest.importorskip("xarray")
    flight = optimum()
    hdf5 = h5py.File(written("hdf5", flight))["eight"]
    mat = loadmat(written("mat", flight), simplify_cells=True)["eight"]
    netcdf = xarray.open_dataset(written("netcdf", flight), engine="scipy", decode_times=False)
    for variable in optimum_variables(flight):
        stored = hdf5["optimum"][variable.name]
        assert stored.attrs["dimension"] == variable.dimension
        if variable.values.dtype.kind == "U":
            assert stored.asstr()[:].tolist() == variable.values.tolist()
            assert mat["optimum"][variable.name].tolist() == variable.values.tolist()
            assert netcdf[variable.name].values.tolist() == variable.values.tolist()
            continue
        np.testing.assert_array_equal(stored[:], variable.values)
        np.testing.assert_array_equal(mat["optimum"][variable.name], variable.values)
        np.testing.assert_array_equal(netcdf[variable.name].values, variable.values)
        assert netcdf[variable.name].dims == (variable.dimension,)
        for key, mats in (("units", "units"), ("sign", "signs")):
            if key in variable.attributes:
                assert stored.attrs[key] == variable.attributes[key]
                assert mat["optimum"][mats][variable.name] == variable.attributes[key]
                assert netcdf[variable.name].attrs[key] == variable.attributes[key]
    for name, history in earth_histories(flight.histories).items():
        np.testing.assert_array_equal(hdf5["histories"][name][:], history.values)
        np.testing.assert_array_equal(mat[name], history.values)
        assert hdf5["histories"][name].attrs["units"] == history.quantity.unit
    assert hdf5["passings/name"].asstr()[:].tolist() == [crossing.name for crossing in flight.crossings]


def test_optima_beside_one_another_are_numbered() -> None:
    xarray = pytest.importorskip("xarray")
    flights = (replace(optimum(), source=replace(optimum().source, label="one")), optimum())
    data = xarray.open_dataset(written("netcdf", *flights), engine="scipy", decode_times=False)
    np.testing.assert_array_equal(data["costate_V_K_1"].values, data["costate_V_K_2"].values)
    assert data["costate_V_K_2"].dims == ("interval_2",)


def test_a_flight_that_is_no_optimum_has_histories_alone() -> None:
    flight = circling(rovinj(), label="log")
    assert optimum_variables(flight) == []
    assert "optimum" not in h5py.File(written("hdf5", flight))["log"]
    assert "optimum" not in loadmat(written("mat", flight), simplify_cells=True)["log"]


def test_places_are_north_east_and_height() -> None:
    values = np.array([1.0, 2.0])

    def history(name: str) -> History:
        return History(Quantity(name, "m", lower=-5.0, upper=3.0), values, Basis.SOLVED)

    renamed = earth_histories({name: history(name) for name in ("x", "y", "z", "V_K")})
    assert list(renamed) == ["north", "east", "height", "V_K"]
    assert renamed["north"].values is not None
    np.testing.assert_array_equal(renamed["height"].values, -values)
    bounds = renamed["height"].quantity
    assert (bounds.name, bounds.lower, bounds.upper) == ("height", -3.0, 5.0)
    both = earth_histories({name: history(name) for name in ("z", "height")})
    assert list(both) == ["height"]
    np.testing.assert_array_equal(both["height"].values, values)
