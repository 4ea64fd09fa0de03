"""The Alpaca device, asked by ASCOM's own client (alpyca), and held against the standard's tables."""

import http.client
import inspect
import json
import re
import threading
from datetime import datetime

import pytest

from kochab.core.attitude import apart_deg
from kochab.server.telescope.alpaca import AlpacaTelescope
from tests.server.telescope.conftest import NIGHT, wait_for
from tests.server.telescope.test_offered import from_date, of_date

alpaca_discovery = pytest.importorskip("alpaca.discovery")
from alpaca import exceptions, management  # noqa: E402
from alpaca.telescope import DriveRates, EquatorialCoordinateType, GuideDirections, Telescope, TelescopeAxes  # noqa: E402

PLACE = (83.822, -5.391)


@pytest.fixture
def offered(steered):
    return steered


@pytest.fixture
def device(offered):
    served = AlpacaTelescope(offered, "127.0.0.1", 0, 0)
    yield served
    served.stop()


@pytest.fixture
def client(device):
    return Telescope(f"127.0.0.1:{device.port}", 0)


def ask(device, method, path, body=None, kind="application/x-www-form-urlencoded"):
    line = http.client.HTTPConnection("127.0.0.1", device.port, timeout=60)
    try:
        line.request(method, path, body, {"Content-Type": kind} if body is not None else {})
        answer = line.getresponse()
        return answer.status, answer.read()
    finally:
        line.close()


def test_a_post_which_a_web_page_elsewhere_may_send_is_refused(device) -> None:
    status, _ = ask(device, "POST", "/api/v1/telescope/0/connect", b"")
    assert status == 405
    assert json.loads(ask(device, "GET", "/api/v1/telescope/0/connected")[1])["Value"] is False


def test_it_is_found_and_described(offered, told) -> None:
    served = AlpacaTelescope(offered, "127.0.0.1", 0)
    try:
        if any("discovered" in sentence for sentence in told):
            pytest.skip("another program has UDP port 32227")
        found = [one for one in alpaca_discovery.search_ipv4(1, 1) if one.endswith(f":{served.port}")]
        assert found
        assert management.apiversions(found[0]) == [1]
        assert management.description(found[0])["ServerName"] == "Kochab"
        (device,) = management.configureddevices(found[0])
        assert (device["DeviceType"], device["DeviceNumber"]) == ("Telescope", 0)
    finally:
        served.stop()


def test_nothing_but_its_name_is_told_before_it_is_connected(client, offered) -> None:
    assert not client.Connected
    assert client.Name == "Kochab"
    assert client.InterfaceVersion == 4
    with pytest.raises(exceptions.NotConnectedException):
        _ = client.RightAscension
    client.Connected = True
    assert client.Connected
    assert offered.connected_text == "Connected: Alpaca."
    with pytest.raises(exceptions.ValueNotSetException):
        _ = client.RightAscension  # connected, and nothing was solved yet
    client.Connected = False
    assert offered.connected_text == "No program connected."


def test_a_program_of_platform_7_connects_and_reads_all_at_once(client, offered) -> None:
    assert not client.Connecting
    with pytest.raises(exceptions.NotConnectedException):
        _ = client.DeviceState
    client.Connect()
    assert not client.Connecting
    assert client.Connected
    before = {one["Name"]: one["Value"] for one in client.DeviceState}
    assert "RightAscension" not in before  # nothing was solved yet, and what there is not is left out
    assert before["AtPark"] is False
    offered.see_mount(PLACE, slewing=True)
    state = {one["Name"]: one["Value"] for one in client.DeviceState}
    assert set(state) == {
        "Altitude", "AtHome", "AtPark", "Azimuth", "Declination", "RightAscension", "SiderealTime", "Slewing",
        "Tracking", "UTCDate", "TimeStamp",
    }  # fmt: skip
    for name in set(state) - {"UTCDate", "TimeStamp"}:
        assert state[name] == getattr(client, name)
    assert datetime.fromisoformat(state["UTCDate"].replace("Z", "+00:00")) == NIGHT
    assert state["Slewing"] is True
    client.Disconnect()
    assert not client.Connected
    assert offered.connected_text == "No program connected."


