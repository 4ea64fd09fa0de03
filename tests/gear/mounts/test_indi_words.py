"""What a mount behind INDI is told and asked, by INDI's standard properties, with no server behind it."""

from contextlib import nullcontext
from datetime import UTC, datetime, timedelta, timezone

import pytest

from kochab.core.errors import NoAnswerError, NotStoppedError, RefusedError, StoppedError
from kochab.core.frame import Site
from kochab.core.mount import Ability, Direction, Epoch, PierSide, TrackingRate
from kochab.gear.mounts.drivers import indi
from kochab.gear.mounts.guard import Guard
from kochab.gear.mounts.motion_plan import Limits
from kochab.gear.servers import indi_link

COORD, MODE, PARK = "EQUATORIAL_EOD_COORD", "TELESCOPE_TRACK_MODE", "TELESCOPE_PARK"
NS, WE = "TELESCOPE_MOTION_NS", "TELESCOPE_MOTION_WE"
RATES = ("SLEW_GUIDE", "SLEW_CENTERING", "SLEW_FIND", "SLEW_MAX")
USUAL = {
    "CONNECTION": {"CONNECT": "On"},
    COORD: {"RA": "5.5", "DEC": "-12.25"},
    "ON_COORD_SET": {"TRACK": "On", "SLEW": "Off", "SYNC": "Off"},
    "TELESCOPE_ABORT_MOTION": {"ABORT": "Off"},
    "TELESCOPE_TIMED_GUIDE_NS": {"TIMED_GUIDE_N": "0", "TIMED_GUIDE_S": "0"},
    "TELESCOPE_TIMED_GUIDE_WE": {"TIMED_GUIDE_W": "0", "TIMED_GUIDE_E": "0"},
    NS: {"MOTION_NORTH": "Off", "MOTION_SOUTH": "Off"},
    WE: {"MOTION_WEST": "Off", "MOTION_EAST": "Off"},
    "TELESCOPE_TRACK_STATE": {"TRACK_ON": "On", "TRACK_OFF": "Off"},
    MODE: {"TRACK_SIDEREAL": "On", "TRACK_SOLAR": "Off", "TRACK_LUNAR": "Off"},
    "TELESCOPE_SLEW_RATE": {"SLEW_GUIDE": "Off", "SLEW_CENTERING": "On", "SLEW_FIND": "Off", "SLEW_MAX": "Off"},
    PARK: {"PARK": "Off", "UNPARK": "On"},
    "TELESCOPE_PIER_SIDE": {"PIER_EAST": "Off", "PIER_WEST": "On"},
    "GEOGRAPHIC_COORD": {"LAT": "50", "LONG": "352", "ELEV": "120"},
    "TIME_UTC": {"UTC": "2026-01-15T22:00:00", "OFFSET": "1.00"},
}

SITE = Site(50.0, 8.0)


class Link:
    """An INDI server with one telescope, in memory: what it is sent, and how long it is waited for."""

    message, defined_s = "", 0.0

    def __init__(self, vectors, now):
        self.vectors = {vector: dict(members) for vector, members in vectors.items()}
        self.states = dict.fromkeys(vectors, "Idle")
        self.now, self.sent, self.waits, self.news = now, [], [], []
        self.answers = {}  # vector -> its state in the answer, None for silence
        self.takes = True

    def named(self, *_):
        return ["Scope"]

    def value(self, _device, vector, member):
        return self.vectors.get(vector, {}).get(member)

    def number(self, device, vector, member):
        value = self.value(device, vector, member)
        return None if value is None else float(value)

    def state(self, _device, vector):
        return self.states.get(vector)

    def members(self, _device, vector):
        return list(self.vectors.get(vector, {}))

    def heard_since(self, _device, vector, since_s):
        return [(at, state) for name, at, state in self.news if name == vector and at > since_s]

    def spoke_s(self, _device):
        return self.now[0]

    def tell(self, vector, state):
        self.now[0] += 0.001
        self.states[vector] = state
        self.news.append((vector, self.now[0], state))

    def send(self, _device, vector, members):
        self.sent.append((vector, members))
        state = self.answers.get(vector, "Ok")
        if state is None:
            return
        if self.takes and state != "Alert":
            if "On" in members.values():
                self.vectors[vector] = dict.fromkeys(self.vectors[vector], "Off")
            self.vectors[vector] |= members
        self.tell(vector, state)

    def wait(self, come, timeout_s):
        if come():
            return True
        self.waits.append(timeout_s)
        return False

    def check(self):
        pass

    def close(self):
        self.sent.append("closed")


