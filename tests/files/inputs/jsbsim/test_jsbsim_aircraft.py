"""An aircraft of JSBSim's language whose coefficients are known in closed form."""

import math
from pathlib import Path

import pytest

from airrace.errors import InputError
from airrace.files.inputs.document import AIRCRAFT
from airrace.files.inputs.jsbsim.aircraft import JsbsimAircraft, read_jsbsim_aircraft
from airrace.model.environment import RHO_ISA
from airrace.runs.aircraft_file import read_aircraft_file

TEMPLATE = read_aircraft_file(AIRCRAFT.path / "zlin50.yaml").aircraft
CURVE = "-0.2 -0.8\n0.3 1.7\n0.5 1.0\n"
LIFT = f"<table><independentVar>aero/alpha-rad</independentVar><tableData>\n{CURVE}</tableData></table>"
AREA, SPAN, CHORD = 12.0, 8.0, 1.5


def force(*terms: str) -> str:
    load = "<p>aero/qbar-psf</p><p>metrics/Sw-sqft</p>"
    return "".join(f"<function><product>{load}{term}</product></function>" for term in terms)


def moment(length: str, *terms: str) -> str:
    return force(*(f"<p>metrics/{length}</p>{term}" for term in terms))


def slope(value: float, *properties: str) -> str:
    return f"<v>{value}</v>" + "".join(f"<p>{name}</p>" for name in properties)


P_STAR = ("velocities/p-aero-rad_sec", "aero/bi2vel")
R_STAR = ("velocities/r-aero-rad_sec", "aero/bi2vel")
Q_STAR = ("velocities/q-aero-rad_sec", "aero/ci2vel")
ALPHA_STAR = ("aero/alphadot-rad_sec", "aero/ci2vel")


def document(reference_m: float = 0.0, lift: str = LIFT, engine: str = "") -> str:
    """An aircraft of which the reference point lies behind the centre of mass."""
    location = "<x>{}</x><y>0</y><z>0</z></location>"
    return f"""<fdm_config name="closed form">
      <metrics><wingarea unit="M2">{AREA}</wingarea><wingspan unit="M">{SPAN}</wingspan><chord unit="M">{CHORD}</chord>
        <location name="AERORP" unit="M">{location.format(reference_m)}</metrics>
      <mass_balance><ixx unit="KG*M2">600</ixx><iyy unit="KG*M2">900</iyy><izz unit="KG*M2">1400</izz>
        <emptywt unit="KG">700</emptywt><location name="CG" unit="M">{location.format(0.0)}
        <pointmass><weight unit="KG">50</weight><location unit="M"><x>0</x><y>2</y><z>0</z></location></pointmass>
        <pointmass><weight unit="KG">50</weight><location unit="M"><x>0</x><y>-2</y><z>0</z></location></pointmass>
      </mass_balance>
      {engine}
      <flight_control><channel>
        <aerosurface_scale><range><min>-0.4</min><max>0.4</max></range><output>fcs/elevator-pos-rad</output>
        </aerosurface_scale></channel></flight_control>
      <aerodynamics>
        <axis name="LIFT">{force(lift, slope(4.0, *Q_STAR), slope(0.4, "fcs/elevator-pos-rad"))}</axis>
        <axis name="DRAG">{
        force("<v>0.03</v>", slope(0.06, "aero/cl-squared"), slope(0.8, "aero/beta-rad", "aero/beta-rad"))
    }
        </axis>
        <axis name="SIDE">{force(slope(-0.5, "aero/beta-rad"), slope(0.2, "fcs/rudder-pos-rad"))}</axis>
        <axis name="ROLL">{
        moment(
            "bw-ft",
            slope(-0.05, "aero/beta-rad"),
            slope(-0.45, *P_STAR),
            slope(0.3, *R_STAR, "aero/alpha-rad"),
            slope(0.2, "fcs/left-aileron-pos-rad"),
        )
    }</axis>
        <axis name="PITCH">{
        moment(
            "cbarw-ft",
            slope(-0.6, "aero/alpha-rad"),
            slope(-9.0, *Q_STAR),
            slope(-3.0, *ALPHA_STAR),
            slope(-1.1, "fcs/elevator-pos-rad"),
        )
    }</axis>
        <axis name="YAW">{
        moment(
            "bw-ft", slope(0.08, "aero/beta-rad"), slope(-0.1, *R_STAR), slope(-0.09, "fcs/rudder-pos-rad"), "<random/>"
        )
    }</axis>
      </aerodynamics></fdm_config>"""


