"""What a mount behind Alpaca is told and asked, by ASCOM's API reference (ITelescopeV3), with no server behind it."""

from datetime import UTC, datetime, timedelta, timezone

import pytest

from kochab.core.errors import DeviceError, LineLostError, NoAnswerError, RefusedError, StoppedError
from kochab.core.frame import Site
from kochab.core.mount import Ability, Direction, Epoch, PierSide, TrackingRate
from kochab.gear.mounts.drivers import alpaca
from kochab.gear.mounts.guard import Guard
from kochab.gear.mounts.motion_plan import Limits

RATES = (TrackingRate.SIDEREAL, TrackingRate.LUNAR, TrackingRate.SOLAR, TrackingRate.KING)
USUAL = {
    "alignmentmode": 1,  # a fork
    "equatorialsystem": 1,
    "cansync": True,
    "canslewasync": True,
    "canpulseguide": True,
    "cansettracking": True,
    "trackingrates": [0, 1, 2, 3],
    "trackingrate": 0,
    "rightascension": 5.5,
    "declination": -12.25,
    "slewing": False,
    "tracking": True,
    "atpark": False,
    "sideofpier": 1,
    "sitelatitude": 50.0,
    "sitelongitude": 8.0,
    "siteelevation": 120.0,
    "utcdate": "2026-01-15T22:00:00.0000000Z",
    "name": "Scope",
}


class Link:
    """A server with one telescope, in memory: its properties, and what it is sent."""

    def __init__(self, **change):
        self.properties = {name: value for name, value in (USUAL | change).items() if value is not None}
        self.sent, self.limits, self.refused = [], [], set()
        self.open = False

    def devices(self):
        return [(0, "Scope")]

    def get(self, path, query=None):
        name, self.open = path.removeprefix("telescope/0/"), True
        if name not in self.properties:
            raise RefusedError(f"{name} is not implemented")
        value = self.properties[name]
        return value(query) if callable(value) else value

    def put(self, path, values, limit_s=None):
        name, self.open = path.removeprefix("telescope/0/"), True
        if name in self.refused:
            raise RefusedError(f"{name} is refused")
        self.sent.append((name, values))
        self.limits.append(limit_s)

    def close(self):
        self.open = False


@pytest.fixture
def scope(monkeypatch):
    """A mount over such a server; ``change`` gives other properties, None where one is missing."""

    def opened(epoch=None, **change):
        link = Link(**change)
        monkeypatch.setattr(alpaca, "AlpacaLink", lambda *_: link)
        mount = alpaca.AlpacaMount("host", epoch=epoch)
        assert link.sent == [("connected", {"Connected": True})]
        assert link.limits == [20.0]  # a driver may have to wake its mount
        link.sent.clear()
        return mount, link

    return opened


NEVER = {Ability.PARK, Ability.UNPARK, Ability.HOME}
EVERY_RATE = {Ability.SIDEREAL, Ability.LUNAR, Ability.SOLAR, Ability.KING}


@pytest.mark.parametrize(
    ("change", "lacking"),
    [
        ({}, set()),
        ({"cansync": False}, {Ability.SYNC}),
        ({"canslewasync": False}, {Ability.GOTO, Ability.MOVE}),
        ({"canpulseguide": None}, {Ability.PULSE}),
        ({"cansettracking": False}, {Ability.TRACKING, *EVERY_RATE}),
        ({"trackingrates": [0, 2]}, {Ability.LUNAR, Ability.KING}),
        ({"trackingrates": []}, EVERY_RATE - {Ability.SIDEREAL}),
        ({"trackingrates": None}, EVERY_RATE - {Ability.SIDEREAL}),
        ({"sitelatitude": None}, {Ability.SITE, Ability.SET_SITE}),
        ({"utcdate": None}, {Ability.TIME, Ability.SET_CLOCK}),
    ],
)
def test_what_its_driver_says_it_cannot_is_lacking(scope, change, lacking) -> None:
    mount, link = scope(**change)
    assert set(mount.lacks) == NEVER | lacking
    orders = {Ability.SYNC: lambda: mount.sync(1.0, 2.0), Ability.MOVE: lambda: mount.move(Direction.EAST, 1.0, 1.0)}
    orders |= {
        Ability.PULSE: lambda: mount.pulse(Direction.EAST, 9),
        Ability.PARK: mount.park,
        Ability.HOME: mount.go_home,
    }
    orders |= {Ability.UNPARK: mount.unpark, Ability.GOTO: lambda: mount.goto(1.0, 2.0)}
    for ability in orders.keys() & mount.lacks.keys():
        with pytest.raises(RefusedError, match=mount.lacks[ability].split(" (")[0]):
            orders[ability]()
    assert not link.sent


