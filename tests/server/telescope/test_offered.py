"""What programs are told of the pointing, in both epochs, and what becomes of their orders."""

import socket
import struct
import threading
import time
from dataclasses import replace
from types import SimpleNamespace

import erfa
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kochab.core.attitude import apart_deg
from kochab.core.errors import PortError, RefusedError, UsageError
from kochab.core.progress import run
from kochab.server.telescope.listening import MOST_CLIENTS, NotTheProtocol
from kochab.server.telescope.lx200 import Commands
from kochab.server.telescope.offer import PROTOCOLS, Offer
from kochab.server.telescope.stellarium import GOTO, goto_place, position_message
from kochab.workflows.telescope import offered
from kochab.workflows.telescope.offered import OfferedTelescope
from tests.server.telescope.conftest import NIGHT, Program, wait_for
from tests.workflows.live_sources import solution

PLACES = [(83.822, -5.391), (0.001, 12.0), (359.9999, 89.2), (187.791, 57.033), (201.298, -69.5), (279.2347, 38.7837)]


def of_date(ra_deg, dec_deg):
    """Geocentric apparent place by ERFA's own transformation, degrees."""
    ri, di, origins = erfa.atci13(np.radians(ra_deg), np.radians(dec_deg), 0.0, 0.0, 0.0, 0.0, *jd())
    return np.degrees(erfa.anp(ri - origins)), np.degrees(di)


def from_date(ra_deg, dec_deg):
    """Its inverse: ICRS degrees."""
    _, _, origins = erfa.atci13(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, *jd())
    rc, dc, _ = erfa.atic13(erfa.anp(np.radians(ra_deg) + origins), np.radians(dec_deg), *jd())
    return np.degrees(rc), np.degrees(dc)


def jd():
    one, two = erfa.utctai(*erfa.dtf2d("UTC", NIGHT.year, NIGHT.month, NIGHT.day, NIGHT.hour, 0, 0.0))
    return erfa.taitt(one, two)


def degrees_of(ra, dec):
    """Of ``HH:MM:SS#`` and ``sDD*MM:SS#``, by hand."""
    h, m, s = (float(part) for part in ra.rstrip(b"#").split(b":"))
    sign = -1.0 if dec.startswith(b"-") else 1.0
    d, rest = dec.rstrip(b"#")[1:].split(b"*")
    minutes, seconds = (float(part) for part in rest.split(b":"))
    return (h + m / 60 + s / 3600) * 15.0, sign * (float(d) + minutes / 60 + seconds / 3600)


@pytest.mark.parametrize("place", PLACES)
def test_lx200_tells_the_place_of_date_as_erfa_has_it(program, telescope, place) -> None:
    telescope.see_mount(place)
    meade = program("lx200")
    told = degrees_of(meade.ask(":GR#"), meade.ask(":GD#"))
    true = of_date(*place)
    # Half a second of time and half an arcsecond are the format's; the rest is the light's bending at the Sun.
    assert abs((told[0] - true[0] + 180.0) % 360.0 - 180.0) * 240.0 < 0.51 + 0.02 / max(
        0.01, np.cos(np.radians(place[1]))
    )
    assert abs(told[1] - true[1]) * 3600.0 < 0.55
    assert apart_deg(told, place) * 60.0 > 5.0 or abs(place[1]) > 85.0  # J2000 itself would be 9' away


@pytest.mark.parametrize("place", PLACES)
def test_a_goto_of_lx200_is_of_date_and_one_of_stellarium_j2000(program, telescope, place) -> None:
    there = of_date(*place)
    hours, signed = there[0] / 15.0, there[1]
    ra = f"{int(hours):02d}:{int(hours * 60) % 60:02d}:{int(hours * 3600) % 60:02d}"
    dec = f"{'-' if signed < 0 else '+'}{int(abs(signed)):02d}*{int(abs(signed) * 60) % 60:02d}:{int(abs(signed) * 3600) % 60:02d}"
    meade = program("lx200")
    assert meade.ask(f":Sr{ra}#", 1) + meade.ask(f":Sd{dec}#", 1) + meade.ask(":MS#", 1) == b"110"
    asked = from_date(*degrees_of(f"{ra}#".encode(), f"{dec}#".encode()))
    assert apart_deg(asked, (telescope.target.ra_deg, telescope.target.dec_deg)) * 3600.0 < 0.05
    telescope.target = None
    program("stellarium").say(
        struct.pack("<HHqIi", 20, 0, 0, round(place[0] / 360 * 2**32) % 2**32, round(place[1] / 360 * 2**32))
    )
    assert wait_for(lambda: telescope.target is not None)
    assert apart_deg(place, (telescope.target.ra_deg, telescope.target.dec_deg)) * 3600.0 < 0.001