@pytest.fixture
def scope(monkeypatch):
    """A mount over such a server; ``change`` gives other vectors, None where one is missing."""
    now = [1000.0]
    monkeypatch.setattr(indi, "monotonic", lambda: now[0])
    monkeypatch.setattr(indi_link, "monotonic", lambda: now[0])

    def opened(epoch=None, **change):
        link = Link({vector: members for vector, members in (USUAL | change).items() if members is not None}, now)
        monkeypatch.setattr(indi, "IndiLink", lambda _where: link)
        mount = indi.IndiMount("host", epoch=epoch)
        link.waits.clear()
        link.sent.clear()
        now[0] += 100.0
        return mount, link

    return opened


ABSENT = {
    "ON_COORD_SET": {Ability.SYNC, Ability.GOTO},
    "TELESCOPE_ABORT_MOTION": {Ability.STOP, Ability.GOTO, Ability.MOVE},
    "TELESCOPE_TIMED_GUIDE_NS": {Ability.PULSE},
    NS: {Ability.MOVE},
    "TELESCOPE_TRACK_STATE": {Ability.TRACKING},
    MODE: {Ability.LUNAR, Ability.SOLAR},
    PARK: {Ability.PARK, Ability.UNPARK},
    "GEOGRAPHIC_COORD": {Ability.SITE, Ability.SET_SITE},
    "TIME_UTC": {Ability.TIME, Ability.SET_CLOCK},
}


@pytest.mark.parametrize(("vector", "lacking"), ABSENT.items())
def test_what_a_driver_does_not_show_it_cannot_do(scope, vector, lacking) -> None:
    """Without a choice of rates it tracks at the sidereal one; King's rate has few drivers, a home none in common."""
    always = {Ability.HOME, Ability.KING}
    assert set(scope()[0].lacks) == always
    mount, link = scope(**{vector: None})
    assert set(mount.lacks) == always | lacking
    orders = {
        Ability.SYNC: lambda: mount.sync(1.0, 2.0),
        Ability.GOTO: lambda: mount.goto(1.0, 2.0),
        Ability.PULSE: lambda: mount.pulse(Direction.EAST, 9),
        Ability.MOVE: lambda: mount.move(Direction.EAST, 0.1, 9.0),
        Ability.PARK: mount.park,
        Ability.UNPARK: mount.unpark,
    }
    for ability in orders.keys() & lacking:
        with pytest.raises(RefusedError, match=f"Scope has no {vector}"):
            orders[ability]()
    assert not link.sent


@pytest.mark.parametrize(
    ("change", "own", "epoch"),
    [
        ({}, None, Epoch.DATE),
        ({COORD: None, "EQUATORIAL_COORD": USUAL[COORD]}, None, Epoch.J2000),
        ({}, Epoch.J2000, Epoch.J2000),
    ],
)
def test_its_coordinates_are_of_date_or_j2000_by_their_name(scope, change, own, epoch) -> None:
    here = scope(own, **change)[0].position()
    assert (here.ra_deg, here.dec_deg, here.epoch) == (82.5, -12.25, epoch)


def test_a_driver_without_coordinates_is_no_mount_and_its_line_is_given_back(scope, monkeypatch) -> None:
    with pytest.raises(NoAnswerError, match="Scope on host:7624 does not report where it points"):
        scope(**{COORD: None})
    assert indi.IndiLink(None).sent[-1] == "closed"


