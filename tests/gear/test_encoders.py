"""An encoder box over its line: counts, the box's own end, other boxes, garbage and a pulled cable."""

import pytest

from kochab.core.errors import LineLostError, NoAnswerError, PortError
from kochab.gear.encoders import EncoderBox
from tests.gear.dsc_box import DscBox
from tests.gear.mounts.indi_server import indi_server
from tests.server.telescope.conftest import wait_for

NAME = "Digital Setting Circle"


@pytest.fixture
def box():
    angles = [10.0, 20.0]
    with DscBox(lambda: angles) as simulated:
        simulated.turned = angles
        yield simulated


@pytest.fixture
def opened(box):
    made = EncoderBox(box.port)
    yield made
    made.close()


def test_counts_and_the_counts_of_a_turn(box, opened) -> None:
    assert opened.counts() == (228.0, -556.0)
    assert opened.in_a_turn == box.in_a_turn
    box.turned[:] = 11.0, 19.0
    assert opened.counts() == (250.0, -528.0)


def test_turns_are_counted_on_where_the_box_begins_anew(box, opened) -> None:
    first, second = opened.counts()
    for angle in range(20, 740, 60):
        box.turned[:] = angle, 20.0 - angle
        counts = opened.counts()
    assert counts[0] - first == pytest.approx(670.0 / 360.0 * 8192, abs=1.0)
    assert counts[1] - second == pytest.approx(680.0 / 360.0 * 10000, abs=1.0)


@pytest.mark.parametrize(("ends", "tells"), [(b"", False), (b"\r\n", True), (b"\n", False)])
def test_boxes_that_end_otherwise_or_know_no_other_command(ends, tells) -> None:
    with DscBox(lambda: (10.0, 20.0), ends=ends, tells=tells) as box:
        opened = EncoderBox(box.port)
        assert opened.counts() == (228.0, -556.0)
        assert (opened.in_a_turn is None) != tells
        opened.close()


@pytest.mark.parametrize("said", [b"\x00\xff\x80\r", b"+00012\r", b"+00012\t+0x012\r", b"hello there\r", b"7" * 60])
def test_garbage_is_one_sentence_and_the_next_answer_counts(box, opened, said) -> None:
    box.says = said
    with pytest.raises(NoAnswerError, match="no two counts"):
        opened.counts()
    box.says = None
    assert opened.counts() == (228.0, -556.0)


def test_a_silent_box_and_a_pulled_cable(box, opened) -> None:
    box.says = b""
    with pytest.raises(NoAnswerError, match="No encoders answer"):
        opened.counts()
    box.pull()
    with pytest.raises(LineLostError, match="Lost the encoders"):
        opened.counts()


def test_no_port_is_no_box() -> None:
    with pytest.raises(PortError):
        EncoderBox("/dev/no-such-port")


def test_indis_own_driver_reads_the_simulated_box(box, tmp_path) -> None:
    """Other people's client of this protocol reads what our simulated box counts."""
    with indi_server(tmp_path, "indi_dsc_telescope") as server:
        server.set(
            f"{NAME}.CONNECTION_MODE.CONNECTION_SERIAL=On",
            f"{NAME}.DEVICE_AUTO_SEARCH.INDI_DISABLED=On",
            f"{NAME}.DEVICE_PORT.PORT={box.port}",
            f"{NAME}.CONNECTION.CONNECT=On",
        )
        assert wait_for(lambda: server.get(f"{NAME}.DCS_ENCODER.AXIS1_RAW_ENCODER") == "228")
        assert server.get(f"{NAME}.DCS_ENCODER.AXIS2_RAW_ENCODER") == "-556"
