"""What forbids a slew is kept for the next program, and forgotten after a sync, or by the next night."""

from datetime import UTC, datetime, timedelta

import pytest

from kochab.gear.mounts.motion_plan import Limits
from kochab.gear.mounts.motion_policy import MotionPolicy
from kochab.gear.mounts.sync_needed import SyncNeeded

NOON = datetime(2026, 11, 24, 12, tzinfo=UTC)


def test_another_program_reads_it_until_a_sync_or_for_half_a_day(tmp_path) -> None:
    file = tmp_path / "mounts" / "com3-syncs.json"
    policy = MotionPolicy(None, Limits(), lambda: NOON, SyncNeeded(lambda: NOON, file))
    policy.slew_block_reason = "Mount was restarted."
    later = SyncNeeded(lambda: NOON + timedelta(hours=11), file)
    assert MotionPolicy(None, Limits(), lambda: NOON, later).slew_block_reason == "Mount was restarted."
    assert SyncNeeded(lambda: NOON + timedelta(hours=13), file).read() == ""
    policy.slew_block_reason = ""
    assert later.read() == ""
    assert not file.exists()


@pytest.mark.parametrize("text", ["", "[]", '{"sentence": "x"}', '{"sentence": "x", "unix_s": "soon"}', "[" * 1000])
def test_a_damaged_file_forbids_nothing(tmp_path, text) -> None:
    file = tmp_path / "com3-syncs.json"
    file.write_text(text)
    assert SyncNeeded(lambda: NOON, file).read() == ""
