"""The server lets nobody in but the page that it has served, and loses nothing of what it holds."""

import json
import re
import threading
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass
from http.client import HTTPConnection
from pathlib import Path
from typing import Any
from urllib.parse import quote, urlsplit

import pytest
from three_gates import COURSE

from airrace.design.designer import Designer
from airrace.design.server import DesignServer

MOVE = {"places": [{"path": ["gates", "corner"], "north": 425, "east": 57}], "turns": []}


@dataclass
class Answer:
    status: int
    headers: dict[str, str]
    content: bytes

    @property
    def text(self) -> str:
        return self.content.decode()

    def json(self) -> Any:  # whatever the server says
        return json.loads(self.content)


class Client:
    """A client that says of itself what it is told to."""

    def __init__(self, server: DesignServer) -> None:
        self.host = urlsplit(server.address).netloc
        self.token = urlsplit(server.address).path.strip("/")

    def ask(
        self, method: str, path: str, headers: dict[str, str], body: bytes | Iterator[bytes] | None = None
    ) -> Answer:
        own = {"Host": self.host, "Origin": f"http://{self.host}"} | headers
        with closing(HTTPConnection(self.host, timeout=60)) as connection:
            connection.request(method, path, body, {key: value for key, value in own.items() if value})
            answer = connection.getresponse()
            return Answer(answer.status, {key.lower(): value for key, value in answer.getheaders()}, answer.read())

    def get(self, path: str, token: str | None = None, **headers: str) -> Answer:
        return self.ask("GET", f"/{self.token if token is None else token}/{path}", headers)

    def post(
        self,
        what: str,
        revision: int = 0,
        token: str | None = None,
        headers: dict[str, str] | None = None,
        **said: object,
    ) -> Answer:
        return self.send(what, json.dumps({"revision": revision, **said}).encode(), token, headers)

    def send(
        self,
        what: str,
        body: bytes | Iterator[bytes],
        token: str | None = None,
        headers: dict[str, str] | None = None,
    ) -> Answer:
        path = f"/{self.token if token is None else token}/do/{what}"
        return self.ask("POST", path, {"Content-Type": "application/json"} | (headers or {}), body)


@pytest.fixture
def client(still: Designer) -> Iterator[Client]:
    server = DesignServer(still)
    thread = threading.Thread(target=lambda: server.run(browser=False))
    thread.start()
    yield Client(server)
    server.stop()
    thread.join()


def test_the_page_and_all_that_it_loads_are_served_and_nothing_else(client: Client) -> None:
    page = client.get("")
    assert page.status == 200
    assert "default-src 'self'" in page.headers["content-security-policy"]
    named = re.findall(r'(?:href|src)="([^"]+\.(?:js|css))"', page.text)
    assert named
    for name in named:
        text = client.get(name)
        assert text.status == 200
        for other in re.findall(r'from "./([^"]+)"', text.text):
            assert client.get(f"script/{other}").status == 200
    for path in ("server.py", "script/../server.py", "script/%2e%2e/server.py", "/etc/passwd", "script/"):
        assert client.get(path).status == 404


@pytest.mark.parametrize(
    ("headers", "token", "status"),
    [
        ({"Origin": "http://evil.example"}, None, 403),
        ({"Origin": "null"}, None, 403),
        ({"Host": "evil.example:8765"}, None, 421),
        ({"Host": "127.0.0.1:80"}, None, 421),
        ({"Sec-Fetch-Site": "cross-site"}, None, 403),
        ({"Content-Type": "text/plain"}, None, 415),
        ({}, "", 403),
        ({}, "wrong", 403),
    ],
)
def test_untrusted_requests_are_refused_with_a_reason_and_nothing_is_written(
    client: Client, still: Designer, track: Path, headers: dict[str, str], token: str | None, status: int
) -> None:
    for what in ("move", "save"):
        answer = client.post(what, token=token, headers=headers, **MOVE)
        assert answer.status == status
        assert answer.json()["error"]
    if "Content-Type" not in headers:
        assert client.get("state", token, **headers).status == status
    assert (still.track.revision, track.read_text()) == (0, COURSE)


def test_a_change_without_an_origin_is_refused(client: Client) -> None:
    assert client.post("move", headers={"Origin": ""}, **MOVE).status == 403
    assert client.get("state", Origin="").status == 200


def test_ten_megabytes_and_what_is_no_message_are_refused(client: Client, still: Designer) -> None:
    assert client.send("move", b'{"a": "' + b"x" * 10_000_000 + b'"}').status == 413
    assert client.send("move", iter([b"{}"])).status == 411
    for content in (b"{", b"[1]", b"null", b"\xff", b"[" * 100_000, b'{"revision": NaN}'):
        assert client.send("move", content).status in (400, 422), content[:9]
    assert still.track.revision == 0