def test_stellarium_is_told_the_same_place_in_j2000_twice_a_second(program, telescope) -> None:
    telescope.see_mount(PLACES[0])
    stellarium, at_s = program("stellarium"), []
    while len(at_s) < 2 or (at_s[-1] - at_s[-2] > 0.8 and len(at_s) < 10):  # a busy machine is late now and then
        size, kind, at, ra, dec, status = struct.unpack("<HHqIii", stellarium.hear(24))
        assert (size, kind, status) == (24, 0, 0)
        at_s.append(at / 1e6)
        assert abs(at_s[-1] - time.time()) < 60.0
        assert apart_deg((ra / 2**32 * 360, dec / 2**32 * 360), PLACES[0]) * 3600.0 < 0.001
    assert at_s[-1] - at_s[-2] == pytest.approx(0.5, abs=0.3)


def test_low_precision_and_back(program, telescope) -> None:
    telescope.see_mount((83.822, -5.391))
    meade = program("lx200")
    meade.say(":U#")
    ra, dec = meade.ask(":GR#"), meade.ask(":GD#")
    assert ra == b"05:36.6#"
    assert dec == b"-05*22#"
    assert meade.ask(":P#", 14) == b"HIGH PRECISION"
    assert meade.ask(":GR#").count(b":") == 2


def test_what_a_telescope_also_answers(program) -> None:
    meade = program("lx200")
    assert meade.ask(b"\x06", 1) == b"P"
    assert meade.ask(":GVP#") == b"Kochab#"
    assert meade.ask(":St+48*08#", 1) == b"1"
    assert meade.ask(":Sr25:00:00#", 1) == b"0"
    assert meade.ask(":Sd+91*00#", 1) == b"0"
    assert meade.ask(":MS#") == b"1no target was set#"
    assert meade.ask(":Mn#:Qn#:nonsense#:D#") == b"#"


def test_a_solved_frame_shows_where_the_eyepiece_looks_once_aligned(program, telescope, told) -> None:
    """A camera beside the eyepiece: an align on a star turns with the telescope, roll included."""
    meade = program("lx200")
    meade.ask(":Sr05:35:00#", 1), meade.ask(":Sd-05*23:00#", 1)
    assert meade.ask(":CM#").startswith(b"Match fail")  # nothing was solved yet
    telescope.see_solution(solution(83.0, -4.0, 30.0))
    assert apart_deg(telescope.seen.icrs_deg, (83.0, -4.0)) * 3600.0 < 0.01
    assert meade.ask(":CM#").startswith(b"Coordinates matched")
    star = telescope.seen.icrs_deg
    assert apart_deg(star, from_date(*degrees_of(b"05:35:00#", b"-05*23:00#"))) * 3600.0 < 0.05
    beside = apart_deg(star, (83.0, -4.0))
    telescope.see_solution(solution(200.0, 70.0, -75.0))
    assert apart_deg(telescope.seen.icrs_deg, (200.0, 70.0)) == pytest.approx(beside, abs=1e-9)
    assert any("beside the camera" in sentence for sentence in told)
    telescope.see_solution(solution(200.0, -70.0, 0.0))
    assert meade.ask(":CM#").startswith(b"Match fail")  # 65 degrees off: another place


