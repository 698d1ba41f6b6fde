"""A file that is no log is refused by the name of its format, with what to do."""

import io
import zipfile
from pathlib import Path

import pytest

from airrace.errors import InputError
from airrace.flights.logs.foreign_formats import FOREIGN_FORMATS
from airrace.flights.logs.reading import read_log


def workbook() -> bytes:
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w") as folder:
        folder.writestr("[Content_Types].xml", "")
        folder.writestr("xl/workbook.xml", "")
    return archive.getvalue()


FILES = {
    "OpenAir, which describes airspace": b"* made by hand\r\nAC R\r\nAN RACE\r\nDP 45:04:54 N 013:37:36 E\r\n",
    "SeeYou CUP, a list of waypoints": b'name,code,country,lat,lon,elev\n"G1","G1",HR,4505.047N,01337.414E,1m\n',
    "GeoJSON, which describes places": b'{"type": "FeatureCollection", "features": []}',
    "TCX, of a sports watch": b'<?xml version="1.0"?>\n<TrainingCenterDatabase></TrainingCenterDatabase>',
    "a log of PX4": b"ULog\x01\x12\x35\x01" + bytes(100),
    "a log of ArduPilot": b"\xa3\x95\x80\x80" + bytes(100),
    "a file of airrace": b"# a course\nschema: airrace/track/2\nname: x\n",
    "HDF5": b"\x89HDF\r\n\x1a\n" + bytes(100),
    "a workbook": workbook(),
    "a web page": b"<!DOCTYPE html><html><body>404</body></html>",
    "a PDF": b"%PDF-1.7\n",
    "a picture": b"\x89PNG\r\n\x1a\n" + bytes(100),
    "compressed": b"\x1f\x8b\x08" + bytes(100),
}


@pytest.mark.parametrize("name", FILES)
def test_a_file_that_is_no_log_is_named(tmp_path: Path, name: str) -> None:
    path = tmp_path / "flight.csv"
    path.write_bytes(FILES[name])
    with pytest.raises(InputError) as refused:
        read_log(path)
    advice = next(form.advice for form in FOREIGN_FORMATS if form.name == name).format(path=path)
    assert f"this is {name}; {advice}" in str(refused.value.findings[0])
