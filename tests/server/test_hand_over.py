"""Where a user's worker listens."""

import os

import pytest

from kochab.server import hand_over

NAMES = ("KOCHAB_CONFIG", "XDG_RUNTIME_DIR", "XDG_STATE_HOME", "HOME")


@pytest.mark.parametrize(
    ("known", "expected"),
    [
        (NAMES, ("KOCHAB_CONFIG", "kochab-worker")),
        (NAMES[1:], ("XDG_RUNTIME_DIR", "kochab-worker")),
        (NAMES[2:], ("XDG_STATE_HOME", "kochab", "worker")),
        (NAMES[3:], ("HOME", ".local", "state", "kochab", "worker")),
    ],
)
def test_sockets_lie_where_a_restart_empties_or_else_in_the_users_state(tmp_path, monkeypatch, known, expected) -> None:
    for name in NAMES:
        monkeypatch.delenv(name, raising=False)
    for name in (*known, "USERPROFILE"):
        monkeypatch.setenv(name, str(tmp_path / name.replace("USERPROFILE", "HOME")))
    assert hand_over.folder() == os.path.join(tmp_path, *expected)
    assert os.path.dirname(hand_over.place().path) == hand_over.folder()