@pytest.mark.parametrize(
    ("ra", "dec", "valid"),
    [
        ("24", "90", True),
        ("0", "-90", True),
        ("24.001", "0", False),
        ("1", "180.001", False),
        ("nan", "0", False),
        ("1", "nan", False),
        (None, "0", False),
        ("1", None, False),
    ],
)
def test_a_position_is_on_the_sky(scope, ra, dec, valid) -> None:
    mount, link = scope()
    link.vectors[COORD] = {"RA": ra, "DEC": dec}
    if valid:
        assert (mount.position().ra_deg, mount.position().dec_deg) == (0.0, float(dec))
    else:
        with pytest.raises(NoAnswerError, match="no valid position"):
            mount.position()


@pytest.mark.parametrize(
    ("ra", "dec", "place"),
    [("3", "90.9976", (225.0, 89.0024)), ("20", "-91.5", (120.0, -88.5)), ("0", "90", (0.0, 90.0))],
)
def test_a_place_beyond_the_pole_is_one_on_the_other_side(scope, ra, dec, place) -> None:
    """INDI's EQMod leaves Dec 90.9976 when it has parked."""
    mount, link = scope()
    link.vectors[COORD] = {"RA": ra, "DEC": dec}
    assert (mount.position().ra_deg, mount.position().dec_deg) == pytest.approx(place)


@pytest.mark.parametrize(("state", "slewing"), [("Alert", None), ("Off", None), (None, None), ("Ok", False)])
def test_a_driver_that_has_lost_its_mount_does_not_know_whether_it_moves(scope, state, slewing) -> None:
    mount, link = scope()
    link.tell(COORD, state)
    assert mount.state().slewing is slewing
    link.tell(COORD, "Busy")
    assert mount.state().slewing


@pytest.mark.parametrize(("per_look_s", "parked"), [(0.0, True), (1.0, True), (60.0, False)])
def test_parked_is_what_stands(scope, per_look_s, parked) -> None:
    """INDI's OnStep says so while its board still runs there; the right ascension of what stands goes with the stars."""
    mount, link = scope(**{PARK: {"PARK": "On", "UNPARK": "Off"}})
    link.states[PARK] = "Ok"

    def wait(come, timeout_s):
        link.vectors[COORD]["RA"] = str(float(link.vectors[COORD]["RA"]) + per_look_s / 3600.0)
        link.tell(COORD, "Ok")
        return come()

    link.wait = wait
    assert (mount.state().parked, mount.state().slewing) == (parked, not parked)
    per_look_s = 0.0
    assert mount.state().parked  # it has come to rest


def test_while_it_moves_and_three_seconds_after_its_next_report_is_waited_for(scope) -> None:
    mount, link = scope()
    mount.position()
    assert link.waits == []
    link.states[COORD] = "Busy"
    mount.position()
    assert link.waits == pytest.approx([2.5])
    link.states[COORD] = "Ok"
    for begin, lasts_s in (
        (mount.park, 0.0),
        (mount.stop, 0.0),
        (lambda: mount.goto(82.5, -12.25), 0.0),
        (lambda: mount.move(Direction.NORTH, 1.0, 20.0), 20.0),
        (lambda: mount.pulse(Direction.NORTH, 2000), 2.0),
    ):
        link.waits.clear()
        begin()
        mount.watchdog.disarm()
        link.now[0] += lasts_s + 2.9
        mount.position()
        assert len(link.waits) == 1
        link.now[0] += 0.2
        mount.position()
        assert len(link.waits) == 1


@pytest.mark.parametrize(("period", "limit_s"), [("500", 2.0), ("2000", 3.5), ("60000", 4.5)])
def test_a_report_is_waited_for_as_long_as_the_driver_s_own_period(scope, period, limit_s) -> None:
    mount, link = scope(POLLING_PERIOD={"PERIOD_MS": period})
    link.states[COORD] = "Busy"
    mount.position()
    assert link.waits == pytest.approx([limit_s])


def test_a_driver_that_loses_its_mount_is_told_but_not_for_its_refusal_of_a_goto(scope) -> None:
    mount, link = scope()
    link.answers[COORD] = "Alert"
    with pytest.raises(RefusedError, match="Scope refuses the goto"):
        mount.goto(10.0, 20.0)
    mount.position()  # the alert was the refusal
    link.tell(COORD, "Alert")
    with pytest.raises(NoAnswerError, match="gets no position from its mount"):
        mount.position()


