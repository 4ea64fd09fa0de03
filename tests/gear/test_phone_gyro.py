"""What a phone's gyroscope felt, read from a simulated phone that was written from phyphox's own sources."""

import threading
import time

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kochab.core.errors import LineLostError, NoAnswerError, PortError
from kochab.gear import phone_gyro
from kochab.gear.phone_gyro import PhoneGyro
from tests.gear.phyphox_phone import PhyphoxPhone

BEGAN_S = time.perf_counter()  # of the finer clock that Windows has


def turning() -> np.ndarray:
    """About the phone's y axis, 30 degrees a second."""
    return Rotation.from_euler("y", -30.0 * (time.perf_counter() - BEGAN_S), degrees=True).as_matrix()


def looks(gyro: PhoneGyro, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """All rates of so many seconds."""
    parts, until = [], time.monotonic() + seconds
    while time.monotonic() < until:
        time.sleep(0.1)
        parts.append(gyro.rates())
    return np.concatenate([part.at_s + part.ahead_s for part in parts]), np.concatenate([part.rates for part in parts])


@pytest.mark.parametrize("flavour", ["android", "ios"])
@pytest.mark.parametrize("experiment", ["gyroscope", "two sensors"])
def test_rates_come_once_each_in_time_and_about_the_axes_of_the_phone(flavour, experiment) -> None:
    with PhyphoxPhone(turning, flavour=flavour) as phone:
        phone.switch(experiment)
        gyro = PhoneGyro(phone.address)
        assert phone.measuring
        began_s = time.monotonic()
        at_s, rates = looks(gyro, 1.5)
        assert (np.diff(at_s) > -0.1).all()  # the clocks' difference is known better and better
        assert len(at_s) > 50
        assert began_s - 0.5 < at_s[0] < at_s[-1] <= time.monotonic()
        assert np.degrees(rates.mean(axis=0)) == pytest.approx((0.1, 30.0, 0.0), abs=0.5)


def test_a_pause_and_a_measurement_begun_anew_are_noticed() -> None:
    with PhyphoxPhone(turning) as phone:
        gyro = PhoneGyro(phone.address)
        looks(gyro, 0.5)
        phone.measuring = False
        with pytest.raises(NoAnswerError, match="paused"):
            gyro.rates()
        for restart in (lambda: None, phone.clear, lambda: phone.switch("two sensors")):
            phone.measuring = False
            restart()
            time.sleep(1.5)
            phone.measuring = True
            faults, newest_s, anew, felt = 0, 0.0, False, None
            while felt is None or len(felt.at_s) < 3 or newest_s < time.monotonic() - 0.5:
                time.sleep(0.2)
                try:
                    felt = gyro.rates()
                except NoAnswerError:
                    faults += 1
                    continue
                anew |= felt.anew
                newest_s = felt.at_s[-1] + felt.ahead_s if len(felt.at_s) else 0.0
            assert anew
            assert np.degrees(felt.rates.mean(axis=0))[1] == pytest.approx(30.0, abs=1.0)
            assert newest_s <= time.monotonic()
            assert faults <= 1


def test_a_phone_that_keeps_much_is_let_forget(monkeypatch) -> None:
    monkeypatch.setattr(phone_gyro, "MOST_S", 1.0)
    with PhyphoxPhone(turning) as phone:
        gyro = PhoneGyro(phone.address)
        looks(gyro, 0.5)
        gyro.renew()
        assert not any("clear" in request for request in phone.requests)
        looks(gyro, 1.5)
        kept = len(phone.buffers["gyrX"])
        gyro.renew()
        assert len(phone.buffers["gyrX"]) < kept
        assert phone.measuring
        assert gyro.rates().anew
        at_s, rates = looks(gyro, 0.5)
        assert len(at_s) > 10
        assert np.degrees(rates.mean(axis=0))[1] == pytest.approx(30.0, abs=1.0)


def test_values_that_are_none_are_left_out() -> None:
    with PhyphoxPhone(turning) as phone:
        gyro = PhoneGyro(phone.address)
        phone.bias_deg_s[0] = np.nan
        assert not len(looks(gyro, 0.5)[0][3:])


def test_each_fault_of_the_phone_is_one_sentence() -> None:
    with PhyphoxPhone(turning) as phone:
        phone.switch("acceleration")
        with pytest.raises(NoAnswerError, match="shows no gyroscope"):
            PhoneGyro(phone.address)
        phone.switch("gyroscope")
        phone.refuses = True
        with pytest.raises(NoAnswerError, match="did not begin to measure"):
            PhoneGyro(phone.address)
        phone.refuses = False
        for answer in (b"", b"\xff\xfe", b"[]", b"{}", b'{"buffer": 3, "inputs": [3]}', b"[" * 9999, b"1e999"):
            phone.says = answer
            with pytest.raises(NoAnswerError):
                PhoneGyro(phone.address)
        phone.says = None
        gyro = PhoneGyro(phone.address)
        for answer in (b"", b"[]", b"{}", b'{"buffer": {"gyr_time": {"buffer": "x"}}, "status": []}'):
            phone.says = answer
            with pytest.raises(NoAnswerError):
                gyro.rates()
        phone.says = None
        looks(gyro, 0.3)
        phone.silent()
        began_s = time.monotonic()
        with pytest.raises(LineLostError, match="Keep phyphox open"):
            gyro.rates()
        assert time.monotonic() - began_s < 60.0  # it ends; how soon, a busy machine says
        threading.Thread(target=phone.silent, args=(False,)).start()
        address = phone.address
    with pytest.raises(LineLostError):
        gyro.rates()
    with pytest.raises(PortError, match="No phyphox server"):
        PhoneGyro(address)
