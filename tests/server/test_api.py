"""The JSON API: the answers of the command line, as its description has them, for whoever has the token."""

import http.client
import json
import re
import subprocess
import sys

import numpy as np
import pytest

import kochab
from kochab.cli.main import main
from kochab.core import __version__
from kochab.server import command
from kochab.server.api import Api, schema
from kochab.server.http_server import HttpServer, Request

TOKEN = "0123456789abcdef0123456789abcdef"
MOUNT = {"name": "M", "ra_deg": 1.0, "dec_deg": 2.0, "mount_ra_deg": 1.1, "mount_dec_deg": 2.1, "epoch": "JNow"}
SAMPLES = command.data_folder("resources") / "samples"


class Client:
    def __init__(self, address) -> None:
        self.address = address

    def raw(self, method, path, body=b"", token=TOKEN, kind="application/octet-stream"):
        connection = http.client.HTTPConnection(*self.address, timeout=60)
        headers = {"Content-Type": kind, **({"Authorization": f"Bearer {token}"} if token else {})}
        connection.request(method, path, body, headers)
        reply = connection.getresponse()
        found = reply.status, dict(reply.getheaders()), reply.read()
        connection.close()
        return found

    def ask(self, method, path, body=b"", **more):
        """The status and the JSON, which is held to the description."""
        body = json.dumps(body).encode() if isinstance(body, dict) else body
        status, headers, text = self.raw(method, path, body, **more)
        assert headers["Content-Type"] == "application/json"
        value = json.loads(text)
        where = DESCRIPTION["paths"][path.partition("?")[0]][method.lower()]["responses"][str(status)]
        conforms(value, where["content"]["application/json"]["schema"])
        return status, value


DESCRIPTION = json.loads(schema())
KINDS = {"string": str, "number": (int, float), "integer": int, "boolean": bool, "array": list, "object": dict}


def conforms(value, to) -> None:
    """Whether a value is as a schema of the description has it: kinds, what is required, what is constant."""
    if "$ref" in to:
        to = DESCRIPTION["components"]["schemas"][to["$ref"].rpartition("/")[2]]
    if "anyOf" in to:
        fitting = []
        for one in to["anyOf"]:
            try:
                conforms(value, one)
                fitting.append(one)
            except AssertionError:
                pass
        assert len(fitting) == 1, value
        return
    kinds = to["type"] if isinstance(to["type"], list) else [to["type"]]
    if value is None:
        assert "null" in kinds
        return
    assert any(isinstance(value, KINDS[kind]) for kind in kinds if kind != "null"), (value, kinds)
    assert isinstance(value, bool) <= ("boolean" in kinds)
    assert value == to.get("const", value)
    if isinstance(value, list):
        assert to.get("minItems", 0) <= len(value) <= to.get("maxItems", len(value))
        for one in value:
            conforms(one, to["items"])
    if isinstance(value, dict):
        assert set(to.get("required", ())) <= set(value)
        for name, part in to.get("properties", {}).items():
            if name in value:
                conforms(value[name], part)


@pytest.fixture(scope="module")
def client():
    server = HttpServer(Api(TOKEN, lambda: MOUNT).answer)
    yield Client(server.address)
    server.stop()


@pytest.fixture(scope="module")
def orion():
    return (SAMPLES / "orion.png").read_bytes()


@pytest.fixture(scope="module")
def stars(orion):
    found = kochab.detect(SAMPLES / "orion.png")
    rows = np.column_stack([found.xy, found.flux]).tolist()
    return {"width": found.width, "height": found.height, "stars": rows}


def test_the_description_has_what_is_there_and_no_more(client) -> None:
    described = {(method.upper(), path) for path, has in DESCRIPTION["paths"].items() for method in has}
    routes = set(Api(TOKEN)._routes) - {("GET", "/openapi.json")}
    assert described == routes
    assert DESCRIPTION["info"]["version"] == __version__
    named = set(re.findall(r'"#/components/schemas/(\w+)"', json.dumps(DESCRIPTION)))
    assert named == set(DESCRIPTION["components"]["schemas"]) | {"Error"}
    status, _, body = client.raw("GET", "/openapi.json", token="")
    assert (status, json.loads(body)) == (200, DESCRIPTION)


@pytest.mark.parametrize(("method", "path"), [(m, p) for m, p in Api(TOKEN)._routes if p != "/openapi.json"])
@pytest.mark.parametrize("token", ["", "x", TOKEN[:-1], TOKEN + "0"])
def test_nothing_is_told_without_the_token(client, method, path, token) -> None:
    status, value = client.ask(method, path, b"{}", token=token)
    assert (status, list(value)) == (401, ["error"])


def test_an_image_is_solved_as_the_command_solves_it(client, orion, capsys) -> None:
    status, found = client.ask("POST", "/solve?name=orion.png", orion)
    assert status == 200
    assert main(["solve", "--json", str(SAMPLES / "orion.png")]) == 0
    told = json.loads(capsys.readouterr().out)
    del told["elapsed_ms"], found["elapsed_ms"], told["file"]
    assert found.pop("file") == "orion.png"
    assert found == told


def test_an_image_outside_the_place_given_is_refused_where_that_is_strict(client, orion) -> None:
    place = "ra=10&dec=20&radius=3"
    assert client.ask("POST", f"/solve?{place}", orion)[1]["solved"] is True
    found = client.ask("POST", f"/solve?{place}&strict=true", orion)[1]
    assert (found["solved"], found["reason"]) == (False, "outside the search radius")


