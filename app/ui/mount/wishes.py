"""Which mount a person wants to talk to; remembered between starts."""

from dataclasses import dataclass

from app.core.errors import UsageError
from app.core.mount import Epoch
from app.mounts import DRIVERS
from app.ui.mount.eye import CameraWish
from app.ui.settings import Settings

OWN = "its own"
EPOCHS = {OWN: None, str(Epoch.DATE): Epoch.DATE, str(Epoch.J2000): Epoch.J2000}
EXPOSURE_S = 2.0


@dataclass(frozen=True, slots=True)
class MountWish:
    """A port and what listens there; ``baud`` and ``epoch`` are the driver's own when None."""

    port: str
    driver: str = "lx200"
    baud: int | None = None
    epoch: Epoch | None = None

    @classmethod
    def typed(cls, port: str, driver: str, baud: str, epoch: str) -> "MountWish":
        """From what stands in the fields; UsageError says what is wrong."""
        port, baud = port.strip(), baud.strip()
        if not port:
            raise UsageError(
                "Choose a port, or type one: a device, COM3 or socket://HOST:PORT; "
                "“Find my mount” looks on all of them."
            )
        if baud and baud != OWN and not (baud.isdecimal() and 300 <= int(baud) <= 1_000_000):
            raise UsageError(f"“{baud}” is not a baud rate: most mounts use 9600 or 115200.")
        rate = int(baud) if baud.isdecimal() else None
        return cls(port, driver, rate, EPOCHS.get(epoch))


def kept_mount(settings: Settings) -> MountWish:
    """The one of last time."""
    driver = settings.text("mount/driver", "lx200")
    baud = settings.text("mount/baud", "")
    return MountWish(
        settings.text("mount/port", ""),
        driver if driver in DRIVERS else "lx200",
        int(baud) if baud.isdecimal() else None,
        EPOCHS.get(settings.text("mount/epoch", OWN)),
    )


def keep_mount(settings: Settings, wish: MountWish) -> None:
    """Remember it."""
    settings.keep("mount/port", wish.port)
    settings.keep("mount/driver", wish.driver)
    settings.keep("mount/baud", "" if wish.baud is None else str(wish.baud))
    settings.keep("mount/epoch", OWN if wish.epoch is None else str(wish.epoch))


def kept_camera(settings: Settings) -> CameraWish:
    """The camera of last time; its source is empty when there was none."""
    try:
        exposure = float(settings.text("mount/exposure", str(EXPOSURE_S)))
    except ValueError:
        exposure = EXPOSURE_S
    return CameraWish(
        settings.text("mount/camera", ""), settings.text("mount/camera_address", ""), exposure
    )


def keep_camera(settings: Settings, wish: CameraWish) -> None:
    """Remember it."""
    settings.keep("mount/camera", wish.source)
    settings.keep("mount/camera_address", wish.address)
    settings.keep("mount/exposure", str(wish.exposure_s))