@pytest.mark.parametrize("text", ["\ud800", "n" * 5000, "\0", 10**400])
def test_what_cannot_be_written_down_is_refused_with_a_reason_that_can(client: Client, text: object) -> None:
    for action, message in (
        ("add", {"kind": text, "north": 1, "east": 2}),
        ("add", {"kind": "pylon", "north": text, "east": 2}),
        ("background", {"file": text}),
        ("set", {"path": ["gates", "corner", "height_m"], "value": text}),
    ):
        answer = client.post(action, **message)
        assert answer.status == 422
        assert 0 < len(answer.json()["error"]) <= 1000


def test_of_two_writers_the_second_is_refused_and_sees_what_the_first_has_done(client: Client) -> None:
    assert client.post("move", 0, **MOVE).json()["revision"] == 1
    refused = client.post("move", 0, **MOVE)
    assert refused.status == 409
    assert "another window" in refused.json()["error"]
    assert client.get("state?since=0").json()["revision"] == 1


def test_saving_writes_the_file_in_place(client: Client, track: Path) -> None:
    client.post("move", 0, **MOVE)
    assert track.read_text() == COURSE
    assert client.post("save", 1).status == 200
    assert track.read_text() == COURSE.replace("north_m: 420, east_m: 60", "north_m: 425, east_m: 57")
    assert not client.get("state").json()["unsaved"]


def test_a_file_that_changed_meanwhile_is_asked_about_and_not_overwritten(client: Client, track: Path) -> None:
    client.post("move", 0, **MOVE)
    theirs = COURSE.replace("Three gates", "Theirs")
    track.write_text(theirs)
    refused = client.post("save", 1)
    assert (refused.status, track.read_text()) == (409, theirs)
    track.write_text(theirs + "# and again\n")
    assert client.post("save", 1, overwrite=refused.json()["digest"]).status == 409  # not what was asked about
    track.write_text(theirs)
    assert client.post("reload", 1).status == 200
    assert client.get("state").json()["name"] == "Theirs"
    client.post("undo", 2)
    assert client.post("save", 3).status == 200
    assert "425" in track.read_text()


def test_what_is_not_saved_at_the_end_is_kept_beside_the_file(client: Client, still: Designer, track: Path) -> None:
    client.post("move", 0, **MOVE)
    unsaved = still.close()
    assert unsaved is not None
    assert unsaved.path == track.with_name("course.unsaved.yaml")
    assert unsaved.path.read_text() == unsaved.text == still.track.document.text != COURSE
    assert track.read_text() == COURSE


def test_a_picture_lies_in_the_folder_of_the_track(client: Client, track: Path, tmp_path: Path) -> None:
    (tmp_path / "secret.png").write_bytes(b"secret")
    (track.parent / "link.png").symlink_to(tmp_path / "secret.png")
    (track.parent / "map.png").write_bytes(b"a picture")
    for name in ("../secret.png", str(tmp_path / "secret.png"), "link.png", "none.png", "course.yaml", "a\0b.png"):
        assert client.post("background", file=name).status == 422, name
        assert client.get("picture").status == 404
    assert client.post("background", file="map.png").status == 200
    assert client.get("picture").content == b"a picture"
    assert client.post("background", file="map.png", placed=[1, 0, 5, "x"]).status == 422


def test_a_file_that_is_sent_lies_beside_the_track_and_overwrites_nothing(client: Client, track: Path) -> None:
    def send(name: str, content: bytes, kind: str = "application/octet-stream") -> Answer:
        path = f"/{client.token}/file?name={quote(name, safe='')}"
        return client.ask("POST", path, {"Content-Type": kind}, content)

    assert send("map.png", b"a picture").status == 200
    assert track.with_name("map.png").read_bytes() == client.get("picture").content == b"a picture"
    assert client.get("state").json()["files"] == ["map.png"]
    assert send("map.png", b"a picture").status == 200
    assert send("map.png", b"another one").status == 422
    before = sorted(track.parent.rglob("*"))
    (track.parent / "link.png").symlink_to(track)
    for name in ("../map.png", "course.yaml", "", "a/b.png", "n" * 5000 + ".png", "\0.png", "link.png", "..png\udcff"):
        refused = send(name.encode(errors="replace").decode(), b"x")
        assert refused.status == 422, name
        assert refused.json()["error"]
    assert send("sketch.kml", b"no placemarks").status == 422
    assert send("new.png", b"x", "application/json").status == 415
    assert client.send("file", b"x", headers={"Content-Type": "application/octet-stream"}).status == 415
    assert sorted(track.parent.rglob("*")) == sorted([*before, track.parent / "link.png"])
    assert track.read_text() == COURSE


def test_placemarks_lie_where_they_are(client: Client, track: Path) -> None:
    (track.parent / "sketch.geojson").write_text(
        '{"type": "FeatureCollection", "features": [{"type": "Feature", "properties": {"name": "quay"}, "geometry": '
        '{"type": "LineString", "coordinates": [[13, 45], [13, 45.001]]}}]}'
    )
    assert client.post("background", file="sketch.geojson").status == 200
    ((name, line),) = client.get("state").json()["background"]["lines"]
    assert name == "quay"
    assert line[0] == [0.0, 0.0]
    assert line[1][0] == pytest.approx(111.1, abs=0.3)