@pytest.mark.parametrize(
    ("system", "own", "epoch"),
    [
        (1, None, Epoch.DATE),
        (2, None, Epoch.J2000),
        (3, None, Epoch.DATE),
        (None, None, Epoch.DATE),
        (1, Epoch.J2000, Epoch.J2000),
    ],
)
def test_only_one_equatorial_system_is_j2000(scope, system, own, epoch) -> None:
    here = scope(own, equatorialsystem=system)[0].position()
    assert (here.ra_deg, here.dec_deg, here.epoch) == (82.5, -12.25, epoch)


@pytest.mark.parametrize(
    ("ra", "dec", "valid"),
    [
        (24.0, 90.0, True),
        (0.0, -90.0, True),
        (24.01, 0.0, False),
        (-0.01, 0.0, False),
        (1.0, 90.01, False),
        (1.0, -90.01, False),
    ],
)
def test_a_position_is_on_the_sky(scope, ra, dec, valid) -> None:
    mount, _ = scope(rightascension=ra, declination=dec)
    if valid:
        assert (mount.position().ra_deg, mount.position().dec_deg) == (0.0, dec)
    else:
        with pytest.raises(NoAnswerError, match="no valid position"):
            mount.position()


def test_a_position_that_is_refused_is_told(scope) -> None:
    mount, link = scope()
    del link.properties["declination"]
    with pytest.raises(RefusedError, match="declination is not implemented"):
        mount.position()


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("slewing", {True: True, False: False}),
        ("parked", {True: True, False: False, None: None}),
        ("tracking", {True: True, False: False, None: None}),
        ("pier_side", {0: PierSide.EAST, 1: PierSide.WEST, -1: None, None: None}),
        ("rate", {0: RATES[0], 1: RATES[1], 2: RATES[2], 3: RATES[3], 4: None, -1: None, None: None}),
        ("alt_azimuth", {0: True, 1: False, 2: False, 3: None, None: None}),
    ],
)
def test_its_state_is_what_the_server_shows(scope, name, values) -> None:
    asked = {"parked": "atpark", "pier_side": "sideofpier", "rate": "trackingrate", "alt_azimuth": "alignmentmode"}
    asked = asked.get(name, name)
    for told, meant in values.items():
        mount, _ = scope(**{asked: told})
        assert getattr(mount.state(), name) is meant


@pytest.mark.parametrize("told", [None, "false", 0, float("nan"), []])
def test_a_state_that_is_null_or_no_truth_is_unknown_and_never_stands(scope, told) -> None:
    """``null`` where a word is due was taken for false: a mount that slews would have stood."""
    mount, link = scope()
    names = ("slewing", "atpark", "tracking", "trackingrate", "sideofpier", "alignmentmode")
    link.properties |= dict.fromkeys(names, told)
    state = mount.state()
    assert (state.slewing, state.parked, state.tracking) == (None, None, None)
    link.refused.add("abortslew")
    with pytest.raises(RefusedError, match="abortslew is refused"):
        mount.stop()
    del link.properties["slewing"]
    assert mount.state().slewing is None


@pytest.mark.parametrize("name", ["rightascension", "declination"])
@pytest.mark.parametrize("told", [None, float("nan"), "x", float("inf")])
def test_a_position_that_is_no_number_is_none(scope, name, told) -> None:
    mount, link = scope()
    link.properties[name] = told
    with pytest.raises(NoAnswerError, match=r"reports (no valid position|invalid values)"):
        mount.position()


@pytest.mark.parametrize(
    ("change", "altaz"),
    [({"altitude": 30.5, "azimuth": 200.25}, (30.5, 200.25)), ({"altitude": 30.5}, None), ({"azimuth": 200.25}, None)],
)
def test_altitude_and_azimuth_where_it_has_both(scope, change, altaz) -> None:
    assert scope(**change)[0].altaz_deg() == altaz


