"""The simulated phone against phyphox's own documents, and against a client that nobody here wrote."""

import json
import time
import urllib.error
import urllib.request

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.gear.phyphox_phone import PhyphoxPhone
from tests.server.telescope.conftest import wait_for

PLAIN = {"noise_deg_s_rt_hz": 0.0, "bias_deg_s": (0.0, 0.0, 0.0), "bias_walk": 0.0}
AXES = ("gyrX", "gyrY", "gyrZ")
FLAVOURS = pytest.mark.parametrize("flavour", ["android", "ios"])


def still():
    return np.eye(3)


def ask(phone, path, body=None, kind="application/json"):
    """Status, and what was answered, as JSON where it is."""
    request = urllib.request.Request(f"http://{phone.address}{path}", body, {"Content-Type": kind} if body else {})
    try:
        with urllib.request.build_opener(urllib.request.ProxyHandler({})).open(request, timeout=60) as answer:
            status, text = answer.status, answer.read().decode()
    except urllib.error.HTTPError as refusal:
        with refusal:
            status, text = refusal.code, refusal.read().decode()
    return status, json.loads(text) if text.startswith(("{", "[")) else text


def values(phone, query):
    return {name: answer["buffer"] for name, answer in ask(phone, f"/get?{query}")[1]["buffer"].items()}


def measure(phone, samples):
    """So many samples or a few more; then someone pauses it."""
    phone.measuring = True
    assert wait_for(lambda: len(phone.buffers[next(iter(phone.buffers))]) >= samples)
    phone.measuring = False


@FLAVOURS
def test_what_runs_is_described_as_the_document_has_it(flavour) -> None:
    with PhyphoxPhone(still, flavour=flavour) as phone:
        status, config = ask(phone, "/config")
        assert status == 200
        required = {"crc32", "title", "localTitle", "category", "localCategory", "buffers", "inputs", "export"}
        assert set(config) == required  # openapi.yaml, Config
        assert config["title"] == "Gyroscope (rotation rate)"
        (gyroscope,) = config["inputs"]
        assert gyroscope["source"] == "gyroscope"
        assert {"z": "gyrZ"} in gyroscope["outputs"]
        assert {buffer["name"] for buffer in config["buffers"]} == {*AXES, "gyr", "gyr_time"}
        assert config["export"][0]["sources"][0] == {"label": "Time (s)", "buffer": "gyr_time"}
        assert ("sensors" in ask(phone, "/meta")[1]) == (flavour == "android")  # inconsistencies.yml, meta-sensors


@FLAVOURS
def test_a_document_that_is_not_there(flavour) -> None:
    """Android's HTTP library serves the page above it."""
    with PhyphoxPhone(still, flavour=flavour) as phone:
        status, text = ask(phone, "/nothing")
        assert (status, "<html" in text) == ((200, True) if flavour == "android" else (404, False))


@FLAVOURS
def test_last_value_full_threshold_and_reference(flavour) -> None:
    with PhyphoxPhone(still, flavour=flavour) as phone:
        assert values(phone, "gyrX&gyrY=full&elsewhere=full") == {"gyrX": [None], "gyrY": []}
        for time_s, value in ((1, 7), (2, -1), (3, 4)):  # the example of index.md
            for name, number in (("gyr_time", time_s), ("gyrX", value)):
                assert ask(phone, f"/control?cmd=set&buffer={name}&value={number}")[1] == {"result": True}
        answer = ask(phone, "/get?gyrX&gyr_time=full&gyrY=3")[1]
        assert {name: buffer["updateMode"] for name, buffer in answer["buffer"].items()} == {
            "gyrX": "single",
            "gyr_time": "full",
            "gyrY": "partial",
        }
        assert answer["status"] == {"session": phone.session, "measuring": False, "timedRun": False, "countDown": 0}
        assert values(phone, "gyr_time=1&gyrX=1%7Cgyr_time") == {"gyr_time": [2, 3], "gyrX": [-1, 4]}
        assert values(phone, "gyr_time=3&gyrX=3%7Cgyr_time") == {"gyr_time": [], "gyrX": []}
        assert values(phone, "gyrX=-1") == {"gyrX": [7, 4]}
        body = b'{"gyrX": "2|gyr_time", "gyr_time": 2}'
        assert ask(phone, "/get?gyrX=full", body)[1]["buffer"]["gyrX"]["buffer"] == [4]
        assert ask(phone, "/get", b"gyrX=full", "application/x-www-form-urlencoded")[1]["buffer"]["gyrX"]["size"] == 0


