"""The table of a mount's actions: every motion and its exclusions, from one place."""

import ast

import pytest

from kochab.core.mount import Ability, MountState
from kochab.gear.actions import ACTIONS, Action, MountSituation, Need, action, reason_against_order, reasons_against
from tests import house

ON = MountSituation("on", {}, MountState(), camera=True, solved=True, can_undo=True)


def test_every_action_that_moves_needs_an_unparked_mount_and_says_what_it_does() -> None:
    for row in ACTIONS.values():
        if row.moves and row.name != "polar":
            assert Need.UNPARKED in row.needs, row.name
        if not row.quick:
            assert row.doing, row.name


SLEWS = {"goto", "centre", "move_star", "flip", "spiral", "model"}


def test_every_slew_needs_goto_and_a_confirmed_home() -> None:
    slews = {row.name for row in ACTIONS.values() if Ability.GOTO in row.needs}
    assert slews == SLEWS
    assert all(Need.HOME_CONFIRMED in ACTIONS[name].needs for name in slews)


def test_what_may_turn_dec_is_excluded_by_an_alignment_by_hand() -> None:
    """A sync that the mount refuses becomes a slew; a nudge in right ascension is the person's own."""
    excluded = {row.name for row in ACTIONS.values() if Need.NOT_BY_HAND in row.needs}
    assert excluded == {*SLEWS, "nudge dec", "sync", "accept_sync", "park", "home", "polar"}
    by_hand = MountSituation("on", {}, MountState(), by_hand=True)
    for row in ACTIONS.values():
        assert bool(reason_against_order(row.name, by_hand)) == (row.name in excluded)


def test_an_order_waits_for_a_line_that_is_opened_and_for_no_other() -> None:
    assert reason_against_order("goto", MountSituation("connecting")) == ""
    for phase in ("off", "leaving", "lost"):
        assert reason_against_order("goto", MountSituation(phase))
    assert "centring" in reason_against_order("goto", MountSituation("on", busy="centring"))


@pytest.mark.parametrize("need", Need)
def test_every_need_is_checked_by_an_action_that_has_it(need) -> None:
    without = {
        Need.UNPARKED: {"state": MountState(parked=True)},
        Need.IS_PARKED: {"state": MountState(parked=False)},
        Need.HOME_CONFIRMED: {"state": MountState(home_confirmed=False)},
        Need.NOT_BY_HAND: {"by_hand": True},
        Need.CAMERA: {"camera": False},
        Need.CAMERA_OR_SOLUTION: {"camera": False, "solved": False},
        Need.SOLVED_FRAME: {"solved": False},
        Need.SYNC_TO_UNDO: {"can_undo": False},
        Need.AGREEMENT: {"clock_conflict": "Its clock is slow."},
        Need.SYNCED: {"slew_block_reason": "It has shifted."},
    }[need]
    from dataclasses import replace

    reasons = reasons_against(replace(ON, **without))
    for name, row in ACTIONS.items():
        assert (reasons[name] == need.value) == (need in row.needs), name


def test_a_name_that_is_not_in_the_table_moves_nothing() -> None:
    assert action("names") == Action("names")


def test_no_other_module_lists_the_actions_that_move() -> None:
    """Five lists of strings in four modules had to agree before."""
    moving = {"goto", "centre", "nudge", "move_star"}
    for module, tree in house.trees_with(*moving):
        if module == "kochab.gear.actions":
            continue
        for node in ast.walk(tree):
            if isinstance(node, ast.Tuple | ast.List | ast.Set):
                words = {e.value for e in node.elts if isinstance(e, ast.Constant) and isinstance(e.value, str)}
                assert len(words & moving) < 2, f"{module}:{node.lineno}"
