"""Draw the model of an aerobatic aeroplane of span 1, as COLLADA for KMZ and as binary glTF for CZML.

    python scripts/aircraft_model.py

The files are `aircraft.dae` and `aircraft.glb` in airrace/files/export, whose `aircraft_model.py` scales them.
"""

import json
import struct
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from airrace.files.export.globe import add_element
from airrace.optimal_control.trajectory import Array

RINGS = (
    (0.390, 0.012, 0.012, 0.000),
    (0.350, 0.045, 0.045, 0.000),
    (0.330, 0.072, 0.075, 0.000),
    (0.150, 0.078, 0.088, 0.000),
    (-0.120, 0.062, 0.075, 0.000),
    (-0.330, 0.030, 0.042, 0.010),
    (-0.460, 0.010, 0.030, 0.020),
)
"""The fuselage: places along the body, half widths, half heights and heights of the middle, in spans."""
CANOPY = (
    (0.120, 0.010, 0.010, 0.080),
    (0.030, 0.045, 0.050, 0.085),
    (-0.080, 0.040, 0.042, 0.080),
    (-0.200, 0, 0, 0.06),
)
WING = (((0.115, 0.0, 0.010), (-0.105, 0.0, 0.010)), ((0.065, 0.5, 0.010), (-0.060, 0.5, 0.010)))
"""Leading and trailing edge of a half, at the root and at the tip: forward, aside, up, in spans."""
TAILPLANE = (((-0.345, 0.0, 0.025), (-0.470, 0.0, 0.025)), ((-0.375, 0.19, 0.025), (-0.465, 0.19, 0.025)))
FIN = (((-0.330, 0.0, 0.040), (-0.500, 0.0, 0.000)), ((-0.415, 0.0, 0.190), (-0.500, 0.0, 0.190)))


SIDES = 10
"""Corners of a ring."""
THICKNESS = (0.014, 0.006)
"""Half of the thickness of a wing at the root and at the tip, in spans."""
COLOURS = {"body": (0.93, 0.94, 0.96), "wing": (0.80, 0.10, 0.12), "canopy": (0.10, 0.14, 0.20)}
"""Red, green, blue from 0 to 1."""


@dataclass(frozen=True, eq=False)
class Surface:
    """A closed surface of one colour.

    Attributes:
        colour: its name.
        triangles: corners, counterclockwise as seen from outside: forward, left, up, in spans; shape (n, 3, 3).
    """

    colour: str
    triangles: Array

    @property
    def normals(self) -> Array:
        """The unit normals of the triangles, outward; shape (n, 3)."""
        a, b, c = np.moveaxis(self.triangles, 1, 0)
        normals = np.cross(b - a, c - a)
        return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def aircraft_model() -> list[Surface]:
    """Return the surfaces of an aircraft, the origin in its centre of mass."""
    sheets = [_sheet(WING, 2), _sheet(TAILPLANE, 2), _sheet(FIN, 1)]
    parts = {"body": [_loft(_rings(RINGS))], "wing": sheets, "canopy": [_loft(_rings(CANOPY))]}
    return [Surface(colour, np.concatenate(pieces)) for colour, pieces in parts.items()]


def _rings(stations: tuple[tuple[float, float, float, float], ...]) -> Array:
    """Return ellipses across the body, counterclockwise as seen from ahead; shape (k, m, 3)."""
    angle = np.linspace(0.0, 2.0 * np.pi, SIDES, endpoint=False)
    x, width, height, middle = (np.array(column)[:, None] for column in zip(*stations, strict=True))
    return np.stack(np.broadcast_arrays(x, width * np.cos(angle), middle + height * np.sin(angle)), axis=-1)


def _sheet(corners: tuple[tuple[tuple[float, ...], ...], ...], across: int) -> Array:
    """Return a wedge from root to tip, thick in one direction (1: aside; 2: up, and on both sides); (n, 3, 3)."""
    rings: list[Array] = []
    for (front, back), half in zip(np.array(corners), THICKNESS, strict=True):
        thick = np.zeros(3)
        thick[across] = half
        middle = 0.7 * front + 0.3 * back
        ring = np.array([front, middle + thick, back, middle - thick])
        rings.append(ring if across == 1 else ring[::-1])
    root, tip = rings
    return _loft(np.array([tip, root] if across == 1 else [tip, root, tip * (1.0, -1.0, 1.0)]))


def _loft(rings: Array) -> Array:
    """Return the closed surface over rings (k, m, 3), the first of which is ahead or outside; triangles (n, 3, 3)."""
    faces: list[Array] = []
    for ahead, behind in pairwise(rings):
        for number in range(len(ahead)):
            a, b = ahead[number], ahead[(number + 1) % len(ahead)]
            d, c = behind[number], behind[(number + 1) % len(ahead)]
            faces += [np.array([a, c, b]), np.array([a, d, c])]
    for ring, order in ((rings[0], -1), (rings[-1], 1)):
        middle, corners = ring.mean(axis=0), ring[::order]
        faces += [np.array([middle, b, a]) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)]
    sides = np.array(faces)
    area = np.linalg.norm(np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0]), axis=1)
    return sides[area > 1e-9]


