"""The Mount view's buttons for orders: each explains why the mount cannot do it now."""

from collections.abc import Mapping
from functools import partial

from kochab.text.translation import tr, tr_noop
from kochab.window.devices.mount_control import MountControl
from kochab.window.mount.actions import MountActions, MoveStarMode
from kochab.window.mount.controls import ExplainedButton, Explanation, GoBox
from kochab.workflows.sync_mount import undo_sync

DIAGNOSE_TIP = tr_noop(
    "Take a frame and find the cause of the offset: summer time, epoch, site, polar axis, cone error"
)
MODEL_TIP = tr_noop(
    "Aim gotos by a model of the offsets that Diagnose has seen in four places or more, until the next sync"
)
SPIRAL_TIP = tr_noop(
    "Not in the field? Search around here in a square spiral, two thirds of a field at a time; Stop ends it"
)
RESTS = {
    "park": (tr_noop("Park"), tr_noop("Slew to the park position that is set in the mount, and stay there")),
    "unpark": (tr_noop("Unpark"), tr_noop("Let a parked mount move again")),
    "home": (tr_noop("Home"), tr_noop("Slew to the mount’s own home position")),
    "flip": (tr_noop("Flip"), tr_noop("Take a German mount to the other side of its pier where it points")),
}
SETTLES = {
    "set clock": (tr_noop("Set clock"), tr_noop("Set the mount’s clock to this computer’s")),
    "set site": (tr_noop("Set site"), tr_noop("Set the mount’s site to yours")),
}


class OrderButtons:
    """By the names of the actions in :mod:`kochab.gear.actions`, Goto and Centre of the ``go`` box among them."""

    def __init__(self, control: MountControl, orders: MountActions, move_star: MoveStarMode, go: GoBox) -> None:
        self.take = ExplainedButton(tr("Take a frame"), orders.take_frame, tr("See where the mount really points"))
        tip = tr("Solve two frames, then sync the mount on them")
        self.sync = ExplainedButton(tr("Sync…"), orders.offer_sync, tip)
        self.undo = ExplainedButton(tr("Undo sync"), lambda: control.ask("undo", undo_sync), tr("Undo the last sync"))
        self.diagnose = ExplainedButton(tr("Diagnose"), orders.diagnose, tr(DIAGNOSE_TIP))
        self.model = ExplainedButton(tr("Pointing model"), orders.use_model, tr(MODEL_TIP))
        self.spiral = ExplainedButton(tr("Spiral search"), orders.spiral, tr(SPIRAL_TIP))
        tip = tr("Click a star in the frame, then where to put it")
        self.move_star = ExplainedButton(tr("Move star…"), move_star.begin, tip)
        self.settles = {
            n: ExplainedButton(tr(text), partial(orders.settle, n), tr(tip)) for n, (text, tip) in SETTLES.items()
        }
        self.rests = {n: ExplainedButton(tr(t), partial(orders.rest, n), tr(tip)) for n, (t, tip) in RESTS.items()}
        self.by_action: dict[str, ExplainedButton] = {
            "sync": self.sync,
            "undo": self.undo,
            "take_frame": self.take,
            "goto": go.goto,
            "centre": go.centre,
            "move_star": self.move_star,
            "diagnose": self.diagnose,
            "model": self.model,
            "spiral": self.spiral,
            **self.rests,
            **self.settles,
        }

    @property
    def explanations(self) -> list[Explanation]:
        """Why each cannot be used now, which is shown below the cards."""
        return [made.explanation for made in self.by_action.values()]

    def show_reasons(self, against: Mapping[str, str]) -> None:
        """Grey each button that has a reason against its action."""
        for name, made in self.by_action.items():
            made.explanation.set_reason(against[name])
