"""The phone's page: off until switched on, one token, GET only, and nothing hostile harms it."""

import http.client
import json
import socket
import threading
from contextlib import ExitStack, suppress
from dataclasses import replace
from urllib.parse import urlsplit

import pytest
from hypothesis import given
from hypothesis import strategies as st

from kochab.core.errors import PortError
from kochab.polar.measure import PolarFinding, PolarFindingKind
from kochab.server.phone_page import MOST_CONNECTIONS, PhonePage, local_address
from kochab.workflows.session.alignment_state import AlignmentState
from tests.polar.test_tutor import error_at


@pytest.fixture
def page():
    served = PhonePage()
    served.start("127.0.0.1")
    yield served
    served.stop()


def ask(page, path=None, method="GET"):
    url = urlsplit(page.url)
    line = http.client.HTTPConnection(url.hostname, url.port, timeout=60)
    try:
        line.request(method, url.path if path is None else path)
        answer = line.getresponse()
        return answer.status, dict(answer.getheaders()), answer.read()
    finally:
        line.close()


def test_it_is_off_until_switched_on_and_off_again():
    served = PhonePage()
    assert served.url == ""
    url = served.start("127.0.0.1")
    assert served.start() == url  # on already
    port = urlsplit(url).port
    served.stop()
    served.stop()
    with socket.socket() as probe:
        probe.settimeout(2)
        assert probe.connect_ex(("127.0.0.1", port)) != 0


def test_the_page_and_its_numbers(page):
    status, headers, body = ask(page)
    assert status == 200
    assert b"now.json" in body
    assert b"http" not in body.replace(b"<!doctype html>", b"")  # loads nothing from elsewhere
    assert "default-src 'none'" in headers["Content-Security-Policy"]
    page.show(AlignmentState("adjust", "Altitude bolt: a quarter turn clockwise.", error=error_at(320.0, -65.0)))
    status, _, body = ask(page, urlsplit(page.url).path + "now.json")
    told = json.loads(body)
    assert told["altitude"] == "▼ lower 5.3′"
    assert told["azimuth"] == "▶ clockwise 65″"
    assert told["words"].startswith("Altitude bolt")
    assert told["total_arcsec"] == pytest.approx(323.3, abs=1.0)


def test_the_age_is_the_windows_own_and_grows_while_nobody_shows_a_newer_state():
    """A window that hangs shows nothing new: its last number must not stay young on the phone."""
    now_s = [100.0]
    page = PhonePage("token", lambda: now_s[0])
    state = AlignmentState("adjust", error=error_at(320.0, -65.0), live=True, error_at_s=99.0)
    page.show(state)

    def told():
        return json.loads(page.answer("/token/now.json")[1])

    assert (told()["age"], told()["old"]) == ("live 1 s ago", False)
    now_s[0] = 140.0
    assert (told()["age"], told()["old"]) == ("OLD: 41 s ago", True)
    assert told()["age"] == state.age_words(140.0)
    page.show(replace(state, solved=False))
    assert told()["age"] == "OLD: newest frame not solved, last result 41 s ago"
    page.show(replace(state, stage="ended"))
    assert (told()["age"], told()["old"]) == ("Last result; not live.", True)
    html = page.answer("/token/")[1].decode()
    assert "now.age" in html
    assert "now.old" in html


def test_a_spoilt_measurement_gives_no_arrow_on_the_phone():
    page = PhonePage("token")
    spoilt = (PolarFinding(PolarFindingKind.FAR, "Far.", spoils=True),)
    page.show(AlignmentState("done", error=error_at(320.0, -65.0), findings=spoilt))
    told = json.loads(page.answer("/token/now.json")[1])
    assert told["total_arcsec"] > 300.0
    assert not {"altitude", "azimuth"} & told.keys()


def test_without_the_token_there_is_nothing(page):
    for path in (
        "/",
        "/now.json",
        "/wrong/",
        "/wrong/now.json",
        "//",
        "/../../etc/passwd",
        urlsplit(page.url).path + "../x",
        urlsplit(page.url).path + "now.json?x=1",
    ):
        assert ask(page, path)[0] == 404