@pytest.mark.parametrize(
    ("states", "values", "expected"),
    [
        ({}, {}, (False, False, True, PierSide.WEST, TrackingRate.SIDEREAL)),
        ({COORD: "Busy"}, {}, (True, False, True, PierSide.WEST, TrackingRate.SIDEREAL)),
        ({NS: "Busy"}, {}, (True, False, True, PierSide.WEST, TrackingRate.SIDEREAL)),
        ({WE: "Busy"}, {}, (True, False, True, PierSide.WEST, TrackingRate.SIDEREAL)),
        ({PARK: "Busy"}, {PARK: {"PARK": "On"}}, (True, False, True, PierSide.WEST, TrackingRate.SIDEREAL)),
        ({PARK: "Ok"}, {PARK: {"PARK": "On"}}, (False, True, True, PierSide.WEST, TrackingRate.SIDEREAL)),
        ({}, {MODE: {"TRACK_LUNAR": "On"}}, (False, False, True, PierSide.WEST, TrackingRate.LUNAR)),
        ({}, {MODE: {"TRACK_LUNAR": "Off"}}, (False, False, True, PierSide.WEST, None)),
        ({}, {"TELESCOPE_PIER_SIDE": {"PIER_EAST": "On"}}, (False, False, True, PierSide.EAST, TrackingRate.SIDEREAL)),
        ({}, {"TELESCOPE_PIER_SIDE": {"PIER_EAST": "Off"}}, (False, False, True, None, TrackingRate.SIDEREAL)),
        (
            {},
            {"TELESCOPE_TRACK_STATE": {"TRACK_ON": "Off"}},
            (False, False, False, PierSide.WEST, TrackingRate.SIDEREAL),
        ),
        ({}, {"TELESCOPE_TRACK_STATE": {}}, (False, False, None, PierSide.WEST, TrackingRate.SIDEREAL)),
    ],
)
def test_its_state_is_what_the_driver_shows(scope, states, values, expected) -> None:
    mount, link = scope()
    link.states |= states
    link.vectors |= values
    state = mount.state()
    assert (state.slewing, state.parked, state.tracking, state.pier_side, state.rate) == expected


@pytest.mark.parametrize(
    ("kinds", "alt_azimuth"),
    [
        (None, None),
        ({"ALTAZ": "On", "EQ_FORK": "Off", "EQ_GEM": "Off"}, True),  # INDI's simulator, celestronaux
        ({"MOUNT_TYPE_ALTAZ": "On"}, True),  # the LX200 family
        ({"ALTAZ": "Off", "EQ_GEM": "On"}, None),  # which may be no more than a default
    ],
)
def test_a_mount_in_altitude_and_azimuth_is_known_by_its_driver(scope, kinds, alt_azimuth) -> None:
    mount, link = scope()
    link.vectors |= {"MOUNT_TYPE": kinds} if kinds else {}
    assert mount.state().alt_azimuth is alt_azimuth


@pytest.mark.parametrize(
    ("place", "site"),
    [
        ({"LAT": "50", "LONG": "352", "ELEV": "120"}, Site(50.0, -8.0, 120.0)),
        ({"LAT": "0", "LONG": "8"}, Site(0.0, 8.0, 0.0)),
        ({"LAT": "-33", "LONG": "0", "ELEV": "0"}, Site(-33.0, 0.0, 0.0)),
        ({"LAT": "0", "LONG": "0", "ELEV": "0"}, None),
        ({"LAT": "50"}, None),
        ({"LONG": "8"}, None),
    ],
)
def test_a_driver_that_was_told_no_site_stands_at_zero(scope, place, site) -> None:
    assert scope(GEOGRAPHIC_COORD=place)[0].site_report().site == site


