"""Method, detector, attitude and a method's own options, chosen in the window."""

from dataclasses import dataclass

import pytest

from kochab.attitude import ESTIMATORS
from kochab.core.errors import UsageError
from kochab.core.registry import choice, integer, number, options_of, pair, switch
from kochab.identification import IDENTIFIERS
from kochab.window.panels.method_options import FITTED, MethodGroup, OptionsForm


@dataclass(frozen=True)
class Example:
    margin_px: float = number(2.5, "px", 0.1, 20, "error allowed")
    stars: int = integer(15, "stars", 6, 30, "brightest used")
    planar: bool = switch(False, "plane coordinates")
    path: str = choice("float", ("float", "fixed"), "arithmetic")
    dec_deg: tuple[float, float] = pair((-90.0, 90.0), "deg", -90, 90, "declinations")
    limit: float | None = number(None, "mag", 3, 8, "faintest star", none="all stars")


@pytest.fixture
def form(qtbot):
    made = OptionsForm(options_of(Example))
    qtbot.addWidget(made)
    return made


def test_untouched_options_are_left_to_the_method(form):
    assert form.values() == {}


def test_every_kind_of_option_can_be_set(form):
    form.fields["margin_px"].setText("3.5")
    form.fields["stars"].setText("20")
    form.fields["planar"].setChecked(True)
    form.fields["path"].setCurrentText("fixed")
    form.fields["dec_deg"].setText("30,−5")
    form.fields["limit"].setText("6")
    wanted = {"margin_px": 3.5, "stars": 20, "planar": True, "path": "fixed", "dec_deg": (30.0, -5.0), "limit": 6.0}
    assert form.values() == wanted
    assert Example(**form.values())
    form.fill({})
    assert form.values() == {}
    form.fill(wanted)
    assert form.values() == wanted


@pytest.mark.parametrize(("name", "text"), [("margin_px", "40"), ("stars", "7.5"), ("dec_deg", "3"), ("limit", "x")])
def test_what_is_not_allowed_is_marked_and_said_with_its_range(form, name, text):
    form.fields[name].setText(text)
    assert form.fields[name].property("wrong")
    with pytest.raises(UsageError, match="from"):
        form.values()
    form.fields[name].setText("")
    assert not form.fields[name].property("wrong")


def test_fields_tell_unit_range_and_meaning(form):
    tip = form.fields["margin_px"].toolTip()
    assert tip == "Error allowed: number from 0.1 to 20 px."
    assert form.fields["margin_px"].accessibleName() == "Margin"
    assert form.fields["margin_px"].placeholderText() == "2.5"
    assert "all stars" in form.fields["limit"].toolTip()


@pytest.mark.parametrize("name", IDENTIFIERS)
def test_the_options_of_every_method_can_be_typed_as_they_stand(qtbot, name):
    form = OptionsForm(options_of(IDENTIFIERS.load(name)))
    qtbot.addWidget(form)
    for option in options_of(IDENTIFIERS.load(name)):
        field = form.fields[option.name]
        if hasattr(field, "setText") and option.kind not in ("switch", "choice"):
            field.setText(option.value_text)
    assert form.values() == {}
    assert IDENTIFIERS.make(name, **form.values()) is not None


def test_choices_of_the_method_group(qtbot):
    group = MethodGroup(list(IDENTIFIERS), ["auto", "peaks"])
    qtbot.addWidget(group)
    assert group.choices() == {"method": "patterns", "method_options": {}, "detector": "auto", "attitude": None}
    assert [group.attitude.itemText(i) for i in range(group.attitude.count())] == [FITTED, *ESTIMATORS]
    group.method.setCurrentText("triads")
    group.attitude.setCurrentText("triad")
    group.detector.setCurrentText("peaks")
    group.options.fields["separation_deg"].setText("0.08")
    assert group.choices() == {
        "method": "triads",
        "method_options": {"separation_deg": 0.08},
        "detector": "peaks",
        "attitude": "triad",
    }
    assert "stellar images" in group.paper.text()
    group.options.fields["separation_deg"].setText("9")
    with pytest.raises(UsageError, match="Method triads: separation_deg cannot be 9"):
        group.choices()
    group.reset()
    assert group.choices()["method"] == "patterns"


def test_choices_go_to_the_engine(qtbot, opened, engine):
    window, commands = opened
    hints = window.workspace.hints
    hints.method.setCurrentText("voting")
    hints.methods.attitude.setCurrentText("quest")
    hints.methods.options.fields["stars"].setText("12")
    with qtbot.waitSignal(commands.session.idle, timeout=10_000):
        commands.presenter.solve()
    asked = engine.asked[-1]
    assert (asked.method, asked.attitude, asked.method_options) == ("voting", "quest", {"stars": 12})
    hints.methods.options.fields["stars"].setText("99")
    commands.presenter.solve()
    assert "stars cannot be 99" in hints.wrong.text()
    assert engine.asked[-1] is asked
