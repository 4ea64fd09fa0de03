"""Stellarium's Remote Control plug-in, played by a small server after its API's description and 0.22's answers."""

import contextlib
import json
import math
import threading
import time
from base64 import b64encode
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import parse_qs, urlsplit

import pytest

from kochab.core.attitude import apart_deg, unit_vectors
from kochab.core.errors import PortError, UsageError
from kochab.server.telescope import stellarium_remote
from kochab.server.telescope.offer import Offer
from kochab.server.telescope.stellarium_remote import StellariumRemote, remote_address
from kochab.workflows.goto_target import Target
from kochab.workflows.telescope.offered import PAST_S
from tests.server.telescope.conftest import wait_for
from tests.workflows.live_sources import solution

CAPELLA = {"name": "Capella", "localized-name": "Capella", "raJ2000": 79.17232, "decJ2000": 45.99799, "type": "Star"}
MARS = {"name": "Mars", "localized-name": "Марс", "raJ2000": -159.5, "decJ2000": 9.5, "type": "Planet"}


class Stellarium:
    """What is selected there, and where its view looks."""

    def __init__(self, password=""):
        self.selected, self.views, self.password, self.asked = None, [], password, []
        self.answer, self.looks = None, (0.0, 0.0)
        outer = self

        class Handler(BaseHTTPRequestHandler):
            def log_message(self, *_):
                pass

            def reply(self, status, body, kind="text/plain"):
                self.send_response(status)
                self.send_header("Content-Type", kind)
                self.send_header("Content-Length", str(len(body)))
                self.end_headers()
                self.wfile.write(body)

            def allowed(self):
                outer.asked.append(f"{self.command} {self.path}")
                basic = "Basic " + b64encode(f":{outer.password}".encode()).decode()
                if outer.password and self.headers.get("Authorization") != basic:
                    self.reply(401, b"error: not authorized")
                    return False
                return True

            def do_GET(self):
                if not self.allowed():
                    return None
                url = urlsplit(self.path)
                if url.path == "/api/main/view":
                    vector = [float(x) for x in unit_vectors(*outer.looks)]
                    return self.reply(200, json.dumps({"j2000": str(vector)}).encode(), "application/json")
                assert url.path == "/api/objects/info"
                assert parse_qs(url.query) == {"format": ["json"]}
                if outer.answer is not None:
                    return self.reply(200, outer.answer)
                if outer.selected is None:
                    return self.reply(404, b"no current selection, and no name parameter given")
                return self.reply(200, json.dumps(outer.selected).encode(), "application/json; charset=utf-8")

            def do_POST(self):
                body = self.rfile.read(int(self.headers["Content-Length"]))
                if not self.allowed():
                    return None
                assert self.path == "/api/main/view"
                x, y, z = json.loads(parse_qs(body.decode())["j2000"][0])
                outer.looks = (math.degrees(math.atan2(y, x)) % 360.0, math.degrees(math.asin(z)))
                outer.views.append(outer.looks)
                return self.reply(200, b"ok")

        self._server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.port = self._server.server_address[1]
        threading.Thread(target=self._server.serve_forever, args=(0.05,), daemon=True).start()

    def close(self):
        self._server.shutdown()
        self._server.server_close()


@pytest.fixture(autouse=True)
def _quick(monkeypatch):
    monkeypatch.setattr(stellarium_remote, "EVERY_S", 0.02)
    monkeypatch.setattr(stellarium_remote, "AGAIN_S", 0.02)


@pytest.fixture
def stellarium():
    with contextlib.closing(Stellarium()) as program:
        yield program


@pytest.fixture
def follow(telescope):
    with contextlib.ExitStack() as started:

        def begin(address):
            remote = StellariumRemote(telescope, remote_address(address))
            started.callback(remote.stop)
            return remote

        yield begin


def turns(stellarium, count=4):
    """So many further questions are answered."""
    reached = len(stellarium.asked) + count
    return wait_for(lambda: len(stellarium.asked) >= reached)


def test_the_view_follows_the_telescope_when_it_moves_and_is_a_persons_own_while_it_stands(
    stellarium, follow, telescope
) -> None:
    follow(f"127.0.0.1:{stellarium.port}")
    assert turns(stellarium)
    assert stellarium.views == []  # nothing was solved yet
    telescope.see_solution(solution(83.822, -5.391))
    assert wait_for(lambda: len(stellarium.views) == 1)
    assert apart_deg(stellarium.views[0], (83.822, -5.391)) * 3600.0 < 0.01
    for arcmin in (0.5, 1.9):  # scatter
        telescope.see_solution(solution(83.822, -5.391 - arcmin / 60.0))
        assert turns(stellarium)
        assert len(stellarium.views) == 1
    for moved, place in enumerate(((83.822, -5.391 - 2.2 / 60.0), (359.99, 89.0)), start=1):
        telescope.see_solution(solution(*place))
        assert wait_for(lambda count=moved + 1: len(stellarium.views) == count)
        assert apart_deg(stellarium.views[moved], place) * 3600.0 < 0.01
    telescope.see_solution(solution(10.0, 20.0), time.monotonic() - PAST_S - 1.0)
    assert turns(stellarium)
    assert len(stellarium.views) == 3  # where it pointed minutes ago is no word of where it points


