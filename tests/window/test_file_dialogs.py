"""What the dialogs that open frames offer."""

import re
from types import SimpleNamespace

from kochab.frames import suffixes
from kochab.window.frame.files import _kinds
from kochab.window.polar import frame_fields


def test_every_dialog_that_opens_frames_offers_every_kind_of_them(monkeypatch):
    offered = []
    monkeypatch.setattr(frame_fields, "ask_frames", lambda _parent, _start, _title, kinds: offered.append(kinds) or [])
    fields = SimpleNamespace(
        _services=SimpleNamespace(settings=SimpleNamespace(text=lambda name, default: default)),
        row=SimpleNamespace(window=lambda: None),
        files=SimpleNamespace(add=lambda *_: None),
    )
    frame_fields.FrameFields._ask_files(fields, 0)
    for kinds in (*offered, _kinds()):
        assert {f"*{suffix}" for suffix in suffixes()} <= set(re.findall(r"\*\.\w+", kinds))
    assert len(offered) == 1
