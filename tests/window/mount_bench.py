"""The Mount view in a window, connected to a simulated telescope on a pseudo-terminal."""

from contextlib import contextmanager
from types import SimpleNamespace

from kochab.gear.mounts import open_mount
from kochab.gear.mounts.guard import Guard
from tests.gear.mounts.bench import LIMITS, SITE, simulated


class BenchOpening:
    """What the view would do with a port, but at the bench's own time and site."""

    farewell = "Good night."
    practice = score = None

    def __init__(self, bench, driver):
        self.bench, self.driver, self.closed = bench, driver, False
        self.guard = None

    def __call__(self):
        def again():
            return open_mount(self.driver, self.bench.line.port, site=SITE, clock=self.bench.clock, stop_first=True)

        mount = open_mount(self.driver, self.bench.line.port, site=SITE, clock=self.bench.clock)
        self.guard = Guard(mount, SITE, LIMITS, self.bench.clock, reopen=again)
        return self.guard

    def over(self):
        self.closed = True


@contextmanager
def connected(qtbot, commands, driver="lx200", slew_deg_s=20.0, at=None):
    """The Mount view with a mount that has told where it is; ``at``: RA and Dec of date."""
    with simulated(driver, slew_deg_s) as bench:
        if at is not None:
            bench.telescope.sync(*at)
        commands.views.show("mount")
        view = commands.views.docks["mount"].view
        opening = BenchOpening(bench, driver)
        view.control.begin(opening, bench.port)
        qtbot.waitUntil(lambda: view.control.known.report is not None, timeout=15_000)
        bench.telescope.log.clear()
        said = []
        view.control.message.connect(lambda sentence, role: said.append(sentence))
        try:
            yield SimpleNamespace(
                view=view, control=view.control, bench=bench, telescope=bench.telescope, opening=opening, said=said
            )
        finally:
            if view.control.known.phase != "off":
                view.control.disconnect_mount()
                qtbot.waitUntil(lambda: opening.closed, timeout=15_000)