def read(folder: Path, text: str) -> JsbsimAircraft:
    path = folder / "aircraft.xml"
    path.write_text(text)
    return read_jsbsim_aircraft(path, TEMPLATE)


def test_numbers_are_those_of_the_functions(tmp_path: Path) -> None:
    result = read(tmp_path, document())
    aircraft = result.aircraft
    lift, drag, roll, pitch, yaw = aircraft.lift, aircraft.drag, aircraft.roll, aircraft.pitch, aircraft.yaw
    assert aircraft.airframe.m == pytest.approx(800.0)
    assert aircraft.airframe.I_x == pytest.approx(600.0 + 2 * 50.0 * 2.0**2)
    assert aircraft.airframe.I_y == pytest.approx(900.0)
    assert [lift.C_L0, lift.C_Lalpha, lift.C_Lq, lift.C_Leta] == pytest.approx([0.2, 5.0, 4.0, 0.4], rel=1e-6)
    assert [lift.C_L_max, lift.C_L_min] == pytest.approx([1.7, -0.8], abs=0.02)
    assert [drag.C_D0, drag.k, drag.C_L_minD, drag.C_Dbeta2] == pytest.approx([0.03, 0.06, 0.0, 0.8], abs=0.02)
    assert [roll.C_lbeta, roll.C_lp, roll.C_lxi] == pytest.approx([-0.05, -0.45, -0.2], rel=1e-6)
    # alpha is (C_L - 0.2)/5
    assert [roll.C_lr, roll.C_lr_per_C_L] == pytest.approx([-0.3 * 0.2 / 5.0, 0.3 / 5.0], rel=1e-6)
    assert [pitch.C_m0, pitch.C_malpha, pitch.C_mq] == pytest.approx([0.0, -0.6, -9.0], abs=1e-6)
    assert [pitch.C_malphadot, pitch.C_meta] == pytest.approx([-3.0, -1.1], rel=1e-6)
    assert [yaw.C_nbeta, yaw.C_nr, yaw.C_nzeta] == pytest.approx([0.08, -0.1, -0.09], rel=1e-6)
    assert aircraft.surfaces.eta.upper == pytest.approx(0.4)
    assert aircraft.surfaces.xi == TEMPLATE.surfaces.xi
    assert aircraft.propulsion == TEMPLATE.propulsion
    remarks = "\n".join(result.remarks)
    assert "YAW: the function : <random> at aircraft.xml:" in remarks
    assert "left-aileron: <flight_control> has no range" in remarks
    assert "propulsion, no engine" in remarks


def test_lift_without_a_stall_keeps_the_limits_of_the_template_and_says_so(tmp_path: Path) -> None:
    result = read(tmp_path, document(lift=slope(5.0, "aero/alpha-rad")))
    for name in ("C_L_max", "C_L_min"):
        assert getattr(result.aircraft.lift, name) == getattr(TEMPLATE.lift, name)
        assert ("lift", name) not in result.relations
        assert any(remark.startswith(f"{name}: no stall") for remark in result.remarks)
    assert ("lift", "C_Lalpha") in result.relations


def test_a_reference_point_behind_the_centre_of_mass_makes_lift_pitch_the_nose_down(tmp_path: Path) -> None:
    behind = 0.15
    pitch, shifted = (read(tmp_path, document(reference)).aircraft.pitch for reference in (0.0, behind))
    # the normal force is C_L cos(alpha) + C_D sin(alpha), nearly C_L
    assert shifted.C_malpha - pitch.C_malpha == pytest.approx(-5.0 * behind / CHORD, rel=0.02)
    assert shifted.C_m0 - pitch.C_m0 == pytest.approx(-0.2 * behind / CHORD, rel=0.05)
    assert shifted.C_meta - pitch.C_meta == pytest.approx(-0.4 * behind / CHORD, rel=0.02)


