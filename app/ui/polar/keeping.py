"""The set-up of an alignment between starts."""

import json

from app.ui.polar.setup import SetupPanel
from app.ui.settings import Settings

NAME = "polar"


def keep_fields(panel: SetupPanel, settings: Settings) -> None:
    """Remember what was chosen; files and places are another matter."""
    values = {
        "source": panel.source.currentText(), "kind": panel.kind.currentText(),
        "address": panel.device.currentData() or panel.device.currentText(),
        "exposure": panel.exposure.value(), "hand": panel.hand.currentText(),
        "pole": panel.pole.currentText(), "goal": panel.goal.value(), "turn": panel.turn.value(),
        "fov": panel.fov.text(), "second": panel.second.isChecked(),
    }  # fmt: skip
    settings.keep(NAME, json.dumps(values))


def restore_fields(panel: SetupPanel, settings: Settings) -> None:
    """As last time; what is damaged stays at its default."""
    kept = settings.table(NAME)
    if not kept:
        return
    for name, box in (("source", panel.source), ("kind", panel.kind), ("hand", panel.hand),
                      ("pole", panel.pole)):  # fmt: skip
        index = box.findText(str(kept.get(name, "")))
        if index >= 0:
            box.setCurrentIndex(index)
    if isinstance(kept.get("address"), str):
        panel.device.setEditText(kept["address"])
    if isinstance(kept.get("fov"), str):
        panel.fov.setText(kept["fov"])
    panel.second.setChecked(kept.get("second") is True)
    for name, spin in (("goal", panel.goal), ("turn", panel.turn)):
        if isinstance(kept.get(name), int):
            spin.setValue(kept[name])
    if isinstance(kept.get("exposure"), int | float):
        panel.exposure.setValue(float(kept["exposure"]))