def test_an_old_frame_gives_way_to_the_mount(telescope) -> None:
    telescope.see_solution(solution(83.0, -4.0), time.monotonic() - offered.NEWEST_S - 1.0)
    assert apart_deg(telescope.seen.icrs_deg, (83.0, -4.0)) < 1e-6
    telescope.see_mount((10.0, 20.0), slewing=True)
    assert telescope.seen.icrs_deg == (10.0, 20.0)
    telescope.see_solution(solution(83.0, -4.0))
    assert apart_deg(telescope.seen.icrs_deg, (83.0, -4.0)) < 1e-6
    assert telescope.seen.slewing


def test_stellarium_is_not_told_what_nobody_saw_for_minutes(telescope, program) -> None:
    """Its cross would stand on a star that the telescope left."""
    telescope.see_solution(solution(83.0, -4.0), time.monotonic() - offered.PAST_S - 1.0)
    assert telescope.seen.past
    stellarium = program("stellarium")
    stellarium.line.settimeout(1.5)  # three of its turns
    with pytest.raises(TimeoutError):
        stellarium.hear(24)
    telescope.see_solution(solution(83.0, -4.0))
    stellarium.line.settimeout(10.0)
    assert len(stellarium.hear(24)) == 24


class Refusing:
    """A mount that takes no order."""

    busy = False

    def __init__(self):
        self.orders, self.stopped = [], 0

    def order(self, name, make, failed):
        self.orders.append(name)
        failed("The mount is busy: slewing. Wait, or stop it.")

    def stop(self):
        self.stopped += 1


def test_without_leave_no_program_moves_or_syncs_the_mount_but_any_stops_it(told) -> None:
    mount = Refusing()
    telescope = OfferedTelescope(told.append, mount)
    telescope.goto((1.0, 2.0), "X").result(0)
    assert telescope.sync((1.0, 2.0), "X").result(0)
    telescope.stop("X")
    assert (mount.orders, mount.stopped) == ([], 1)
    assert telescope.target is not None
    allowed = OfferedTelescope(told.append, mount, may_move=True)
    assert "busy" in allowed.goto((1.0, 2.0), "X").result(0)
    assert mount.orders == ["goto"]


class Slow:
    """A mount's line that takes a while to end an order that its guard has refused."""

    busy = False

    def order(self, name, make, failed):
        if self.busy:
            return failed("The mount is busy.")
        self.busy = True
        return threading.Thread(target=self._do, args=(make, failed)).start()

    def _do(self, make, failed):
        low = SimpleNamespace(to_mount=lambda *place: place, sync=self._refuse)
        with pytest.raises(RefusedError) as error:
            run(make(low))
        time.sleep(0.2)
        self.busy = False
        failed(str(error.value))

    def _refuse(self, *place, by_hand):
        raise RefusedError("Below the horizon.")


def test_a_program_that_was_refused_can_try_again_at_once(told) -> None:
    telescope = OfferedTelescope(told.append, Slow(), may_move=True)
    assert [telescope.sync((1.0, 2.0), "X").result(5.0) for _ in range(3)] == ["Below the horizon."] * 3


# -- Hostile programs ------------------------------------------------------------------------------