@pytest.mark.parametrize(("longitude", "sent"), [(8.0, "8.0000000"), (-8.0, "352.0000000")])
def test_a_site_and_a_time_are_set_as_the_driver_counts_them(scope, longitude, sent) -> None:
    mount, link = scope()
    mount.set_site(Site(50.0, longitude, 120.0))
    mount.set_clock(datetime(2026, 1, 15, 23, 30, tzinfo=timezone(timedelta(hours=1.5))))
    assert link.sent == [
        ("GEOGRAPHIC_COORD", {"LAT": "50.0000000", "LONG": sent, "ELEV": "120.0000000"}),
        ("TIME_UTC", {"UTC": "2026-01-15T22:00:00", "OFFSET": "1.5"}),
    ]
    lacking, other = scope(GEOGRAPHIC_COORD=None, TIME_UTC=None)
    for order in (lambda: lacking.set_site(SITE), lambda: lacking.set_clock(datetime.now(UTC))):
        with pytest.raises(RefusedError, match="Scope has no"):
            order()
    assert not other.sent


def test_its_clock_runs_from_when_it_was_set(scope) -> None:
    mount, link = scope()
    assert mount.site_report().time_utc is None  # it may have been set years ago
    link.tell("TIME_UTC", "Ok")
    link.now[0] += 30.0
    report = mount.site_report()
    assert abs((report.time_utc - datetime(2026, 1, 15, 22, 0, 30, tzinfo=UTC)).total_seconds()) < 1e-3
    assert report.utc_offset_h == 1.0
    link.vectors["TIME_UTC"]["OFFSET"] = " "
    assert mount.site_report().utc_offset_h is None


def test_a_goto_and_a_sync_are_coordinates_after_their_switch(scope) -> None:
    mount, link = scope()
    link.answers[COORD] = "Busy"
    mount.goto(82.5, -12.25)
    aim = (COORD, {"RA": "5.500000000", "DEC": "-12.25000000"})
    assert link.sent == [aim]  # the switch was on
    mount.sync(82.5, -12.25)
    assert link.sent[1:] == [("ON_COORD_SET", {"SYNC": "On"}), aim]


@pytest.mark.parametrize(("off_deg", "begun"), [(0.019, True), (0.021, False)])
def test_a_goto_that_does_not_begin_is_refused_unless_it_is_there(scope, off_deg, begun) -> None:
    mount, link = scope()
    link.takes = False
    if begun:
        mount.goto(82.5, -12.25 + off_deg)
        assert link.waits == []
    else:
        with pytest.raises(RefusedError, match="Scope does not begin the goto"):
            mount.goto(82.5, -12.25 + off_deg)
        assert link.waits == [5.0]
        link.vectors["ON_COORD_SET"] = {"SYNC": "On"}
        mount.sync(82.5, -12.25 + off_deg)  # the guard reads it back


@pytest.mark.parametrize(
    ("ability", "answer", "waits"),
    [
        ("goto", "Busy", []),
        ("goto", "Alert", [indi.BEGINS_S]),  # a refusal is believed of a mount that stands
        ("sync", "Alert", []),
        ("sync", "Busy", [5.0]),
        ("sync", "Ok", [5.0]),
    ],
)
def test_a_goto_is_taken_when_it_is_busy_and_a_sync_when_it_is_there(scope, ability, answer, waits) -> None:
    mount, link = scope()
    link.vectors["ON_COORD_SET"] = {ability.upper().replace("GOTO", "TRACK"): "On"}
    link.answers[COORD], link.takes = answer, False
    with pytest.raises(RefusedError) if answer == "Alert" else nullcontext():
        getattr(mount, ability)(10.0, 20.0)
    assert link.waits == waits


@pytest.mark.parametrize(
    ("order", "first", "last"),
    [
        (lambda m: m.goto(10.0, 20.0), "ON_COORD_SET", COORD),
        (lambda m: m.move(Direction.NORTH, 3.0, 60.0), "TELESCOPE_SLEW_RATE", NS),
    ],
)
def test_a_stop_between_two_words_lets_no_motion_begin(scope, monkeypatch, order, first, last) -> None:
    mount, link = scope(ON_COORD_SET={"TRACK": "Off", "SYNC": "On"})
    send = link.send

    def stopped(device, vector, members):
        send(device, vector, members)
        if vector == first:
            mount.stop()

    monkeypatch.setattr(link, "send", stopped)
    with pytest.raises(StoppedError):
        order(mount)
    assert last not in [vector for vector, _ in link.sent]


