"""The mount's site and limits, kept between starts and obeyed by its guard."""

from collections.abc import Callable
from typing import Any

from kochab.core.frame import Site
from kochab.core.progress import Progress, Task
from kochab.gear.mount_events import MountSnapshot
from kochab.gear.mounts.guard import Guard
from kochab.gear.mounts.motion_plan import Limits
from kochab.gear.profiles import current_profile, keep_profile
from kochab.text.translation import tr, tr_noop
from kochab.window.devices.mount_connection import MountConnection
from kochab.window.settings import WindowSettings


class SiteAndLimits:
    """Keeps them, and tells the guard of the mount that is connected."""

    def __init__(
        self, settings: WindowSettings, connection: MountConnection, known: Callable[[], MountSnapshot]
    ) -> None:
        self._settings, self._connection, self._known = settings, connection, known

    @property
    def site(self) -> Site | None:
        """The site of the next guard."""
        return self._settings.site

    @property
    def limits(self) -> Limits:
        """The limits of the next guard."""
        return current_profile(self._settings).limits

    def use_site(self, site: Site | None) -> None:
        """Keep the site; the horizon limit goes by it from the next connection on."""
        self._settings.keep_site(site)

    def site_note(self) -> str:
        """What a new site needs, or "": the guard keeps the old one, which its driver goes by."""
        known = self._known()
        if known.connected is None or known.practice or known.connected.site == self._settings.site:
            return ""
        return tr("Disconnect the mount and connect it again to use the new site.")

    def use_limits(self, **changes: Any) -> None:
        """Keep these limits in the profile, by its names, and go by them from the next motion on."""
        keep_profile(self._settings, **changes)
        limits = self.limits

        def use(guard: Guard) -> Task[None]:
            yield Progress(tr_noop("limits"))
            guard.limits = limits

        self._connection.aside("limits", use)