def test_every_page_has_a_token_of_its_own():
    tokens = set()
    for _ in range(5):
        served = PhonePage()
        tokens.add(urlsplit(served.start("127.0.0.1")).path)
        served.stop()
    assert len(tokens) == 5
    assert min(len(token) for token in tokens) >= 22


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "OPTIONS", "HEAD", "TRACE"])
def test_nothing_but_get(page, method):
    assert ask(page, method=method)[0] == 501


@given(st.binary(max_size=400))
def test_no_path_is_ever_answered_but_the_known(blob):
    served = PhonePage("token")
    assert served.answer(blob.decode("latin-1")) is None
    assert served.answer("/token/" + "x" * 100) is None
    assert served.answer("/token/") is not None


@pytest.mark.parametrize(
    "blob",
    [
        b"\x00\xff\xfe garbage\r\n\r\n",
        b"GET\r\n\r\n",
        b"GET / HTTP/9.9\r\n\r\n",
        b"\r\n" * 50,
        b"GET /" + b"a" * 70000 + b" HTTP/1.1\r\n\r\n",
        b"GET / HTTP/1.1\r\n" + b"A: b\r\n" * 300 + b"\r\n",
        b"",
    ],
)
def test_nonsense_does_no_harm(page, blob, capfd):
    url = urlsplit(page.url)
    with socket.create_connection((url.hostname, url.port), timeout=60) as line:
        line.sendall(blob)
        line.shutdown(socket.SHUT_WR)
        try:
            while line.recv(65536):
                pass
        except ConnectionResetError:
            pass
    assert ask(page)[0] == 200
    assert capfd.readouterr() == ("", "")


def connected(page):
    url = urlsplit(page.url)
    return socket.create_connection((url.hostname, url.port), timeout=60)


def hung_up_on(line):
    """Wait for the end of a connection, which nothing was sent on."""
    try:
        return line.recv(1) == b""
    except ConnectionResetError:  # what had not been read yet was thrown away
        return True


def test_the_oldest_of_too_many_connections_makes_room(page):
    with ExitStack() as lines:
        oldest, *others = [lines.enter_context(connected(page)) for _ in range(MOST_CONNECTIONS)]
        assert ask(page)[0] == 200
        assert hung_up_on(oldest)
        others[-1].sendall(f"GET {urlsplit(page.url).path} HTTP/1.1\r\n\r\n".encode())
        assert others[-1].recv(15) == b"HTTP/1.1 200 OK"


def test_forty_that_trickle_a_request_cost_nobody_else_anything(page):
    threads = threading.active_count()
    with ExitStack() as lines:
        slow = [lines.enter_context(connected(page)) for _ in range(40)]
        for letter in f"GET {urlsplit(page.url).path}"[:12]:
            for line in slow:
                with suppress(OSError):  # hung up on already
                    line.sendall(letter.encode())
            assert ask(page)[0] == 200
        assert threading.active_count() == threads
        assert all(hung_up_on(line) for line in slow[: 40 - MOST_CONNECTIONS])


@pytest.mark.parametrize("text", [b"", b"G", b"GET / HTTP/1.1\r\nA: b\r\n"])
def test_a_request_has_one_deadline(page, monkeypatch, text):
    monkeypatch.setattr("kochab.server.phone_page.REQUEST_S", 0.3)
    with connected(page) as line:
        line.settimeout(0.05)
        for _ in range(400):
            try:
                line.sendall(text)  # every letter would begin a limit of silence anew
                if line.recv(1) == b"":
                    break
            except TimeoutError:
                continue
            except OSError:
                break
        else:
            pytest.fail("still listened to")
    assert ask(page)[0] == 200


def test_switching_off_ends_the_connections_too(page):
    with connected(page) as line:
        line.sendall(b"G")
        assert ask(page)[0] == 200
        page.stop()
        assert hung_up_on(line)


def test_an_address_that_is_taken_is_one_sentence(page):
    with pytest.raises(PortError, match="Can't serve the phone page"):
        PhonePage().start("127.0.0.1", urlsplit(page.url).port)


def test_the_local_address_is_an_address():
    socket.inet_aton(local_address())
