"""Flights that are written and read back are the same flights."""

import base64
import io
import itertools
import json
import math
import os
import subprocess
import sys
import zipfile
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
import trimesh
from czml3 import Packet
from example_courses import everything, race
from example_flights import circling, half_cuban, rovinj
from geojson_pydantic import FeatureCollection
from lxml import etree
from readers import read_acmi, read_fdr, read_gpx, read_kml
from scipy.io import loadmat
from typer.testing import CliRunner

from airrace.cli.main import app
from airrace.errors import UsageError
from airrace.files.export.aircraft_model import collada, glb
from airrace.files.export.csv import export_flight_csv
from airrace.files.export.czml import czml, earth_axes
from airrace.files.export.earth import earth_histories
from airrace.files.export.fdr import fdr
from airrace.files.export.formats import Format, formats, register
from airrace.files.export.geojson import geojson
from airrace.files.export.globe import BEGIN, on_globe
from airrace.files.export.kml import GX, KML, kml
from airrace.flights.results import Flight
from airrace.model.frames import rotation
from airrace.model.track.course import Origin, metres
from airrace.model.track.element import PYLON_HEIGHT
from airrace.runs.flight_sources import begin_of, origin_of
from airrace.runs.output import output_path
from airrace.runtime import resources

KNOT, FOOT = 1852.0 / 3600.0, 0.3048
HOSTILE = '<script>alert(1)</script> ]]> & "quoted", a|bar\\ \x00\n\u202e' + "x" * 10_000


def flight(label: str = "one", **how: float) -> Flight:
    return on_globe(circling(rovinj(), label=label, **how), None).at_rate(20.0)


def two() -> list[Flight]:
    return [flight("one"), flight("two", bank=1.1, seconds=23.0)]


def written(name: str, flights: list[Flight]) -> bytes:
    return formats()[name].write(flights, BEGIN)


def degrees(one: Flight, name: str) -> np.ndarray:
    return np.degrees(one[name])