def test_a_view_that_the_sky_turned_away_from_is_turned_back_and_a_persons_is_not(
    stellarium, follow, telescope, monkeypatch
) -> None:
    monkeypatch.setattr(stellarium_remote, "SIDEREAL_DEG_S", 1.0)  # a night in minutes
    follow(f"127.0.0.1:{stellarium.port}")
    telescope.see_solution(solution(83.822, -5.391))
    assert wait_for(lambda: len(stellarium.views) == 1)
    stellarium.looks = (93.0, -5.4)  # by hand
    assert turns(stellarium)
    assert len(stellarium.views) == 1
    time.sleep(0.3)
    stellarium.looks = (83.822 + 0.1, -5.391)
    assert wait_for(lambda: len(stellarium.views) == 2)
    assert apart_deg(stellarium.looks, (83.822, -5.391)) * 3600.0 < 0.01


def test_what_is_selected_there_is_the_target_and_moves_nothing(stellarium, follow, steered, mount, told) -> None:
    remote = StellariumRemote(steered, remote_address(f"http://localhost:{stellarium.port}/"))
    try:
        assert turns(stellarium)
        assert steered.target is None
        stellarium.selected = CAPELLA
        assert wait_for(lambda: steered.target is not None)
        assert (steered.target.name, steered.target.ra_deg) == ("Capella", 79.17232)
        stellarium.selected = MARS
        assert wait_for(lambda: steered.target.name == "Марс")
        assert steered.target.ra_deg == pytest.approx(200.5)
        stellarium.selected = None  # looking elsewhere takes no target away
        assert turns(stellarium)
        assert steered.target.name == "Марс"
        assert mount.orders == []  # though programs may move it
        assert sum("set a target: Capella" in sentence for sentence in told) == 1
    finally:
        remote.stop()


def test_what_was_selected_before_takes_no_place_of_a_target_set_here(stellarium, follow, telescope) -> None:
    telescope.target = mine = Target("M 42", 83.82, -5.39)
    stellarium.selected = CAPELLA
    follow(f"127.0.0.1:{stellarium.port}")
    assert turns(stellarium)
    assert telescope.target is mine
    stellarium.selected = MARS
    assert wait_for(lambda: telescope.target is not mine)


def test_an_absent_stellarium_is_one_sentence_and_is_found_when_it_comes(follow, telescope, told) -> None:
    first = Stellarium()
    first.close()
    follow(f"127.0.0.1:{first.port}")
    assert wait_for(lambda: told)
    assert "switch on its plug-in Remote Control" in told[0]
    time.sleep(0.2)  # ten turns
    assert len(told) == 1


def test_it_joins_and_leaves_with_stellarium(follow, telescope, told, monkeypatch) -> None:
    program = Stellarium()
    follow(f"127.0.0.1:{program.port}")
    assert wait_for(lambda: telescope.programs == {"Stellarium Remote Control": 1})
    program.close()
    assert wait_for(lambda: not telescope.programs)
    assert wait_for(lambda: "Stellarium Remote Control disconnected." in told)


def test_a_password_is_sent_and_asked_for_and_never_shown(follow, telescope, told) -> None:
    with contextlib.closing(Stellarium("se@cret")) as program:
        follow(f"127.0.0.1:{program.port}")
        assert wait_for(lambda: told)
        assert "wants its password" in told[0]
        program.selected = CAPELLA
        follow(f":se@cret@127.0.0.1:{program.port}")
        assert wait_for(lambda: telescope.target is not None)
        assert not any("cret" in sentence for sentence in told)


@pytest.mark.parametrize(
    "answer",
    [
        b"<html>", b"[]", b"{}", b'{"raJ2000": "x", "decJ2000": 1}', b'{"raJ2000": 1, "decJ2000": 91}',
        b'{"raJ2000": 1e999, "decJ2000": 1}', b'{"raJ2000": 1, "decJ2000": 1, "name": [1]}', b"[" * 100_000,
        b'{"raJ2000": 1, "decJ2000": 1, "name": "' + b"x" * 300_000 + b'"}', b"\xff\xfe\x00",
    ],
)  # fmt: skip
def test_another_server_there_is_told_as_one(stellarium, follow, telescope, told, answer) -> None:
    stellarium.answer = answer
    follow(f"127.0.0.1:{stellarium.port}")
    assert wait_for(lambda: told)
    assert "is not Stellarium's Remote Control" in told[0]
    assert telescope.target is None


def test_a_name_that_would_steer_a_terminal_is_written_out(stellarium, follow, telescope) -> None:
    stellarium.selected = {**CAPELLA, "localized-name": "\x1b[2J" + "x" * 1000}
    follow(f"127.0.0.1:{stellarium.port}")
    assert wait_for(lambda: telescope.target is not None)
    assert telescope.target.name.isprintable()
    assert len(telescope.target.name) < 200


def test_addresses() -> None:
    assert (remote_address("").where.host, remote_address("").where.port) == ("127.0.0.1", 8090)
    assert remote_address("pi.local").where.server == "pi.local:8090"
    assert remote_address("http://:word@pi.local:80/").password == "word"
    with pytest.raises(PortError):
        remote_address("pi.local:x")
    with pytest.raises(UsageError):
        remote_address("pi.local/remote")


def test_it_is_off_until_asked_for_and_ends_with_the_ports(stellarium, telescope) -> None:
    ports = Offer(telescope, {"lx200": 0})
    ports.stop()
    assert stellarium.asked == []
    ports = Offer(telescope, {"lx200": 0}, stellarium_remote=f"127.0.0.1:{stellarium.port}")
    assert turns(stellarium, 2)
    ports.stop()
    asked = len(stellarium.asked)
    time.sleep(0.2)
    assert len(stellarium.asked) == asked
    assert not telescope.programs