def test_a_move_that_could_not_be_ended_is_told_before_the_next(scope) -> None:
    mount, link = scope()
    mount.watchdog.failure = NoAnswerError("It may still move.")
    with pytest.raises(NotStoppedError, match="It may still move"):
        mount.move(Direction.NORTH, 0.1, 1.0)
    assert not link.sent


@pytest.mark.parametrize(
    ("order", "vector", "what"),
    [
        (lambda m: m.goto(10.0, 20.0), COORD, "goto"),
        (lambda m: m.pulse(Direction.WEST, 100), "TELESCOPE_TIMED_GUIDE_WE", "guide pulse"),
        (lambda m: m.move(Direction.SOUTH, 1.0, 0.5), NS, "move"),
        (lambda m: m.track(TrackingRate.LUNAR), MODE, "tracking rate"),
        (lambda m: m.track(TrackingRate.OFF), "TELESCOPE_TRACK_STATE", "change of tracking"),
        (lambda m: m.park(), PARK, "park"),
        (lambda m: m.unpark(), PARK, "unpark"),
    ],
)
def test_an_order_that_is_refused_or_not_answered_is_told(scope, order, vector, what) -> None:
    mount, link = scope()
    link.answers[vector] = "Alert"
    with pytest.raises(RefusedError, match=f"Scope refuses the {what}"):
        order(mount)
    link.answers[vector] = None
    link.waits.clear()
    with pytest.raises(NoAnswerError, match=f"does not answer to a {what} on its INDI server"):
        order(mount)
    assert link.waits[-1] == 5.0
    mount.watchdog.disarm()


@pytest.mark.parametrize(("answer", "words"), [("Alert", "refuses the stop"), (None, "does not answer to a stop")])
def test_a_stop_that_is_not_taken_is_no_answer_so_that_it_is_sent_again(scope, answer, words) -> None:
    mount, link = scope()
    mount.stop()
    assert link.sent == [("TELESCOPE_ABORT_MOTION", {"ABORT": "On"})]
    link.answers["TELESCOPE_ABORT_MOTION"] = answer
    with pytest.raises(NoAnswerError, match=words):
        mount.stop()
    assert link.waits == ([1.0] if answer is None else [])


@pytest.mark.parametrize(
    ("direction", "axis", "member", "other"),
    [
        (Direction.NORTH, "NS", "N", "S"),
        (Direction.SOUTH, "NS", "S", "N"),
        (Direction.EAST, "WE", "E", "W"),
        (Direction.WEST, "WE", "W", "E"),
    ],
)
def test_each_direction_has_its_members(scope, direction, axis, member, other) -> None:
    mount, link = scope()
    mount.pulse(direction, 250)
    assert link.sent == [
        (f"TELESCOPE_TIMED_GUIDE_{axis}", {f"TIMED_GUIDE_{member}": "250", f"TIMED_GUIDE_{other}": "0"})
    ]
    link.sent.clear()
    mount.move(direction, 0.1, 60.0)
    assert mount.watchdog.moving
    vector, way = f"TELESCOPE_MOTION_{axis}", f"MOTION_{direction.name}"
    assert link.sent == [(vector, {way: "On"})]
    mount._end_move(vector, way)
    assert link.sent[-1] == (vector, {way: "Off"})
    link.answers[vector] = None
    with pytest.raises(NoAnswerError, match="does not answer to the end of a move"):
        mount._end_move(vector, way)
    assert link.waits == [1.0]
    mount.watchdog.disarm()