def apart(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Angles in degrees, whatever full turns lie between."""
    return np.abs(np.remainder(np.asarray(one) - other + 180.0, 360.0) - 180.0)


def test_positions_on_the_globe_lead_back_to_the_metres_of_the_course() -> None:
    one = flight()
    north, east, _ = metres(one["latitude"], one["longitude"], one.course.origin)
    np.testing.assert_allclose(north, one["x"], atol=1e-6)
    np.testing.assert_allclose(east, one["y"], atol=1e-6)
    np.testing.assert_allclose(one["altitude"], one["height"] + one.course.origin.elevation, atol=1e-9)
    elsewhere = on_globe(half_cuban().flight(), Origin(math.radians(10.0), math.radians(20.0), 300.0))
    assert np.degrees(elsewhere["latitude"][0]) == pytest.approx(10.0, abs=0.05)
    assert elsewhere["altitude"][0] == pytest.approx(elsewhere["height"][0] + 300.0)


def test_acmi_is_read_back() -> None:
    flights = two()
    objects, events = read_acmi(written("acmi", flights))
    assert objects["0"].properties["ReferenceTime"] == "2000-01-01T12:00:00Z"
    aircraft = {one.properties["CallSign"]: one for one in objects.values() if "CallSign" in one.properties}
    for one in flights:
        found = aircraft[one.label]
        assert found.properties["Type"] == "Air+FixedWing"
        place = np.array(found.places)
        np.testing.assert_allclose(found.times, one.time, atol=6e-4)
        np.testing.assert_allclose(place[:, 0], degrees(one, "longitude"), atol=1e-8)
        np.testing.assert_allclose(place[:, 1], degrees(one, "latitude"), atol=1e-8)
        np.testing.assert_allclose(place[:, 2], one["altitude"], atol=1e-3)
        for column, name in ((3, "phi"), (4, "theta"), (5, "psi")):
            assert apart(place[:, column], degrees(one, name)).max() < 0.006
        np.testing.assert_allclose(found.numbers["TAS"], one["V_A"], atol=0.006)
        np.testing.assert_allclose(found.numbers["IAS"], one["V_I"], atol=0.006)
        np.testing.assert_allclose(found.numbers["VerticalGForce"], one["n_z"], atol=6e-4)
        told = [(time, fields[2]) for time, fields in events if one.label in fields[2]]
        assert [time for time, _ in told] == pytest.approx([crossing.time for crossing in one.crossings], abs=6e-4)
        assert all(crossing.name in text for crossing, (_, text) in zip(one.crossings, told, strict=True))
        assert found.removed >= one.time[-1]
    assert len([one for one in objects.values() if one.properties.get("Name", "").startswith("gate")]) == 10


def test_fdr_is_read_back() -> None:
    one = flight()
    replay = read_fdr(written("fdr", [one]))
    columns = {name: np.array(values) for name, values in replay.columns.items()}
    np.testing.assert_allclose(columns["time"] - 12 * 3600.0, one.time, atol=6e-4)
    np.testing.assert_allclose(columns["longitude"], degrees(one, "longitude"), atol=1e-8)
    np.testing.assert_allclose(columns["latitude"], degrees(one, "latitude"), atol=1e-8)
    np.testing.assert_allclose(columns["altitude_ft"] * FOOT, one["altitude"], atol=0.002)
    for column, name in (("heading", "psi"), ("pitch", "theta"), ("roll", "phi")):
        assert apart(columns[column], degrees(one, name)).max() < 6e-4
    np.testing.assert_allclose(columns["airspeed_kts_pilot"] * KNOT, one["V_I"], atol=0.003)
    np.testing.assert_allclose(columns["g_nrml"], one["n_z"], atol=6e-4)
    marks = [mark.split(",") for mark in replay.header["MARK"]]
    assert [float(time) for time, _ in marks] == pytest.approx([one.time for one in one.crossings], abs=6e-4)
    assert [name for _, name in marks] == [crossing.name for crossing in one.crossings]
    assert len(replay.header["ACFT"]) == len(replay.header["TAIL"]) == 1
    with pytest.raises(UsageError, match="holds one flight, not 2"):
        written("fdr", two())


def test_kml_is_read_back() -> None:
    flights = two()
    placemarks, tracks = read_kml(written("kml", flights))
    assert [track.name for track in tracks] == ["one", "two"]
    for one, track in zip(flights, tracks, strict=True):
        seconds = [(when - BEGIN).total_seconds() for when in track.when]
        np.testing.assert_allclose(seconds, one.time, atol=6e-4)
        np.testing.assert_allclose(np.array(track.coordinates)[:, 0], degrees(one, "longitude"), atol=1e-8)
        np.testing.assert_allclose(np.array(track.coordinates)[:, 1], degrees(one, "latitude"), atol=1e-8)
        np.testing.assert_allclose(np.array(track.coordinates)[:, 2], one["altitude"], atol=0.006)
        for column, name in enumerate(("psi", "theta", "phi")):
            assert apart(np.array(track.angles)[:, column], degrees(one, name)).max() < 0.006
        ((shape, line),) = placemarks[f"{one.label}, line"]
        assert (shape, len(line)) == ("LineString", len(one.time))
    (gate,) = placemarks["g4"]
    origin = flights[0].course.origin
    ends = [metres(np.radians(lat), np.radians(lon), origin)[:2] for lon, lat, _ in gate[1]]
    assert [up for *_, up in gate[1]] == [PYLON_HEIGHT] * 2
    (element,) = {one.element for one in flights[0].course.passages if one.element.name == "g4"}
    posts = element.drawing().posts
    for (north, east), post in zip(ends, posts, strict=True):
        assert (float(north), float(east)) == pytest.approx((post.north, post.east), abs=2e-3)
    zipped = written("kmz", flights)
    assert zipped == written("kmz", flights)
    with zipfile.ZipFile(io.BytesIO(zipped)) as archive:
        assert archive.namelist() == ["doc.kml", "models/aircraft0.dae"]  # both have the same span
        document = archive.read("doc.kml")
    links = [one.text for one in etree.fromstring(document).iter(f"{{{KML}}}href")]
    assert links == ["models/aircraft0.dae"] * 2
    assert document.replace(b"<Model><Link><href>models/aircraft0.dae</href></Link></Model>", b"") == written(
        "kml", flights
    )


def test_a_tour_looks_at_the_aircraft_from_behind_in_the_time_of_the_flight() -> None:
    one = flight()
    (tour,) = etree.fromstring(written("kml", [one])).iter(f"{{{GX}}}Tour")
    steps = list(tour.iter(f"{{{GX}}}FlyTo"))
    assert sum(float(step.findtext(f"{{{GX}}}duration", "")) for step in steps) == pytest.approx(
        one.race_time, abs=2e-3
    )
    stamps = [step.findtext(f".//{{{KML}}}when", "") for step in steps]
    seconds = np.array([(datetime.fromisoformat(when) - BEGIN).total_seconds() for when in stamps])
    there = one.at(np.clip(seconds, one.time[0], one.time[-1]))
    looks = {
        name: np.array([float(step.findtext(f".//{{{KML}}}{name}", "")) for step in steps])
        for name in ("longitude", "latitude", "altitude", "heading")
    }
    np.testing.assert_allclose(looks["longitude"], np.degrees(there["longitude"]), atol=2e-6)
    np.testing.assert_allclose(looks["latitude"], np.degrees(there["latitude"]), atol=2e-6)
    np.testing.assert_allclose(looks["altitude"], there["altitude"], atol=0.1)
    inside = slice(5, -5)  # in a steady turn the way over some seconds has the heading of their middle
    way = np.interp(seconds, one.time, np.unwrap(np.arctan2(*(np.gradient(one[name]) for name in ("y", "x")))))
    assert apart(looks["heading"][inside], np.degrees(way)[inside] % 360.0).max() < 1.0


@pytest.mark.parametrize("span", [7.43, 10.0])
def test_models_of_aircraft_are_closed_and_their_noses_point_ahead(span: float) -> None:
    """Read by other programs: in glTF up is +Y and forward +Z, in COLLADA up is +Z and forward +Y."""
    for content, kind, axes in ((glb(span), "glb", (2, 0, 1)), (collada(span), "dae", (1, 0, 2))):
        scene = trimesh.load(io.BytesIO(content), file_type=kind)
        forward, aside, up = (scene.bounds[:, axis] for axis in axes)
        assert (aside[0], aside[1]) == pytest.approx((-span / 2, span / 2), abs=1e-3)
        assert forward[1] > 0.35 * span  # the spinner
        assert forward[0] == pytest.approx(-0.5 * span, abs=0.05 * span)  # the fin
        assert up[1] > 2.0 * -up[0]  # which is above
        assert len(scene.geometry) == 3
        for mesh in scene.geometry.values():
            mesh.merge_vertices(merge_norm=True, merge_tex=True)
            assert all(one.is_watertight for one in mesh.split(only_watertight=False))
            assert mesh.volume > 0.0


def test_czml_carries_a_model_of_the_span() -> None:
    one = flight()
    (moving,) = [packet for packet in json.loads(czml([one], BEGIN)) if "orientation" in packet]
    head, _, content = moving["model"]["gltf"].partition(",")
    assert head == "data:model/gltf-binary;base64"
    assert base64.b64decode(content) == glb(one.aircraft.airframe.b)


def test_x_plane_shows_the_aircraft_that_is_named() -> None:
    one, named = flight(), "Aircraft/Extra/330SC.acf"
    assert f"ACFT, {named}".encode() in fdr([one], BEGIN, named)
    for wrong in ("330SC", "a,b.acf", "a\nb.acf"):
        with pytest.raises(UsageError, match=r"expected a path such as"):
            fdr([one], BEGIN, wrong)


def test_gpx_is_read_back() -> None:
    flights = two()
    points, tracks = read_gpx(written("gpx", flights))
    assert set(points) == {f"g{number}" for number in range(8)}
    for one in flights:
        when, latitude, longitude, elevation = zip(*tracks[one.label], strict=True)
        np.testing.assert_allclose([(at - BEGIN).total_seconds() for at in when], one.time, atol=6e-4)
        np.testing.assert_allclose(latitude, degrees(one, "latitude"), atol=1e-8)
        np.testing.assert_allclose(longitude, degrees(one, "longitude"), atol=1e-8)
        np.testing.assert_allclose(elevation, one["altitude"], atol=0.006)


def test_geojson_is_read_back_and_outlines_run_counterclockwise() -> None:
    flights = two()
    told = json.loads(written("geojson", flights))
    assert told["type"] == "FeatureCollection"
    lines = [one for one in told["features"] if one["properties"]["kind"] == "flight"]
    for one, line in zip(flights, lines, strict=True):
        places = np.array(line["geometry"]["coordinates"])
        np.testing.assert_allclose(places[:, 0], degrees(one, "longitude"), atol=1e-8)
        np.testing.assert_allclose(places[:, 2], one["altitude"], atol=1e-3)
        assert line["properties"]["race_time_s"] == one.race_time
    passings = [one for one in told["features"] if one["properties"]["kind"] == "passing"]
    assert len(passings) == sum(len(one.crossings) for one in flights)
    for area in (one for one in told["features"] if one["geometry"]["type"] == "Polygon"):
        ring = np.array(area["geometry"]["coordinates"][0])
        assert (ring[0] == ring[-1]).all()
        assert np.sum(ring[:-1, 0] * ring[1:, 1] - ring[1:, 0] * ring[:-1, 1]) > 0.0


def test_other_readers_accept_our_geojson_and_czml() -> None:
    flights = two()
    features = FeatureCollection.model_validate_json(written("geojson", flights)).features
    assert len(features) == len(json.loads(written("geojson", flights))["features"])
    packets = json.loads(written("czml", flights))
    known = {field.alias or name for name, field in Packet.model_fields.items()}
    assert {key for packet in packets for key in packet} <= known | {"version", "clock"}


def test_geojson_is_cut_where_it_crosses_the_antimeridian() -> None:
    whole = flight()
    east = whole["y"]
    middle = Origin(math.radians(-16.8), math.pi - float(np.mean(east)) / 6.1e6, 0.0)
    told = json.loads(geojson([on_globe(whole, middle)], BEGIN))
    (line,) = [one for one in told["features"] if one["properties"]["kind"] == "flight"]
    assert line["geometry"]["type"] == "MultiLineString"
    pieces, times = line["geometry"]["coordinates"], line["properties"]["time_s"]
    assert [len(one) for one in pieces] == [len(one) for one in times]
    for piece in pieces:
        assert np.ptp([place[0] for place in piece]) < 1.0
    assert sum(len(one) for one in pieces) == len(whole.time) + 2 * (len(pieces) - 1)
    for one, other in itertools.pairwise(pieces):
        assert (one[-1][0], *one[-1][1:]) == (-other[0][0], *other[0][1:])


def test_czml_turns_the_nose_of_the_aircraft_along_its_heading() -> None:
    one = flight()
    document, *packets = json.loads(czml([one], BEGIN))
    assert (document["id"], document["version"]) == ("document", "1.0")
    (moving,) = [packet for packet in packets if "orientation" in packet]
    place = np.array(moving["position"]["cartographicDegrees"]).reshape(-1, 4)
    np.testing.assert_allclose(place[:, 0], one.time, atol=1e-8)
    np.testing.assert_allclose(place[:, 1], degrees(one, "longitude"), atol=1e-8)
    origin = one.course.origin
    R_EO = earth_axes(origin.latitude or 0.0, origin.longitude or 0.0)
    rows = np.array(moving["orientation"]["unitQuaternion"]).reshape(-1, 5)
    for k in range(0, len(rows), 29):
        _, x, y, z, w = rows[k]
        axes = np.array(rotation([w, x, y, z]))
        psi, theta, phi = (one[name][k] for name in ("psi", "theta", "phi"))
        nose = [math.cos(theta) * math.cos(psi), math.cos(theta) * math.sin(psi), -math.sin(theta)]
        np.testing.assert_allclose(axes[:, 0], R_EO @ nose, atol=1e-8)
        down = R_EO @ np.array([0.0, 0.0, 1.0])
        assert -axes[:, 2] @ down == pytest.approx(math.cos(theta) * math.cos(phi), abs=1e-8)


def test_axes_fixed_in_the_earth_are_north_east_and_down() -> None:
    """At the equator and the prime meridian north is z, east is y, down is -x."""
    np.testing.assert_allclose(earth_axes(0.0, 0.0), [[0, 0, -1], [0, 1, 0], [1, 0, 0]], atol=1e-15)
    R = earth_axes(0.7, -2.1)
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(R) == pytest.approx(1.0)


def test_netcdf_is_read_by_xarray() -> None:
    xarray = pytest.importorskip("xarray")
    flights = two()
    data = xarray.open_dataset(io.BytesIO(written("netcdf", flights)), engine="scipy", decode_times=False)
    assert data.attrs["featureType"] == "trajectory"
    assert data["rowSize"].values.tolist() == [len(one.time) for one in flights]
    assert data["flight"].values.tolist() == ["one", "two"]
    ends = np.cumsum(data["rowSize"].values)
    for one, end in zip(flights, ends, strict=True):
        rows = slice(end - len(one.time), end)
        np.testing.assert_array_equal(data["time"].values[rows], one.time)
        for name, history in earth_histories(one.histories).items():
            np.testing.assert_array_equal(data[name].values[rows], history.values)
            assert data[name].attrs["units"] == history.quantity.unit
            assert data[name].attrs["basis"] == history.basis.value
    assert not {"x", "y", "z", "node_time"} & set(data.variables)
    assert data["time"].attrs["units"] == "seconds since 2000-01-01 12:00:00"


def test_parquet_is_read_by_pyarrow() -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    flights = two()
    table = parquet.read_table(io.BytesIO(written("parquet", flights)))
    labels = np.array(table["flight"].to_pylist())
    for one in flights:
        for name, history in one.histories.items():
            np.testing.assert_array_equal(table[name].to_numpy()[labels == one.label], history.values)
            assert table.schema.field(name).metadata[b"unit"].decode() == history.quantity.unit
    about = json.loads(table.schema.metadata[b"airrace"])
    assert [one["label"] for one in about] == ["one", "two"]
    assert about[0]["passings"][1]["name"] == flights[0].crossings[1].name


def test_mat_is_read_by_scipy() -> None:
    flights = [flight("run:six-dof"), flight("run_six-dof"), flight("1")]
    content = loadmat(io.BytesIO(written("mat", flights)), simplify_cells=True)
    for name, one in zip(("run_six_dof", "run_six_dof_2", "flight_1"), flights, strict=True):
        told = content[name]
        assert told["label"] == one.label
        assert told["units"]["V_A"] == "m/s"
        np.testing.assert_array_equal(told["V_A"], one["V_A"])
        np.testing.assert_array_equal(told["time"], one.time)
        assert list(told["passings"]["name"]) == [crossing.name for crossing in one.crossings]


@pytest.mark.parametrize("name", sorted(formats()))
def test_hostile_names_reach_no_format_unescaped(name: str) -> None:
    one = flight(HOSTILE)
    one = replace(one, race=replace(one.race, course=replace(one.course, name=HOSTILE)))
    content = written(name, [one])
    assert content
    if name in ("kml", "gpx"):
        assert b"<script" not in content
        (read_kml if name == "kml" else read_gpx)(content)
    if name == "acmi":
        objects, _ = read_acmi(content)
        assert len([one for one in objects.values() if "CallSign" in one.properties]) == 1
    if name == "fdr":
        read_fdr(content.decode("utf-8").encode("ascii", "replace"))
    if name in ("czml", "geojson"):
        json.loads(content)


def test_the_table_of_a_stage_is_read_by_one_line_of_pandas(tmp_path: Path) -> None:
    pandas = pytest.importorskip("pandas")
    path = tmp_path / "run.csv"
    half_cuban()["point-mass"].to_csv(path, rate=20)
    table = pandas.read_csv(path, skiprows=6, index_col="time_s")
    one = half_cuban().flight().at(table.index.to_numpy())
    np.testing.assert_allclose(table["V_A_m_s"], one["V_A"], atol=2e-3)
    np.testing.assert_allclose(table["V_I_kt"] * KNOT, one["V_I"], atol=2e-3)
    np.testing.assert_allclose(table["height_m"], one["height"], atol=0.02)
    assert "latitude_deg" not in table
    assert set(table["phase"]) == set(half_cuban()["point-mass"].trajectory.phases)


def test_the_table_of_any_stage_is_written_by_its_name(tmp_path: Path) -> None:
    stored = half_cuban().save(tmp_path / "run.h5")
    by_name, by_option = tmp_path / "name.csv", tmp_path / "option.csv"
    assert run("csv", f"{stored}:point-mass", "--output", str(by_name)) == (0, "")
    assert run("csv", str(stored), "--stage", "point-mass", "--output", str(by_option)) == (0, "")
    assert by_name.read_bytes() == by_option.read_bytes()
    code, said = run("csv", f"{stored}:six-dof")
    assert (code, said) == (2, "airrace: this run has no stage 'six-dof'; it has: homotopy, point-mass\n")


def test_a_hostile_name_is_one_printable_line_of_the_table(tmp_path: Path) -> None:
    one = flight(HOSTILE)
    stream = io.StringIO(newline="")
    export_flight_csv(replace(one, race=replace(one.race, course=replace(one.course, name=HOSTILE))), stream)
    comments = [line for line in stream.getvalue().split("\n") if line.startswith("#")]
    assert len(comments) == 5
    assert all(line.isprintable() for line in comments)


def test_a_history_that_is_missing_is_left_out() -> None:
    one = flight()
    bare = replace(one, histories={name: one.histories[name] for name in ("x", "y", "z", "height", "V_K")})
    bare = on_globe(bare, None)
    objects, _ = read_acmi(written("acmi", [bare]))
    (found,) = [one for one in objects.values() if "CallSign" in one.properties]
    assert found.numbers == {}
    assert np.isnan(np.array(found.places)[:, 3:]).all()
    assert "orientation" not in json.loads(written("czml", [bare]))[-1]
    _, (track,) = read_kml(written("kml", [bare]))
    assert track.angles == []
    assert set(read_fdr(written("fdr", [bare])).columns["roll"]) == {0.0}


def test_a_library_that_is_missing_is_named_with_its_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> None:
        raise ModuleNotFoundError(name)

    monkeypatch.setattr(resources, "import_module", missing)
    with pytest.raises(UsageError, match=r"a Parquet file needs pyarrow: pip install 'airrace\[parquet\]'"):
        written("parquet", [flight()])


LIGHT = """
import sys
from airrace.cli.main import app
app(["export", *{arguments}], standalone_mode=False)
assert "airrace.files.export.csv" in sys.modules
print(*sorted({{"scipy.integrate", "pandas"}} & set(sys.modules)))
"""


@pytest.mark.parametrize("kind", [("csv", "--rate", "50"), ("csv",), ("parquet",)], ids=" ".join)
def test_exports_load_no_integrator_and_no_data_frames(kind: tuple[str, ...], tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    name, *how = kind
    arguments = [name, str(half_cuban().save(tmp_path / "run.h5")), *how, "--output", str(tmp_path / "out"), "-q"]
    program = LIGHT.format(arguments=arguments)
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert (tmp_path / "out").stat().st_size > 10_000
    assert ran.stdout.split() == []


def test_origins_and_starts_are_read() -> None:
    assert origin_of("45,-13.5,20") == Origin(math.radians(45.0), math.radians(-13.5), 20.0)
    assert origin_of("45,13").elevation == 0.0
    assert begin_of("2014-04-13T12:00:00+02:00") == datetime(2014, 4, 13, 10, tzinfo=UTC)
    assert begin_of("2014-04-13T12:00:00") - datetime(2014, 4, 13, 12, tzinfo=UTC) == timedelta(0)


def run(*arguments: str) -> tuple[int, str]:
    result = CliRunner().invoke(app, ["export", *arguments])
    return result.exit_code, result.stderr


def test_the_command_writes_a_course_without_an_origin_where_it_is_asked_to(tmp_path: Path) -> None:
    stored, output = half_cuban().save(tmp_path / "run.h5"), tmp_path / "run.kml"
    code, said = run("kml", str(stored), "--output", str(output))
    assert code == 2
    assert said == (
        "airrace: the course of run.h5 has no origin on the globe; say where it lies with --origin LAT,LON,ELEV\n"
    )
    assert not output.exists()
    assert run("kml", str(stored), "--output", str(output), "--origin", "48,11,500", "--rate", "5") == (0, "")
    _, (track,) = read_kml(output.read_bytes())
    assert track.coordinates[0][1] == pytest.approx(48.0, abs=0.05)
    assert run("kml", str(stored), "--output", str(output), "--origin", "48,11")[0] == 2
    assert run("netcdf", f"{stored}:point-mass") == (0, "")
    assert (tmp_path / "run.nc").read_bytes().startswith(b"CDF")


@pytest.mark.parametrize(
    ("extra", "said"),
    [
        (("--origin", "north pole"), "expected LAT,LON,ELEV"),
        (("--origin", "95,0,0"), "no place has this latitude"),
        (("--origin", "nan,0,0"), "no place has this latitude"),
        (("--rate", "0"), "cannot be exported"),
        (("--start", "yesterday"), "expected a time such as"),
    ],
)
def test_invalid_arguments_are_refused(tmp_path: Path, extra: tuple[str, ...], said: str) -> None:
    code, error = run("kml", "none.h5", "--output", str(tmp_path / "a.kml"), *extra)
    assert code == 2
    assert said in error
    assert error.count("\n") == 1


OWN_FORMAT = """
from airrace.files.export.geojson import geojson
from airrace.files.export.formats import Format, register

register(Format("labels", "Labels alone.", lambda flights, begin: flights[0].label.encode(), suffix="txt"))
"""


def test_a_format_of_an_extension_is_a_subcommand_that_writes(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(OWN_FORMAT)
    environment = {**os.environ, "AIRRACE_EXTENSIONS": str(tmp_path / "own.py")}
    checkpoint = half_cuban().save(tmp_path / "eight.h5")

    def airrace(*words: str | Path) -> "subprocess.CompletedProcess[str]":
        command = [sys.executable, "-m", "airrace", "export", *words]
        return subprocess.run(command, env=environment, cwd=tmp_path, capture_output=True, text=True, check=False)

    assert "Labels alone." in airrace("--help").stdout
    assert airrace("labels", checkpoint).returncode == 0
    assert (tmp_path / "eight.txt").read_text().startswith("eight")
    (tmp_path / "own.py").write_text("1 / 0")
    refused = airrace("--help")
    assert refused.returncode == 2
    assert "ZeroDivisionError" in refused.stderr
    assert "Traceback" not in refused.stderr
    with pytest.raises(ValueError, match="kml already"):
        register(Format("kml", "", lambda flights, begin: b""))


def test_the_table_in_a_file_is_the_one_on_stdout_and_that_of_python(tmp_path: Path) -> None:
    stored, path = half_cuban().save(tmp_path / "run.h5"), tmp_path / "run.csv"
    stage = half_cuban()["point-mass"]
    text = stage.to_csv(rate=30.0)
    assert text.count("\n") > 200
    assert stage.to_csv(path, rate=30.0) == ""
    assert path.read_bytes().decode() == text
    ran = CliRunner().invoke(app, ["export", "csv", str(stored), "--rate", "30"])
    assert (ran.exit_code, ran.stdout) == (0, text)


SOMEWHERE = Origin(0.8, 0.2, 500.0)
HOSTILE_NAME = '<script>alert(1)</script> ]]> & "quoted"\n\x00\u202e' + "x" * 10_000


@pytest.fixture(scope="module")
def schema() -> etree.XMLSchema:
    """The schema of Google's extension, which imports that of KML 2.2."""
    return etree.XMLSchema(etree.parse(str(files("pykml") / "schemas" / "kml22gx.xsd")))


def complaints(schema: etree.XMLSchema, content: bytes) -> list[str]:
    schema.validate(etree.fromstring(content))
    return [f"{one.line}: {one.message}" for one in schema.error_log]


def flights(folder: Path) -> list[Flight]:
    """Every kind of thing that a document may hold: all elements, people of all shapes, lines, an airspace, angles or
    none, names that XML cannot take as they are."""
    everywhere = on_globe(circling(race(everything(folder))), SOMEWHERE)
    histories = {name: one for name, one in everywhere.histories.items() if name not in ("psi", "theta", "phi")}
    return [
        on_globe(circling(rovinj(), label=HOSTILE_NAME), None),
        on_globe(half_cuban().flight(), SOMEWHERE),
        replace(everywhere, histories=histories),
    ]


def test_documents_are_valid_and_one_whose_coordinates_come_before_its_times_is_not(
    schema: etree.XMLSchema, tmp_path: Path
) -> None:
    everyone = flights(tmp_path)
    for some in ([everyone[0]], [everyone[1]], [everyone[2]], everyone):
        assert complaints(schema, kml(some, BEGIN)) == []
    root = etree.fromstring(kml(everyone[:1], BEGIN))
    (track,) = root.iter("{http://www.google.com/kml/ext/2.2}Track")
    track.insert(1, track.find("{http://www.google.com/kml/ext/2.2}coord"))
    assert any("when" in one for one in complaints(schema, etree.tostring(root)))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a run, which is not the current one."""
    place = tmp_path_factory.mktemp("runs")
    half_cuban().save(place / "eight.h5")
    return place


@pytest.mark.parametrize(
    ("words", "name"),
    [
        (("report",), "eight.html"),
        (("plot",), "eight.png"),
        (("plot", "--kneeboard"), "eight.kneeboard.pdf"),
        (("export", "mat"), "eight.mat"),
        (("export", "netcdf"), "eight.nc"),
    ],
)
def test_results_lie_beside_the_run_and_are_not_overwritten(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...], name: str
) -> None:
    monkeypatch.chdir(tmp_path)
    before = set(folder.iterdir())
    flight = f"{folder / 'eight.h5'}:point-mass"
    assert CliRunner().invoke(app, [*words, flight]).exit_code == 0
    assert {path.name for path in set(folder.iterdir()) - before} == {name}
    assert os.listdir(tmp_path) == []
    refused = CliRunner().invoke(app, [*words, flight])
    assert (refused.exit_code, refused.stderr.count("--force")) == (2, 1)


def test_the_name_is_that_of_the_file_without_its_stage() -> None:
    assert output_path(None, "runs/rovinj.h5:six-dof", "html") == Path("runs/rovinj.html")
    assert output_path(None, Path("logs/2014.04.12.igc"), "h5") == Path("logs/2014.04.12.h5")
    assert output_path(None, "run", "kneeboard.png") == Path("run.kneeboard.png")