def test_an_endless_line_and_garbage_end_with_a_sentence(program, told) -> None:
    for noise in (b":" + b"9" * 200, b"\xff" * 20_000):
        meade = program("lx200")
        meade.say(noise)
        assert meade.hear() == b""
    stellarium = program("stellarium")
    stellarium.say(b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n")
    assert stellarium.hear(24) == b""
    assert wait_for(lambda: sum("does not speak" in sentence for sentence in told) == 2)  # the same is said once


def test_a_web_page_cannot_speak_to_a_telescope_through_its_visitors_browser(program, telescope) -> None:
    """A browser posts what a page likes to any port of this computer: its own headers come first."""
    orders = b":Sr05:35:00#:Sd-05*23:00#:MS#"
    head = f"POST / HTTP/1.1\r\nHost: 127.0.0.1:4030\r\nConnection: keep-alive\r\nContent-Length: {len(orders)}\r\n\r\n"
    for protocol in ("lx200", "stellarium"):
        browser = program(protocol)
        browser.say(head.encode() + orders)
        assert browser.hear(100) == b""
    assert telescope.target is None


def test_a_hundred_programs_are_too_many_and_the_next_one_is_served_again(program, telescope, told) -> None:
    telescope.see_mount((10.0, 20.0))
    first = program("lx200")
    assert first.ask(":GR#")
    lines = [program("stellarium").line for _ in range(100)]
    assert wait_for(lambda: any("Too many" in sentence for sentence in told))
    assert sum(telescope.programs.values()) <= MOST_CLIENTS
    assert first.ask(":GR#")
    for line in lines:
        line.close()
    assert wait_for(lambda: sum(telescope.programs.values()) == 1)
    assert program("lx200").ask(":GD#")
    assert len(told) <= offered.MOST_SENTENCES


def test_a_program_that_is_cut_off_leaves_nothing_behind(program, telescope) -> None:
    meade = program("lx200")
    meade.say(":Sr05:3")
    assert wait_for(lambda: telescope.programs)
    meade.line.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    meade.line.close()
    assert wait_for(lambda: not telescope.programs)
    assert telescope.connected_text == "No program connected."


@given(st.lists(st.binary(max_size=50), max_size=20))
def test_commands_come_out_alike_however_the_bytes_are_cut(pieces) -> None:
    def commands(parts):
        cut, found = Commands(), []
        try:
            for part in parts:
                found += cut.feed(part)
        except NotTheProtocol:
            found.append(None)
        return found

    whole = b"".join(pieces)
    if None not in (one := commands([whole])):
        assert commands(pieces) == one


@given(st.binary(min_size=20, max_size=20))
def test_any_twenty_bytes_are_a_place_or_refused(message) -> None:
    try:
        ra, dec = goto_place(message)
    except NotTheProtocol:
        return
    assert 0.0 <= ra < 360.0
    assert abs(dec) <= 90.0
    assert position_message((ra, dec), 0)[12:20] == message[12:20]
    assert GOTO.size == 20


# -- Ports -----------------------------------------------------------------------------------------


def test_a_taken_port_and_an_unknown_protocol_are_one_sentence(telescope, offer) -> None:
    with pytest.raises(PortError, match=r"Can't listen at 127\.0\.0\.1"):
        Offer(telescope, {"lx200": offer.ports["lx200"]})
    with pytest.raises(UsageError, match="no protocol “nexstar”"):
        Offer(telescope, {"nexstar": None})
    offer.stop()
    again = Offer(telescope, {"lx200": offer.ports["lx200"]})
    again.stop()


def test_the_end_of_the_ports_is_quiet_though_programs_are_connected(telescope, caplog) -> None:
    ports = Offer(telescope, {"lx200": 0, "stellarium": 0, "indi": 0})
    programs = [Program(port) for port in ports.ports.values()]
    assert wait_for(lambda: sum(telescope.programs.values()) == 3)
    ports.stop()
    for program in programs:
        with program.line:
            assert program.line.recv(10) == b""
    assert not caplog.records
    assert not telescope.programs


def test_usual_ports_that_are_taken_are_told_and_the_others_offered(telescope, told, monkeypatch) -> None:
    """An indiserver on this computer must not keep SkySafari out."""
    taken = socket.create_server(("127.0.0.1", 0))
    rows = {name: replace(row, port=0) for name, row in PROTOCOLS.items()}
    rows["indi"] = replace(rows["indi"], port=taken.getsockname()[1])
    with taken:
        monkeypatch.setattr("kochab.server.telescope.offer.PROTOCOLS", rows)
        ports = Offer(telescope, {})
        try:
            assert set(ports.ports) == {"lx200", "stellarium", "alpaca"}
            assert any(sentence.startswith("INDI: Can't listen at") for sentence in told)
        finally:
            ports.stop()
        with pytest.raises(PortError):
            Offer(telescope, {"indi": None})
        monkeypatch.setattr("kochab.server.telescope.offer.PROTOCOLS", {"indi": rows["indi"]})
        with pytest.raises(PortError):
            Offer(telescope, {})