@pytest.mark.parametrize(
    ("deg_s", "rate"), [(0.019, 0), (0.021, 1), (0.29, 1), (0.31, 2), (1.49, 2), (1.51, 3), (4.0, 3)]
)
def test_a_speed_is_taken_for_one_of_the_driver_s_rates(scope, deg_s, rate) -> None:
    """INDI's own four: guide, centering, find, max; those that a person sets are left alone."""
    mount, link = scope()
    link.vectors["TELESCOPE_SLEW_RATE"] = {**dict.fromkeys(RATES, "Off"), "SLEW_CUSTOM": "On"}
    mount.move(Direction.NORTH, deg_s, 60.0)
    mount.watchdog.disarm()
    assert link.sent[0] == ("TELESCOPE_SLEW_RATE", {RATES[rate]: "On"})
    link.vectors["TELESCOPE_SLEW_RATE"] = {}
    mount.move(Direction.NORTH, deg_s, 60.0)
    mount.watchdog.disarm()
    assert link.sent[-1] == (NS, {"MOTION_NORTH": "On"})


def test_tracking_is_its_rate_and_then_on_or_off(scope) -> None:
    mount, link = scope()
    on = ("TELESCOPE_TRACK_STATE", {"TRACK_ON": "On"})
    for rate, sent in (
        (TrackingRate.SIDEREAL, [on]),
        (TrackingRate.LUNAR, [(MODE, {"TRACK_LUNAR": "On"}), on]),
        (TrackingRate.LUNAR, [on]),
        (TrackingRate.OFF, [("TELESCOPE_TRACK_STATE", {"TRACK_OFF": "On"})]),
    ):
        link.sent.clear()
        mount.track(rate)
        assert link.sent == sent
    with pytest.raises(RefusedError, match="TRACK_KING"):
        mount.track(TrackingRate.KING)
    only, other = scope(**{MODE: None})
    only.track(TrackingRate.SIDEREAL)
    assert other.sent == [on]


def test_park_and_unpark_are_two_members_of_one_switch(scope) -> None:
    mount, link = scope()
    mount.park()
    mount.unpark()
    assert link.sent == [(PARK, {"PARK": "On"}), (PARK, {"UNPARK": "On"})]
    with pytest.raises(RefusedError, match="no home in common"):
        mount.go_home()
    assert mount.altaz_deg() is None
    assert mount.identify() == "Scope"


def test_closing_stops_a_move_and_leaves_the_mount_connected(scope) -> None:
    mount, link = scope()
    mount.close()
    assert link.sent == ["closed"]
    mount.move(Direction.EAST, 0.1, 60.0)
    link.sent.clear()
    mount.close()
    still = (WE, {"MOTION_WEST": "Off", "MOTION_EAST": "Off"})
    assert link.sent == [("TELESCOPE_ABORT_MOTION", {"ABORT": "On"}), still, "closed"]


# -- what INDI's drivers of StarGo, StarBook and EXOS-2 taught; the drivers themselves are in tests/boards/test_through_indi.py


def test_a_driver_that_has_fallen_silent_is_asked_before_its_place_is_believed(scope) -> None:
    mount, link = scope()
    link.spoke_s = lambda _device: link.now[0] - 2.4
    mount.position()
    assert link.sent == []  # it spoke within its own period and a little
    link.spoke_s = lambda _device: link.now[0] - 2.6
    mount.position()
    assert link.sent == [("ON_COORD_SET", {"TRACK": "On"})]  # which it is
    assert mount.missed == 0
    link.answers["ON_COORD_SET"] = None
    with pytest.raises(NoAnswerError, match=r"Scope does not answer: is its mount switched on\?"):
        mount.position()
    assert mount.missed == 1
    link.vectors["ON_COORD_SET"] = {}
    mount.position()  # it has no such question


def test_a_position_that_its_mount_did_not_tell_counts_as_missed(scope) -> None:
    mount, link = scope()
    link.tell(COORD, "Alert")
    with pytest.raises(NoAnswerError, match="gets no position"):
        mount.position()
    assert mount.missed == 1


@pytest.mark.parametrize(
    "order", [lambda m: m.goto(82.5, -12.25), lambda m: m.park(), lambda m: m.move(Direction.NORTH, 1.0, 1.0)]
)
@pytest.mark.parametrize(("late_s", "believed"), [(2.9, True), (3.1, False)])
def test_a_motion_that_its_driver_passes_on_late_is_not_believed(scope, order, late_s, believed) -> None:
    """The guard stops what raises this: the mount may just have woken up, at a false home."""
    mount, link = scope()
    tell = link.tell

    def late(vector, state):
        if vector in (COORD, PARK, NS):
            link.now[0] += late_s - 0.001
        tell(vector, state)

    link.tell = late
    with (
        nullcontext() if believed else pytest.raises(NoAnswerError, match=r"took 3 s to pass on the \w+: was its mount")
    ):
        order(mount)
    mount.watchdog.disarm()
    assert mount.missed == (0 if believed else 1)


