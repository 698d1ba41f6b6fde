"""Models of the aircraft: two files of span 1, drawn by `scripts/aircraft_model.py`, scaled to a wing span.

Proportions are those of a mid-wing monoplane with one propeller, by eye; nothing is measured on the model.
"""

import json
import struct
from pathlib import Path

FOLDER = Path(__file__).parent


def glb(span: float) -> bytes:
    """Return the model for a span, m, as binary glTF 2.0 (ISO/IEC 12113): up is +Y, forward +Z, and left +X."""
    content = (FOLDER / "aircraft.glb").read_bytes()
    end = 20 + int.from_bytes(content[12:16], "little")  # of the JSON behind the headers of file and chunk
    model = json.loads(content[20:end])
    model["nodes"][0]["scale"] = [span] * 3
    text = json.dumps(model, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + content[end:]
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def collada(span: float) -> bytes:
    """Return the model for a span, m, as COLLADA 1.4.1: up is +Z, forward +Y, and right +X, as Google Earth has it."""
    text = (FOLDER / "aircraft.dae").read_text(encoding="utf-8")
    return text.replace("<scale>1 1 1</scale>", f"<scale>{span:g} {span:g} {span:g}</scale>").encode()