@pytest.mark.parametrize(
    ("change", "site"),
    [
        ({}, Site(50.0, 8.0, 120.0)),
        ({"siteelevation": None}, Site(50.0, 8.0, 0.0)),
        ({"sitelatitude": None}, None),
        ({"sitelongitude": None}, None),
    ],
)
def test_its_site_and_its_clock(scope, change, site) -> None:
    report = scope(**change)[0].site_report()
    assert report.site == site
    assert report.time_utc == datetime(2026, 1, 15, 22, tzinfo=UTC)
    assert scope(utcdate=None)[0].site_report().time_utc is None


def test_a_site_and_a_time_are_set_where_they_are_told(scope) -> None:
    mount, link = scope()
    mount.set_site(Site(50.5, -8.25, 120.0))
    mount.set_clock(datetime(2026, 1, 15, 23, 30, tzinfo=timezone(timedelta(hours=1))))
    assert link.sent == [
        ("sitelatitude", {"SiteLatitude": 50.5}),
        ("sitelongitude", {"SiteLongitude": -8.25}),
        ("utcdate", {"UTCDate": "2026-01-15T22:30:00.000000Z"}),
    ]
    lacking, other = scope(sitelatitude=None, utcdate=None)
    for order in (lambda: lacking.set_site(Site(50.0, 8.0)), lambda: lacking.set_clock(datetime.now(UTC))):
        with pytest.raises(RefusedError):
            order()
    assert not other.sent


PLACE = {"RightAscension": "5.500000000", "Declination": "-12.25000000"}


@pytest.mark.parametrize(
    ("tracking", "cansettracking", "first"),
    [(True, True, []), (False, True, [("tracking", {"Tracking": True})]), (False, False, [])],
)
def test_a_goto_turns_tracking_on_where_it_can(scope, tracking, cansettracking, first) -> None:
    mount, link = scope(tracking=tracking, cansettracking=cansettracking)
    mount.goto(82.5, -12.25)
    assert link.sent == [*first, ("slewtocoordinatesasync", PLACE)]


def test_a_sync_is_its_coordinates(scope) -> None:
    mount, link = scope()
    mount.sync(82.5, -12.25)
    assert link.sent == [("synctocoordinates", PLACE)]


def test_a_stop_that_is_refused_matters_only_while_it_slews(scope) -> None:
    mount, link = scope()
    mount.stop()
    assert link.sent == [("abortslew", {})]
    link.refused.add("abortslew")
    mount.stop()
    link.properties["slewing"] = True
    with pytest.raises(RefusedError, match="abortslew"):
        mount.stop()


@pytest.mark.parametrize(
    ("direction", "number", "dec", "hours"),
    [
        (Direction.NORTH, 0, -10.25, 5.5),
        (Direction.SOUTH, 1, -14.25, 5.5),
        (Direction.EAST, 2, -12.25, 5.5 + 2 / 15),
        (Direction.WEST, 3, -12.25, 5.5 - 2 / 15),
    ],
)
def test_each_direction_has_its_number_and_its_sign(scope, direction, number, dec, hours) -> None:
    mount, link = scope()
    mount.pulse(direction, 250)
    mount.move(direction, 0.5, 4.0)
    slew = {"RightAscension": f"{hours:.9f}", "Declination": f"{dec:.8f}"}
    assert link.sent == [("pulseguide", {"Direction": number, "Duration": 250}), ("slewtocoordinatesasync", slew)]


def test_a_move_ends_at_the_pole_and_goes_round_the_first_point_of_aries(scope) -> None:
    for direction, dec, end in ((Direction.NORTH, 89.5, "90.00000000"), (Direction.SOUTH, -89.5, "-90.00000000")):
        mount, link = scope(declination=dec)
        mount.move(direction, 0.5, 4.0)
        assert link.sent[0][1]["Declination"] == end
    mount, link = scope(rightascension=0.1)
    mount.move(Direction.WEST, 0.5, 4.0)
    assert float(link.sent[0][1]["RightAscension"]) == pytest.approx(24.1 - 2.0 / 15.0)