def test_a_slew_that_its_driver_calls_over_while_the_place_runs_goes_on(scope) -> None:
    mount, link = scope()
    assert mount.state().slewing is False
    mount.goto(82.5, 40.0)
    link.states[COORD] = "Ok"
    link.vectors[COORD] = {"RA": "5.5", "DEC": "-12.25"}
    for dec in (-12.25, -12.25, -10.0, -5.0, 20.0, 39.0):
        link.vectors[COORD]["DEC"] = str(dec)
        link.now[0] += 1.0
        assert mount.state().slewing is True, dec
    link.now[0] += 2.4
    assert mount.state().slewing is True
    link.now[0] += 0.2
    assert mount.state().slewing is False  # it has not changed for longer than a report takes
    link.vectors[COORD]["DEC"] = "60"
    assert mount.state().slewing is False  # and what somebody else does is as the driver says


def test_a_goto_to_where_it_stands_and_a_stopped_one_are_over_at_once(scope) -> None:
    mount, link = scope()
    mount.goto(82.5, -12.25)
    link.states[COORD] = "Ok"
    link.now[0] += 2.6
    assert mount.state().slewing is False
    mount.goto(82.5, 40.0)
    mount.stop()
    link.states[COORD] = "Ok"
    assert mount.state().slewing is False


@pytest.mark.parametrize(("moves", "kind"), [(False, RefusedError), (True, NoAnswerError)])
def test_a_goto_that_is_refused_while_the_mount_sets_out_is_no_refusal(scope, moves, kind) -> None:
    mount, link = scope()
    mount.state()
    link.answers[COORD], link.takes = "Alert", False

    def wait(come, timeout_s):
        if moves and timeout_s == indi.BEGINS_S:
            link.now[0] += 1.0
            link.vectors[COORD]["DEC"] = "-11"
        return come()

    link.wait = wait
    with pytest.raises(kind, match="Scope refuses the goto"):
        mount.goto(82.5, 40.0)


def test_a_mount_that_stands_parked_is_parked_whatever_its_driver_waits_for_and_can_be_unparked(scope) -> None:
    mount, link = scope()
    mount.state()
    mount.park()
    link.states[COORD] = "Busy"
    link.now[0] += 9.9
    assert mount.state().slewing is True
    link.now[0] += 0.2
    assert (mount.state().parked, mount.state().slewing) == (True, False)
    link.vectors[COORD]["RA"] = "5.6"
    assert mount.state().slewing is True  # it moves all the same
    link.now[0] += 10.1
    link.sent.clear()
    mount.unpark()
    assert [vector for vector, _ in link.sent] == ["TELESCOPE_ABORT_MOTION", PARK]


def test_a_mount_that_wakes_at_the_pole_after_its_driver_failed_to_read_it_needs_a_sync(scope) -> None:
    """INDI's driver told of the failure between two looks; at the second it reads again."""
    mount, link = scope(**{COORD: {"RA": "5.5", "DEC": "88.5"}})
    guard = Guard(mount, SITE, Limits())
    guard.position()
    assert mount.missed == 0
    link.tell(COORD, "Alert")
    link.tell(COORD, "Ok")
    link.vectors[COORD] = {"RA": "7.5", "DEC": "90.0"}
    guard.position()
    assert mount.missed == 1
    assert "Was it switched off and on?" in guard.policy.slew_block_reason


def test_an_alert_that_refuses_an_order_is_no_missed_answer(scope) -> None:
    mount, link = scope()
    link.answers[COORD] = "Alert"
    with pytest.raises(RefusedError):
        mount.sync(80.0, 10.0)
    mount.position()
    assert mount.missed == 0
