"""Engines of JSBSim with propellers: the thrust at full throttle over airspeed and density.

A propeller of diameter D that turns n times a second at the advance ratio `J = V / (n D)` has

    T = C_T(J) rho n^2 D^4,      P = C_P(J) rho n^3 D^5

and turns as fast as the engine's power lets it. A piston engine has its power at its highest speed, in proportion to n
below, and loses it with density as in airrace; an electric one has it always. Blades that can be pitched hold the
propeller at its highest speed. JSBSim's own piston engine, of which it models mixture and manifold, may be stronger.
"""

import math
from dataclasses import dataclass

from airrace.files.inputs.jsbsim.document import PLAIN, POWER, STRUCTURE, JsbsimDocument
from airrace.files.inputs.jsbsim.functions import JsbsimTable, read_table
from airrace.model.dynamics.aerodynamics import power_ratio
from airrace.model.dynamics.flight_manual import bisect
from airrace.model.environment import KAPPA, P_ISA, RHO_ISA
from airrace.model.splines import Table

SPEED_OF_SOUND = math.sqrt(KAPPA * P_ISA / RHO_ISA)
"""At sea level, m/s."""
POWER_NAMES = {"piston_engine": "maxhp", "electric_engine": "power"}


@dataclass(frozen=True)
class PropellerEngine:
    """An engine with its propeller.

    Attributes:
        P_max: power at sea level, W.
        piston: whether it loses power with density and speed of rotation.
        D: diameter of the propeller, m.
        n_max: its highest speed of rotation, 1/s; with blades of fixed pitch the engine may turn it faster.
        pitches: least and largest pitch, as its tables have it.
        tables: C_T and C_P over the advance ratio, and the pitch where that is not fixed.
        factors: by which they are multiplied.
        mach: further factors over the Mach number of the blades' tips; None without.
    """

    P_max: float
    piston: bool
    D: float
    n_max: float
    pitches: tuple[float, float]
    tables: tuple[JsbsimTable, JsbsimTable]
    factors: tuple[float, float]
    mach: tuple[JsbsimTable | None, JsbsimTable | None]

    def thrust(self, V: float, rho: float) -> float:
        """Return the thrust at full throttle (N) at airspeed `V` (m/s) and density `rho` (kg/m3)."""
        low, high = self.pitches
        n, pitch = self.n_max, low
        if low == high or self._excess(n, low, V, rho) < 0.0:
            n = bisect(lambda n: self._excess(n, low, V, rho), 0.02 * self.n_max, 2.0 * self.n_max)
        elif self._excess(n, high, V, rho) > 0.0:
            pitch = high
        else:
            pitch = bisect(lambda pitch: self._excess(n, pitch, V, rho), low, high)
        return self._coefficient(0, n, pitch, V) * rho * n**2 * self.D**4

    def _excess(self, n: float, pitch: float, V: float, rho: float) -> float:
        """Return by how much the engine's power is above the propeller's, W."""
        power = self.P_max * power_ratio(rho) * min(1.0, n / self.n_max) if self.piston else self.P_max
        return power - self._coefficient(1, n, pitch, V) * rho * n**3 * self.D**5

    def _coefficient(self, number: int, n: float, pitch: float, V: float) -> float:
        """Return C_T (0) or C_P (1)."""
        J, table, mach = V / (n * self.D), self.tables[number], self.mach[number]
        value = table(J) if self.pitches[0] == self.pitches[1] else table(J, pitch)
        tip = math.hypot(V, math.pi * n * self.D) / SPEED_OF_SOUND
        return self.factors[number] * value * (mach(tip) if mach else 1.0)


def read_engines(document: JsbsimDocument) -> tuple[list[PropellerEngine], str]:
    """Return the engines with propellers of an aircraft; or none, for half of a propulsion is none, and why.

    Raises:
        InputError: a file or a number is missing.
    """
    section = document if document.root.find("propulsion") is None else document.section("propulsion")
    folder, engines = section.path.resolve().parent, list[PropellerEngine]()
    for element in section.root.findall("engine"):
        thruster = section.child(element, "thruster")
        folders = [folder / "Engines", folder, folder.parent / "engine", folder.parent.parent / "engine"]
        engine, propeller = (section.named_file(part, *folders) for part in (element, thruster))
        if engine.root.tag not in POWER_NAMES or propeller.root.tag != "propeller":
            return [], f"{engine.root.tag} with {propeller.root.tag} at {section.place(element)}"
        engines.append(_propeller_engine(engine, propeller))
    return engines, "" if engines else "no engine"


def _propeller_engine(engine: JsbsimDocument, propeller: JsbsimDocument) -> PropellerEngine:
    root = propeller.root
    pitches = propeller.measure(root, "minpitch", PLAIN, 0.0), propeller.measure(root, "maxpitch", PLAIN, 0.0)
    rpm = propeller.measure(root, "maxrpm", PLAIN, 0.0)
    if rpm == 0.0:
        rpm = engine.measure(engine.root, "maxrpm", PLAIN) / propeller.measure(root, "gearratio", PLAIN, 1.0)
    tables: dict[str, JsbsimTable] = {}
    for table in root.findall("table"):
        variables = 2 if table.get("name", "").startswith("C_") and pitches[0] != pitches[1] else 1
        tables[table.get("name", "")] = read_table(propeller, table, variables)
    if not {"C_THRUST", "C_POWER"} <= tables.keys():
        propeller.refuse(root, "must have the tables C_THRUST and C_POWER")
    return PropellerEngine(
        P_max=engine.measure(engine.root, POWER_NAMES[engine.root.tag], POWER),
        piston=engine.root.tag == "piston_engine",
        D=propeller.measure(root, "diameter", STRUCTURE),
        n_max=rpm / 60.0,
        pitches=pitches,
        tables=(tables["C_THRUST"], tables["C_POWER"]),
        factors=(propeller.measure(root, "ct_factor", PLAIN, 1.0), propeller.measure(root, "cp_factor", PLAIN, 1.0)),
        mach=(tables.get("CT_MACH"), tables.get("CP_MACH")),
    )


def thrust_table(engines: list[PropellerEngine], speeds: tuple[float, ...], densities: tuple[float, ...]) -> Table:
    """Return the thrust of all engines (N) over airspeeds (m/s) and densities (kg/m3)."""
    rows = (tuple(sum(engine.thrust(V, rho) for engine in engines) for rho in densities) for V in speeds)
    return Table((speeds, densities), tuple(rows))