@FLAVOURS
@pytest.mark.parametrize(
    ("path", "body"), [("/get?gyrX=soon", None), ("/get?gyrX=1%7Cnowhere", None), ("/get", b"{"), ("/control", b"[1]")]
)
def test_malformed_requests_are_refused_in_json(flavour, path, body) -> None:
    with PhyphoxPhone(still, flavour=flavour) as phone:
        status, answer = ask(phone, path, body)
        assert (status, list(answer)) == (400, ["error"])


@pytest.mark.parametrize(
    "query", ["", "?cmd=dance", "?cmd=set&buffer=gyrX&value=NaN", "?cmd=set&buffer=no&value=1", "?cmd=set&buffer=gyrX"]
)
def test_a_refused_command_is_a_false_result(query) -> None:
    with PhyphoxPhone(still) as phone:
        assert ask(phone, f"/control{query}") == (200, {"result": False})


@pytest.mark.parametrize(
    ("value", "text"), [("34.56", "3.456E1"), ("0.01222", "1.222E-2"), ("123456789.1", "1.2345679E8"), ("0", "0E0")]
)
def test_android_writes_eight_digits(value, text) -> None:
    """The first two stand in index.md."""
    with PhyphoxPhone(still) as phone:
        ask(phone, f"/control?cmd=set&buffer=gyrX&value={value}")
        with urllib.request.urlopen(f"http://{phone.address}/get?gyrX") as answer:
            assert f'"buffer":[{text}]' in answer.read().decode()


@FLAVOURS
def test_who_asks_from_the_last_time_on_gets_each_sample_once(flavour) -> None:
    with PhyphoxPhone(still, flavour=flavour) as phone:
        phone.measuring = True
        polled = {"gyr_time": [], "gyrX": []}

        def poll() -> bool:
            query = "gyr_time=full&gyrX=full"  # the first sample may be of 0 s, which is not above 0
            if polled["gyr_time"]:
                since = repr(float(polled["gyr_time"][-1]))
                query = f"gyr_time={since}&gyrX={since}%7Cgyr_time"
            for name, more in values(phone, query).items():
                polled[name] += more
            return len(polled["gyr_time"]) > 60

        assert wait_for(poll)
        phone.measuring = False
        poll()
        assert polled == values(phone, "gyr_time=full&gyrX=full")


def test_experiment_time_leaves_pauses_out() -> None:
    with PhyphoxPhone(still) as phone:
        assert ask(phone, "/time") == (200, [])
        measure(phone, 5)
        paused = time.time()
        assert wait_for(lambda: time.time() > paused + 1.0)
        assert ask(phone, "/control?cmd=start")[1] == {"result": True}
        assert wait_for(lambda: len(phone.buffers["gyr_time"]) > 20)
        assert ask(phone, "/control?cmd=stop")[1] == {"result": True}
        first, pause, second, _ = ask(phone, "/time")[1]
        assert [first["event"], pause["event"], second["event"]] == ["START", "PAUSE", "START"]
        assert first["experimentTime"] == 0.0
        assert second["experimentTime"] == pause["experimentTime"]
        assert second["systemTime"] - pause["systemTime"] >= 1.0
        times = np.array(phone.buffers["gyr_time"])
        assert np.all(np.diff(times) > 0.0)
        assert times[0] < pause["experimentTime"] < times[-1]