def test_stars_are_found_and_a_list_of_them_is_solved(client, orion, stars) -> None:
    found = client.ask("POST", "/detect?name=orion.png", orion)[1]
    assert found["detections"] == len(found["stars"]) == len(stars["stars"])
    solved = client.ask("POST", "/identify", stars | {"name": "mine", "fov": 15})[1]
    assert solved["file"] == "mine"
    assert solved["ra_deg"] == pytest.approx(84.0, abs=0.01)
    assert "M 42" in [one["name"] for one in solved["objects"]]


def test_lists_are_answered_a_line_each_as_they_are_done(client, stars) -> None:
    lines = [json.dumps(stars), "", "{}", "[1]", "no", json.dumps(stars | {"timeout": 0.01, "method": "none"})]
    status, headers, text = client.raw("POST", "/identify/batch", "\n".join(lines).encode())
    assert (status, headers["Content-Type"]) == (200, "application/x-ndjson")
    found = [json.loads(line) for line in text.splitlines()]
    assert [one["line"] for one in found] == [1, 3, 4, 5, 6]
    assert [one.get("solved") for one in found] == [True, None, None, None, None]
    conforms(found[0], {"$ref": "Solution"})
    assert all(one["error"].endswith(".") for one in found[1:])


def test_a_batch_is_streamed(stars) -> None:
    """The first answer is there before the last list is done."""
    lines = b"\n".join([json.dumps(stars).encode()] * 3)
    response = Api(TOKEN).answer(request_of("POST", "/identify/batch", lines))
    assert json.loads(next(response.lines))["line"] == 1


def request_of(method, path, body=b""):
    return Request(method, path, body=body, authorization=f"Bearer {TOKEN}")


def test_objects_are_looked_up(client) -> None:
    found = client.ask("GET", "/objects?name=M%2042")[1]
    assert (found["ra_deg"], found["dec_deg"]) == pytest.approx((83.82, -5.39), abs=0.01)
    assert client.ask("GET", "/objects?name=zzzqq")[1]["name"] is None


def test_the_mount_is_told_and_never_moved(client, tmp_path) -> None:
    assert client.ask("GET", "/mount") == (200, MOUNT)
    for method in ("POST", "PUT", "DELETE"):
        assert client.raw(method, "/mount")[0] == 405
    status, value = OwnServer(lambda: command._position("", str(tmp_path / "no-port"))).ask("GET", "/mount")
    assert (status, list(value)) == (502, ["error"])
    status, value = OwnServer(None).ask("GET", "/mount")
    assert (status, "--mount" in value["error"]) == (404, True)


class OwnServer(Client):
    """A client of a server of its own, for one request."""

    def __init__(self, mount) -> None:
        self.server = HttpServer(Api(TOKEN, mount).answer)
        super().__init__(self.server.address)

    def ask(self, *asked, **more):
        try:
            return super().ask(*asked, **more)
        finally:
            self.server.stop()


@pytest.mark.parametrize(
    ("method", "path", "body", "sentence"),
    [
        ("POST", "/solve", b"", "Send the image's file"),
        ("POST", "/solve?name=../../a.png", b"no image", "Can't open a.png: not a supported image"),
        ("POST", "/solve?fov=wide", b"x", "fov is not a number"),
        ("POST", "/solve?fov=nan", b"x", "fov is not a number"),
        ("POST", "/solve?ra=1&dec=2", b"x", "belong together"),
        ("POST", "/solve?method=magic", b"x", "magic"),
        ("POST", "/detect?detector=magic", b"x", "magic"),
        ("POST", "/identify", b"{", "The body is not JSON"),
        ("POST", "/identify", b"[]", "not a JSON object"),
        ("POST", "/identify", {"width": 5, "height": 5, "stars": []}, "1 to 100000 stars"),
        ("POST", "/identify", {"width": True, "height": 5, "stars": [[1, 2]]}, "width is not a number"),
        ("POST", "/identify", {"width": 5, "height": 5, "stars": [[1, 2], [1]]}, "Each star is"),
        ("POST", "/identify", {"width": 5, "height": 5, "stars": [["a", 2]]}, "Each star is"),
        ("POST", "/identify/batch", b"\n", "a line"),
        ("GET", "/objects", b"", "Name an object"),
        ("GET", "/objects?name=M42&time=late", b"", "time is no time"),
    ],
)
def test_what_cannot_be_used_is_one_sentence(client, method, path, body, sentence) -> None:
    status, value = client.ask(method, path, body)
    assert status == 422
    assert sentence in value["error"]


def test_another_method_and_another_address_are_refused(client) -> None:
    status, headers, body = client.raw("GET", "/solve")
    assert (status, headers["Allow"]) == (405, "POST")
    assert b"takes POST" in body
    assert client.raw("TRACE", "/solve")[0] == 405
    assert client.raw("GET", "/etc/passwd")[0] == 404


@pytest.mark.skipif(sys.platform == "win32", reason="ended by a signal")
def test_the_command_tells_the_address_and_the_token(tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("KOCHAB_CONFIG", str(tmp_path))
    asked = [sys.executable, "-m", "kochab", "serve", "--api", "--port", "8499"]
    server = subprocess.Popen(asked, stdout=subprocess.PIPE, text=True)
    try:
        address, token, described = (server.stdout.readline().split()[-1] for _ in range(3))
        assert described == f"{address}/openapi.json"
        host, port = re.fullmatch(r"http://(.*):(\d+)", address).groups()
        found = Client((host, int(port))).ask("GET", "/version", token=token)
        assert found == (200, {"name": "Kochab", "version": __version__})
    finally:
        server.terminate()
        server.communicate(timeout=120)