@pytest.mark.parametrize(
    ("mode", "after", "flips"), [(2, 0, True), (2, 1, False), (1, 0, False), (0, 0, False), (None, 0, True)]
)
def test_a_german_mount_is_not_flipped_by_a_move(scope, mode, after, flips) -> None:
    """Which side it will be on, it is asked with the coordinates of the end; unknown, it may be a German one."""
    asked = []
    mount, link = scope(alignmentmode=mode, destinationsideofpier=lambda query: asked.append(query) or after)
    if flips:
        with pytest.raises(RefusedError, match="would flip"):
            mount.move(Direction.NORTH, 0.5, 4.0)
        assert not link.sent
    else:
        mount.move(Direction.NORTH, 0.5, 4.0)
    assert asked == [PLACE | {"Declination": "-10.25000000"}] * (mode in (2, None))


def test_tracking_is_its_rate_where_it_has_another_and_then_on_or_off(scope) -> None:
    on, off = (("tracking", {"Tracking": on}) for on in (True, False))
    for now, rate, sent in (
        (0, TrackingRate.SIDEREAL, [on]),
        (None, TrackingRate.SIDEREAL, [on]),
        (2, TrackingRate.SIDEREAL, [("trackingrate", {"TrackingRate": 0}), on]),
        (0, TrackingRate.KING, [("trackingrate", {"TrackingRate": 3}), on]),
        (3, TrackingRate.KING, [on]),
        (2, TrackingRate.OFF, [off]),
    ):
        mount, link = scope(trackingrate=now)
        mount.track(rate)
        assert link.sent == sent
    with pytest.raises(RefusedError, match="no command for this rate"):
        scope(trackingrates=[0])[0].track(TrackingRate.LUNAR)


@pytest.mark.parametrize(
    "order",
    [
        lambda m: m.position(),
        lambda m: m.state(),
        lambda m: m.goto(1.0, 2.0),
        lambda m: m.move(Direction.NORTH, 0.1, 1.0),
        lambda m: m.stop(),
        lambda m: m.close(),
    ],
)
def test_every_exchange_has_a_connection_of_its_own(scope, order) -> None:
    mount, link = scope(alignmentmode=2, destinationsideofpier=1)
    order(mount)
    assert not link.open


@pytest.mark.parametrize("change", [{"sideofpier": None, "destinationsideofpier": 1}, {"destinationsideofpier": None}])
def test_a_german_mount_that_does_not_tell_its_sides_is_not_moved(scope, change) -> None:
    mount, link = scope(alignmentmode=2, **change)
    with pytest.raises(RefusedError, match="would flip on this move"):
        mount.move(Direction.NORTH, 0.5, 4.0)
    assert not link.sent


def test_a_stop_while_tracking_is_turned_on_lets_no_goto_begin(scope, monkeypatch) -> None:
    mount, link = scope(tracking=False)
    put = link.put

    def stopped(path, values, *limit):
        put(path, values, *limit)
        if path.endswith("tracking"):
            mount.stop()

    monkeypatch.setattr(link, "put", stopped)
    with pytest.raises(StoppedError):
        mount.goto(1.0, 2.0)
    assert "slewtocoordinatesasync" not in [name for name, _ in link.sent]


def test_after_it_was_closed_nothing_is_asked(scope) -> None:
    mount, link = scope()
    assert mount.identify() == "Scope"
    mount.close()
    for order in (mount.position, lambda: mount.sync(1.0, 2.0)):
        with pytest.raises(LineLostError, match="was closed"):
            order()
    assert not link.sent
    assert scope(name=None)[0].identify() == "Alpaca telescope"


@pytest.mark.parametrize("lost", ["rightascension", "declination"])
def test_a_mount_that_wakes_at_home_after_its_server_missed_an_answer_needs_a_sync(scope, lost) -> None:
    mount, link = scope(declination=85.0, athome=False)
    guard = Guard(mount, Site(50.0, 8.0), Limits())
    guard.position()
    link.properties[lost] = unanswered
    with pytest.raises(DeviceError):
        guard.position()
    assert mount.missed == 1
    link.properties |= {"rightascension": 5.5, "declination": 86.5, "athome": True}  # as near as it might have tracked
    guard.position()
    assert "Was it switched off and on?" in guard.policy.slew_block_reason


def unanswered(_):
    raise RefusedError("The telescope refused: timed out.")