def test_an_engine_pulls_with_its_power_times_the_propellers_efficiency(tmp_path: Path) -> None:
    """With blades that can be pitched; C_P is the pitch, C_T a tenth, so that the efficiency is J C_T / C_P."""
    engine = '<propulsion><engine file="motor"><thruster file="prop"/></engine></propulsion>'
    (tmp_path / "motor.xml").write_text('<electric_engine><power unit="WATTS">150000</power></electric_engine>')
    tables = "".join(
        f'<table name="{name}"><tableData>\n0 1\n0 {low} {high}\n5 {low} {high}\n</tableData></table>'
        for name, low, high in (("C_THRUST", 0.0, 1.0), ("C_POWER", 0.0, 2.0))
    )
    limits = "<minpitch>0</minpitch><maxpitch>1</maxpitch><maxrpm>2400</maxrpm>"
    (tmp_path / "prop.xml").write_text(f'<propeller><diameter unit="M">2</diameter>{limits}{tables}</propeller>')
    result = read(tmp_path, document(engine=engine))
    n, D = 40.0, 2.0
    for V in (20.0, 60.0):
        # C_P = 2 C_T whatever the pitch: T = P / (2 n D)
        assert result.engines[0].thrust(V, RHO_ISA) == pytest.approx(150_000.0 / (2.0 * n * D), rel=1e-6)
    assert result.aircraft.tables is not None
    assert result.aircraft.tables.thrust is not None
    assert float(result.aircraft.tables.thrust(60.0, 1.0)) == pytest.approx(937.5, rel=1e-6)
    assert math.isfinite(result.aircraft.propulsion.T_static)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('<location name="CG"', '<location name="C"', 'has no <location name="CG">'),
        ('<wingspan unit="M">', '<wingspan unit="YD">', "has the unit 'YD'; read are FT, IN, M"),
        ('<emptywt unit="KG">700', '<emptywt unit="KG">nan', "must hold a number; holds 'nan'"),
        ("emptywt", "weight", "has no <emptywt>"),
        ('axis name="LIFT"', 'axis name="UP"', "is the axis 'UP' of another kind"),
        ("<v>0.03</v>", "<sqrt><p>aero/alpha-rad</p></sqrt>", "<sqrt> at aircraft.xml:\\d+ has no value at -0"),
        ("<v>0.03</v>", "<product><v>1e300</v><v>1e300</v></product>", "is not finite"),
        ("aerodynamics>", "air>", "has no <aerodynamics>"),
        ("fdm_config", "config", "is no aircraft of JSBSim"),
    ],
)
def test_what_is_wrong_is_refused_with_its_line(tmp_path: Path, old: str, new: str, message: str) -> None:
    text = document()
    assert old in text
    with pytest.raises(InputError, match=message) as refused:
        read(tmp_path, text.replace(old, new))
    assert refused.value.findings[0].line > 0


def test_a_missing_part_is_refused_at_the_line_where_its_element_begins(tmp_path: Path) -> None:
    text = "<!-- mine -->\n" + document().replace("emptywt", "weight")
    with pytest.raises(InputError) as refused:
        read(tmp_path, text)
    begin = next(number for number, line in enumerate(text.splitlines(), 1) if "<mass_balance>" in line)
    assert refused.value.findings[0].line == begin


def test_engines_are_found_from_within_the_aircrafts_own_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    hangar, engines = tmp_path / "aircraft" / "mine", tmp_path / "engine"
    hangar.mkdir(parents=True)
    engines.mkdir()
    (engines / "jet.xml").write_text("<turbine_engine/>")
    (engines / "straight.xml").write_text("<direct/>")
    engine = '<propulsion><engine file="jet"><thruster file="straight"/></engine></propulsion>'
    (hangar / "mine.xml").write_text(document(engine=engine))
    monkeypatch.chdir(hangar)
    remarks = read_jsbsim_aircraft(Path("mine.xml"), TEMPLATE).remarks
    assert any("turbine_engine with direct" in remark for remark in remarks)


def test_a_function_that_depends_on_itself_is_refused(tmp_path: Path) -> None:
    text = document(lift="<p>loop</p>").replace(
        "<aerodynamics>", '<aerodynamics><function name="loop"><p>loop</p></function>'
    )
    with pytest.raises(InputError, match="depends on itself"):
        read(tmp_path, text)