@FLAVOURS
def test_after_delete_the_next_answer_is_whole_and_time_begins_anew(flavour) -> None:
    with PhyphoxPhone(still, flavour=flavour) as phone:
        phone.measuring = True
        assert wait_for(lambda: len(phone.buffers["gyr_time"]) > 30)
        session, ended = phone.session, phone.buffers["gyr_time"][-1]
        phone.clear()
        answer = ask(phone, f"/get?gyr_time={ended}")[1]
        assert answer["buffer"]["gyr_time"] == {"size": 0, "updateMode": "full", "buffer": []}
        assert (answer["status"]["session"], answer["status"]["measuring"]) == (session, False)
        assert ask(phone, f"/get?gyr_time={ended}")[1]["buffer"]["gyr_time"]["updateMode"] == "partial"
        assert ask(phone, "/time")[1] == []
        measure(phone, 2)
        assert values(phone, "gyr_time=full")["gyr_time"][0] < ended


def test_another_experiment_is_another_session() -> None:
    with PhyphoxPhone(still, measuring=True) as phone:
        session = ask(phone, "/get?gyrX")[1]["status"]["session"]
        phone.switch("acceleration")
        answer = ask(phone, "/get?gyrX&accZ")[1]
        assert list(answer["buffer"]) == ["accZ"]
        assert answer["status"]["session"] != session
        assert not answer["status"]["measuring"]
        assert [source["source"] for source in ask(phone, "/config")[1]["inputs"]] == ["accelerometer"]
        phone.switch("two sensors")
        gyroscope = ask(phone, "/config")[1]["inputs"][1]
        assert gyroscope["outputs"] == [{"x": "w1"}, {"y": "w2"}, {"z": "w3"}, {"t": "time of w"}]
        measure(phone, 3)
        assert len(values(phone, "time%20of%20w=full")["time of w"]) >= 3


def test_refusing_garbage_silence_and_a_phone_that_goes_and_comes_back() -> None:
    with PhyphoxPhone(still) as phone:
        phone.refuses = True
        assert ask(phone, "/control?cmd=start") == (200, {"result": False})
        assert not phone.measuring
        phone.says = b"garbage"
        assert ask(phone, "/get?gyrX=soon") == (200, "garbage")
        phone.says = None
        phone.silent()
        with pytest.raises(TimeoutError):
            urllib.request.urlopen(f"http://{phone.address}/config", timeout=0.3)
        phone.silent(False)
        assert ask(phone, "/config")[0] == 200
        address = phone.address
        phone.pull()
        with pytest.raises(urllib.error.URLError, match="refused"):
            ask(phone, "/config")
        phone.back()
        assert phone.address == address
        assert ask(phone, "/config")[0] == 200


def test_a_command_may_take_effect_after_its_answer() -> None:
    """Of openapi.yaml, control: accepted, not whether it has finished taking effect."""
    with PhyphoxPhone(still) as phone:
        phone.lag_s = 3600.0
        assert ask(phone, "/control?cmd=start") == (200, {"result": True})
        assert ask(phone, "/get")[1]["status"]["measuring"] is False
        phone.lag_s = 0.05
        for command, then in (("start", True), ("stop", False)):
            assert ask(phone, f"/control?cmd={command}") == (200, {"result": True})
            assert wait_for(lambda then=then: ask(phone, "/get")[1]["status"]["measuring"] == then)
        assert [event["event"] for event in ask(phone, "/time")[1]] == ["START", "PAUSE"]


def rates(phone):
    """Degrees a second (N, 3) and the seconds before each, without the first, before which nothing is known."""
    found = values(phone, "gyrX=full&gyrY=full&gyrZ=full&gyr_time=full")
    times = np.array(found["gyr_time"])
    return np.degrees([found[name] for name in AXES]).T[1:], np.diff(times)[:, None]


def test_a_still_phone_shows_noise_of_the_density_and_its_bias() -> None:
    density, bias = 0.007, (0.2, -0.1, 0.3)
    with PhyphoxPhone(still, rate_hz=400.0, noise_deg_s_rt_hz=density, bias_deg_s=bias, bias_walk=0.0) as phone:
        measure(phone, 800)
        rate, dt = rates(phone)
    white = (rate - bias) * np.sqrt(2.0 * dt) / density  # one-sided, up to half the rate of the samples
    sigma = 1.0 / np.sqrt(white.size)
    assert np.mean(white**2) == pytest.approx(1.0, abs=5.0 * np.sqrt(2.0) * sigma)
    assert np.abs(white.mean(axis=0)).max() < 5.0 / np.sqrt(len(white))
    assert abs(np.mean(white[1:] * white[:-1])) < 5.0 * sigma