def glb(parts: list[Surface]) -> bytes:
    """Return a model as binary glTF 2.0 (ISO/IEC 12113): up is +Y, forward +Z, and left +X."""
    data, views, accessors, primitives = bytearray(), list[object](), list[object](), list[object]()
    for material, part in enumerate(parts):
        attributes: dict[str, int] = {}
        for name, values in (("POSITION", part.triangles), ("NORMAL", np.repeat(part.normals[:, None], 3, axis=1))):
            points = np.roll(values.reshape(-1, 3), -1, axis=1).astype("<f4")  # left, up, forward
            attributes[name] = len(accessors)
            views.append({"buffer": 0, "byteOffset": len(data), "byteLength": points.nbytes, "target": 34962})
            ends = {"min": points.min(axis=0).tolist(), "max": points.max(axis=0).tolist()}
            accessors.append(
                {"bufferView": len(views) - 1, "componentType": 5126, "count": len(points), "type": "VEC3", **ends}
            )
            data += points.tobytes()
        primitives.append({"attributes": attributes, "material": material})
    colours = [
        {
            "name": part.colour,
            "pbrMetallicRoughness": {"baseColorFactor": [*COLOURS[part.colour], 1.0], "metallicFactor": 0.1},
        }
        for part in parts
    ]
    whole = {
        "asset": {"version": "2.0", "generator": "airrace"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": "aircraft", "scale": [1.0, 1.0, 1.0]}],
        "meshes": [{"primitives": primitives}],
        "materials": colours,
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(data)}],
    }
    text = json.dumps(whole, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(data), b"BIN\0") + data
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def collada(parts: list[Surface]) -> bytes:
    """Return a model as COLLADA 1.4.1 (Khronos): up is +Z, forward +Y, and right +X, as Google Earth turns models."""
    root = ET.Element("COLLADA", {"xmlns": "http://www.collada.org/2005/11/COLLADASchema", "version": "1.4.1"})
    asset = add_element(root, "asset")
    add_element(asset, "created", "2000-01-01T12:00:00Z")  # so that equal flights give equal files
    add_element(asset, "modified", "2000-01-01T12:00:00Z")
    add_element(asset, "unit", name="metre", meter="1")
    add_element(asset, "up_axis", "Z_UP")
    effects, materials = add_element(root, "library_effects"), add_element(root, "library_materials")
    geometries, scenes = add_element(root, "library_geometries"), add_element(root, "library_visual_scenes")
    node = add_element(add_element(scenes, "visual_scene", id="scene"), "node", id="aircraft")
    add_element(node, "scale", "1 1 1")
    for part in parts:
        _add_material(effects, materials, part.colour)
        _add_mesh(geometries, part)
        shown = add_element(node, "instance_geometry", url=f"#{part.colour}")
        bound = add_element(add_element(shown, "bind_material"), "technique_common")
        add_element(bound, "instance_material", symbol=part.colour, target=f"#{part.colour}-material")
    add_element(add_element(root, "scene"), "instance_visual_scene", url="#scene")
    return ET.tostring(root, encoding="utf-8", xml_declaration=True)


def _add_material(effects: ET.Element, materials: ET.Element, colour: str) -> None:
    profile = add_element(add_element(effects, "effect", id=f"{colour}-effect"), "profile_COMMON")
    lambert = add_element(add_element(profile, "technique", sid="common"), "lambert")
    shade = " ".join(f"{value:g}" for value in (*COLOURS[colour], 1.0))
    add_element(add_element(lambert, "diffuse"), "color", shade)
    add_element(add_element(materials, "material", id=f"{colour}-material"), "instance_effect", url=f"#{colour}-effect")


def _add_mesh(geometries: ET.Element, part: Surface) -> None:
    mesh = add_element(add_element(geometries, "geometry", id=part.colour), "mesh")
    corners = len(part.triangles) * 3
    for name, values in (("position", part.triangles.reshape(-1, 3)), ("normal", np.repeat(part.normals, 3, axis=0))):
        turned = np.stack([-values[:, 1], values[:, 0], values[:, 2]], axis=1)  # right, forward, up
        source = add_element(mesh, "source", id=f"{part.colour}-{name}")
        numbers = " ".join(f"{value:.5f}" for value in turned.ravel().tolist())
        add_element(source, "float_array", numbers, id=f"{part.colour}-{name}-array", count=str(3 * corners))
        array = f"#{part.colour}-{name}-array"
        common = add_element(source, "technique_common")
        accessor = add_element(common, "accessor", source=array, count=str(corners), stride="3")
        for axis in "XYZ":
            add_element(accessor, "param", name=axis, type="float")
    add_element(
        add_element(mesh, "vertices", id=f"{part.colour}-vertices"),
        "input",
        semantic="POSITION",
        source=f"#{part.colour}-position",
    )
    faces = add_element(mesh, "triangles", count=str(corners // 3), material=part.colour)
    add_element(faces, "input", semantic="VERTEX", source=f"#{part.colour}-vertices", offset="0")
    add_element(faces, "input", semantic="NORMAL", source=f"#{part.colour}-normal", offset="0")
    add_element(faces, "p", " ".join(map(str, range(corners))))


if __name__ == "__main__":
    folder = Path(__file__).parents[1] / "airrace" / "files" / "export"
    surfaces = aircraft_model()
    (folder / "aircraft.glb").write_bytes(glb(surfaces))
    (folder / "aircraft.dae").write_bytes(collada(surfaces))