def test_a_program_of_before_platform_7_connects_as_ever(device, client, offered) -> None:
    """One that knows no Connect: alpyca does its own in its place when a device says that it is of V3."""
    client._plat7_intvers = {**client._plat7_intvers, "telescope": 5}
    client.Connect()
    assert wait_for(lambda: not client.Connecting)
    assert client.Connected
    offered.see_mount(PLACE)
    assert apart_deg((client.RightAscension * 15.0, client.Declination), of_date(*PLACE)) * 3600.0 < 0.05
    client.Disconnect()
    assert wait_for(lambda: not client.Connecting)
    assert not client.Connected


def test_the_place_is_of_date(client, offered) -> None:
    client.Connected = True
    offered.see_mount(PLACE)
    assert client.EquatorialSystem == EquatorialCoordinateType.equTopocentric
    told = client.RightAscension * 15.0, client.Declination
    assert apart_deg(told, of_date(*PLACE)) * 3600.0 < 0.05
    assert client.SiteLatitude == 48.14
    assert client.SiderealTime == pytest.approx(3.18, abs=0.02)  # 4 h 22 m UT-sidereal of 26 November, 46 m east
    assert client.Altitude == pytest.approx(26.9, abs=1.0)
    assert isinstance(client.UTCDate, datetime)


def test_slews_and_syncs_are_of_date_too(client, offered, mount) -> None:
    client.Connected = True
    offered.see_mount(PLACE)
    with pytest.raises(exceptions.ValueNotSetException):
        _ = client.TargetRightAscension
    client.SlewToCoordinatesAsync(6.5, -12.25)
    assert (client.TargetRightAscension, client.TargetDeclination) == (6.5, -12.25)
    assert apart_deg((offered.target.ra_deg, offered.target.dec_deg), from_date(97.5, -12.25)) * 3600.0 < 0.05
    client.TargetRightAscension, client.TargetDeclination = 5.0, 20.0
    client.SlewToTargetAsync()
    client.SyncToTarget()
    client.AbortSlew()
    assert mount.orders == ["goto", "goto", "accept_sync", "stop"]
    for ra, dec in ((-0.1, 0.0), (24.0, 0.0), (5.0, 90.1), (5.0, -90.1)):
        with pytest.raises(exceptions.InvalidValueException):
            client.SlewToCoordinatesAsync(ra, dec)
    assert len(mount.orders) == 4


def test_a_slew_that_waits_comes_back_when_it_is_over(device, client, offered) -> None:
    client.Connected = True
    offered.see_mount(PLACE, slewing=True)
    over = []
    threading.Timer(0.5, lambda: (over.append(True), offered.see_mount(PLACE))).start()
    # alpyca itself has the deprecated methods no longer, ASCOM's own remote client does.
    body = "RightAscension=6.5&Declination=-12.25"
    assert b'"ErrorNumber": 0' in ask(device, "PUT", "/api/v1/telescope/0/slewtocoordinates", body)[1]
    assert over
    assert not client.Slewing


def test_what_the_guard_refuses_is_a_sentence(client, offered, mount) -> None:
    client.Connected = True
    mount.order = lambda name, make, refuse: make.args[-1].set_result("Below the horizon limit.")
    with pytest.raises(exceptions.InvalidOperationException, match="Below the horizon limit"):
        client.SlewToCoordinatesAsync(6.5, -12.25)