def test_the_bias_walks_as_the_root_of_the_time() -> None:
    quiet = {**PLAIN, "bias_walk": 0.1}
    with PhyphoxPhone(still, rate_hz=400.0, **quiet) as phone:
        measure(phone, 400)
        rate, dt = rates(phone)
    steps = np.diff(rate, axis=0) / np.sqrt(dt[1:]) / 0.1
    assert np.mean(steps**2) == pytest.approx(1.0, abs=5.0 * np.sqrt(2.0 / steps.size))


@FLAVOURS
def test_a_turned_phone_shows_the_turn(flavour) -> None:
    """Samples against the attitudes that were asked for, whatever the moments: v(t + dt) = exp(-[w] dt) v(t)."""
    seen = []

    def tumbling():
        t = time.perf_counter()
        seen.append((Rotation.from_euler("ZXZ", [0.9 * t, np.sin(t), 2.0 * t]).as_matrix()).T)
        return seen[-1]

    with PhyphoxPhone(tumbling, flavour=flavour, measuring=True, **PLAIN) as phone:
        measure(phone, 50)
        rate, dt = rates(phone)
    turned = np.eye(3)
    for vector in np.radians(rate * dt):
        turned = Rotation.from_rotvec(-vector).as_matrix() @ turned
    # The first attitude is of before the first sample, which is left out.
    assert turned @ seen[1] == pytest.approx(seen[1 + len(rate)], abs=1e-4)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_turning_counterclockwise_about_an_axis_is_positive_and_scaled(axis) -> None:
    """As Android and iOS have it: seen from the positive axis, counterclockwise."""
    speed, unit, angles = np.radians(20.0), np.eye(3)[axis], []

    def turning():  # the phone turns by +angle, so the sky in its axes by -angle
        angles.append(speed * time.perf_counter())
        return Rotation.from_rotvec(-angles[-1] * unit).as_matrix()

    with PhyphoxPhone(turning, scale=(1.01, 1.02, 1.03), measuring=True, **PLAIN) as phone:
        measure(phone, 20)
        rate, dt = rates(phone)
    expected = np.degrees(angles[1 + len(rate)] - angles[1]) * (1.01, 1.02, 1.03)[axis] * unit
    assert (rate * dt).sum(axis=0) == pytest.approx(expected, abs=1e-3)


def test_steps_range_and_values_that_are_none() -> None:
    with PhyphoxPhone(still, bias_deg_s=(300.0, -300.0, 1.0), range_deg_s=250.0, step_deg_s=1 / 131.2) as phone:
        measure(phone, 5)
        rate, _ = rates(phone)
        assert rate[:, :2] == pytest.approx(np.tile([250.0, -250.0], (len(rate), 1)), rel=1e-6)
        assert rate[:, 2] * 131.2 == pytest.approx(np.round(rate[:, 2] * 131.2), abs=1e-3)
        phone.bias_deg_s = (np.nan, 0.0, 0.0)
        measure(phone, len(phone.buffers["gyrX"]) + 5)
        assert values(phone, "gyrX&gyrY=full&gyr_time=full")["gyrX"] == [None]


def test_a_client_that_others_wrote_reads_it() -> None:
    """phyphox-py of the package index, which is not among what the tests install."""
    phyphox = pytest.importorskip("phyphox", reason="phyphox-py is not installed")
    with PhyphoxPhone(still) as phone:
        host, _, port = phone.address.partition(":")
        client = phyphox.Logger(host, int(port), no_proxy=True)
        client.get_meta()
        client.get_config()
        assert client.buffer_needed()
        assert client.start() == {"result": True}
        polled: list[float] = []

        def poll() -> bool:
            if client.read_buffers():
                polled.extend(client.get_last_buffer_read()[0][0])
            return len(polled) > 40

        assert wait_for(poll)
        assert client.stop() == {"result": True}
        poll()
        assert polled == values(phone, "gyr_time=full")["gyr_time"]
        assert [event["event"] for event in client.get_time()] == ["START", "PAUSE"]
        assert client.clear_data() == {"result": True}
        assert phone.buffers["gyrX"] == []
