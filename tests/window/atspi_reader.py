"""What a screen reader is told by the running program: pressed and read through AT-SPI alone.

Run by the system's own Python, which has ``gi``; prints one line of JSON.
"""

import json
import time

import gi

gi.require_version("Atspi", "2.0")
from gi.repository import Atspi, GLib  # noqa: E402

LIMIT_S = 100.0  # of a busy machine
CONTROLS = {
    "push button", "toggle button", "check box", "radio button", "combo box", "text", "password text", "spin button",
    "slider", "list", "table", "tree", "menu item", "progress bar", "page tab",
}  # fmt: skip
OF_QT = {"", "Scroll Left", "Scroll Right", "Close", "Float"}


def nodes(top, within=None):
    """All visible nodes below, and the role of what holds each; none of a program that is too busy to answer now.

    Every question is a message to the program and back: the cells of a table that is not there to see are nine tenths.
    """
    if top is None:
        return
    for place in range(top.get_child_count()):
        node = top.get_child_at_index(place)
        if node is not None and node.get_state_set().contains(Atspi.StateType.VISIBLE):
            yield node, within
            yield from nodes(node, node.get_role_name())


def told(node):
    """What is spoken for a node; Qt gives a combo box's choice for its name and its label by relation, or in words."""
    if node.get_role_name() != "combo box":
        return node.get_name().strip()
    labels = [
        relation.get_target(k).get_name()
        for relation in node.get_relation_set()
        if relation.get_relation_type() == Atspi.RelationType.LABELLED_BY
        for k in range(relation.get_n_targets())
    ]
    return " ".join([*labels, node.get_description()]).strip()


def showing(node):
    return node.get_state_set().contains(Atspi.StateType.SHOWING)


def wait(found, what):
    """The first true answer; what was awaited when there is none."""
    end = time.monotonic() + LIMIT_S
    while time.monotonic() < end:
        try:
            if answer := found():
                return answer
        except GLib.Error:  # a node went away while it was read
            pass
        time.sleep(0.3)
    raise SystemExit(f"no {what} within {LIMIT_S:g} s, but {texts()}")


def program():
    desktop = Atspi.get_desktop(0)
    found = [desktop.get_child_at_index(k) for k in range(desktop.get_child_count())]
    return next((one for one in found if one is not None and one.get_name() == "Kochab"), None)


def press(name, roles):
    """Do the first action of the control with this name."""

    def found():
        for node, _ in nodes(program()):
            if node.get_role_name() in roles and node.get_name() == name:
                return node.do_action(0)
        return None

    wait(found, f"{name!r} to press")


def nameless():
    """Roles of the controls in sight that have no name."""
    return [
        [node.get_role_name(), within, node.get_name()]
        for node, within in nodes(program())
        if node.get_role_name() in CONTROLS and showing(node) and within not in ("combo box", "spin button")
        and not told(node)
    ]  # fmt: skip


def texts():
    return [node.get_name() for node, _ in nodes(program()) if showing(node) and node.get_name()]


def described(what):
    """The texts of labels in sight of which a screen reader says that they are ``what``."""
    return [node.get_name() for node, _ in nodes(program()) if node.get_description() == what and showing(node)]


def opened(mode):
    """Whether the panel of a mode shows controls, beside those of its frame."""
    panels = [node for node, _ in nodes(program()) if (node.get_role_name(), node.get_name()) == ("panel", mode)]
    return [n for panel in panels for n, _ in nodes(panel) if showing(n) and told(n) not in OF_QT][3:]


Atspi.init()
# An order whose answer is late is carried out all the same: given again, it would take a mode back.
Atspi.set_timeout(int(1e3 * LIMIT_S), int(1e3 * LIMIT_S))
report = {"nameless": {}}
wait(program, "program")
wait(lambda: "Open an image…" in texts(), "welcome page")
report["nameless"]["welcome"] = nameless()
press("Orion", {"push button"})
report["pointing"] = wait(lambda: described("Right ascension"), "right ascension") + described("Declination")
report["nameless"]["image"] = nameless()
for mode in ("Live", "Mount", "Polar alignment", "Laboratory"):
    press(mode, {"check box", "toggle button", "radio button"})
    wait(lambda: opened(mode), f"{mode} mode")  # noqa: B023
    report["nameless"][mode] = nameless()
print(json.dumps(report))