def test_every_member_of_alpycas_telescope_is_answered_by_the_standard(client, offered) -> None:
    """Each property: a value of its type, or "not implemented"; no HTTP error, no surprise."""
    client.Connected = True
    offered.see_mount(PLACE)
    client.SlewToCoordinatesAsync(6.5, -12.25)
    absent = set()
    for name, _ in inspect.getmembers(Telescope, lambda member: isinstance(member, property)):
        try:
            value = getattr(client, name)
        except exceptions.NotImplementedException:
            absent.add(name)
        else:
            assert value is not None
    assert absent == {
        "ApertureArea", "ApertureDiameter", "FocalLength", "GuideRateDeclination", "GuideRateRightAscension",
        "IsPulseGuiding", "SideOfPier", "SlewSettleTime",
    }  # fmt: skip
    # Each thing that it says it cannot, it refuses as not implemented.
    for can, do in (
        (client.CanFindHome, client.FindHome),
        (client.CanPark, client.Park),
        (client.CanUnpark, client.Unpark),
        (client.CanSetPark, client.SetPark),
        (client.CanSlewAltAzAsync, lambda: client.SlewToAltAzAsync(180.0, 45.0)),
        (client.CanSyncAltAz, lambda: client.SyncToAltAz(180.0, 45.0)),
        (client.CanPulseGuide, lambda: client.PulseGuide(GuideDirections.guideNorth, 100)),
        (client.CanMoveAxis(TelescopeAxes.axisPrimary), lambda: client.MoveAxis(TelescopeAxes.axisPrimary, 0.5)),
    ):
        assert can is False
        with pytest.raises(exceptions.NotImplementedException):
            do()
    for name in ("DeclinationRate", "RightAscensionRate"):
        assert getattr(client, name) == 0.0
        with pytest.raises(exceptions.NotImplementedException):
            setattr(client, name, 1.0)
    assert client.AxisRates(TelescopeAxes.axisPrimary) == []
    assert client.TrackingRates == [DriveRates.driveSidereal]
    client.TrackingRate = DriveRates.driveSidereal
    with pytest.raises(exceptions.InvalidValueException):
        client.TrackingRate = DriveRates.driveLunar
    with pytest.raises(exceptions.ActionNotImplementedException):
        client.Action("x", "")
    assert client.SupportedActions == []


@pytest.mark.parametrize(
    ("method", "path", "body"),
    [
        ("GET", "/api/v1/telescope/0/nonsense", None),
        ("GET", "/api/v1/telescope/1/name", None),
        ("GET", "/api/v1/Telescope/0/name", None),
        ("GET", "/api/v1/telescope/0/Name", None),
        ("GET", "/api/v1/telescope/0/name?ClientID=-1", None),
        ("GET", "/api/v1/telescope/0/name?ClientTransactionID=x", None),
        ("GET", "/api/v1/telescope/0/axisrates", None),
        ("PUT", "/api/v1/telescope/0/connected", "Connected=maybe"),
        ("PUT", "/api/v1/telescope/0/connected", "connected=true"),
        ("PUT", "/api/v1/telescope/0/slewtocoordinatesasync", "RightAscension=5"),
        ("PUT", "/api/v1/telescope/0/slewtocoordinatesasync", "RightAscension=nan&Declination=1"),
        ("GET", "/management/v2/description", None),
    ],
)
def test_what_makes_no_sense_is_http_400(device, method, path, body) -> None:
    assert ask(device, "PUT", "/api/v1/telescope/0/connected", "Connected=true&ClientID=1")[0] == 200
    status, said = ask(device, method, path, body)
    assert status == 400
    assert re.fullmatch(rb"[^\n]+\n", said)


@pytest.mark.parametrize("member", ["axisrates", "canmoveaxis"])
@pytest.mark.parametrize(("axis", "error"), [(0, 0), (2, 0), (3, 0x401)])
def test_an_axis_that_no_telescope_has_is_an_invalid_value(device, member, axis, error) -> None:
    assert ask(device, "PUT", "/api/v1/telescope/0/connected", "Connected=True&ClientID=7")[0] == 200
    status, told = ask(device, "GET", f"/api/v1/telescope/0/{member}?Axis={axis}&ClientID=7")
    assert (status, json.loads(told)["ErrorNumber"]) == (200, error)


def test_numbers_of_transactions_come_back_and_names_in_an_address_have_no_case(device) -> None:
    told = json.loads(ask(device, "GET", "/api/v1/telescope/0/name?clientid=7&CLIENTTRANSACTIONID=42")[1])
    assert told["ClientTransactionID"] == 42
    again = json.loads(ask(device, "GET", "/api/v1/telescope/0/name")[1])
    assert again["ServerTransactionID"] > told["ServerTransactionID"]
    assert again["ClientTransactionID"] == 0


def test_a_second_client_keeps_it_connected(device, offered, told) -> None:
    for number in (1, 2):
        ask(device, "PUT", "/api/v1/telescope/0/connected", f"Connected=true&ClientID={number}")
    ask(device, "PUT", "/api/v1/telescope/0/connected", "Connected=false&ClientID=1")
    assert json.loads(ask(device, "GET", "/api/v1/telescope/0/connected")[1])["Value"] is True
    assert told.count("Alpaca connected.") == 1
    assert wait_for(lambda: offered.programs == {"Alpaca": 1})
