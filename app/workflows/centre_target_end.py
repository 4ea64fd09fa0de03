"""How a centring ends, in one word and in one sentence."""

from dataclasses import dataclass
from enum import StrEnum

from app.core.solution import Solution
from app.workflows.centre_target_course import Course


class End(StrEnum):
    """How a centring ended."""

    CENTRED = "centred"
    NOT_CONVERGING = "not converging"
    SLIPPING = "slipping"
    REFUSED = "refused"
    NO_SOLUTION = "no solution"


@dataclass(frozen=True, slots=True)
class Centring:
    """The end, in one sentence too, and the way there.

    ``errors_arcsec`` are the distances seen, one before each correction and one at the end;
    ``corrections`` the ways they were made; what the mount refused or lost is in ``notes``.
    ``synced``: the mount now knows the sky.
    """

    end: End
    sentence: str
    errors_arcsec: tuple[float, ...] = ()
    corrections: tuple[str, ...] = ()
    synced: bool = False
    solution: Solution | None = None
    notes: tuple[str, ...] = ()

    @property
    def centred(self) -> bool:
        """Whether the target is where it was wanted."""
        return self.end is End.CENTRED


def verdict_on(course: Course, name: str, made: int, tries: int) -> tuple[End, str] | None:
    """The end after the last look and its sentence; None when it is worth another correction."""
    error, left = course.error_arcsec, arcsec(course.error_arcsec)
    if error <= course.tolerance_arcsec:
        return End.CENTRED, f"{name} is centred to {left}."
    if course.slips > 1:
        return End.SLIPPING, (
            f"The telescope does not move as far as it is told, {left} are left: a clutch slips, "
            "a cable pulls, or the balance is wrong."
        )
    if course.no_better:
        return End.NOT_CONVERGING, (
            f"The corrections do not bring it nearer, {left} are left: check clutches, balance "
            "and wind."
        )
    if made >= tries:
        wanted = arcsec(course.tolerance_arcsec)
        return End.NOT_CONVERGING, (
            f"After {tries} corrections {left} are left, more than {wanted}."
        )
    return None


def arcsec(value: float) -> str:
    """An angle for people, in the unit that suits it."""
    if value < 100.0:
        return f"{value:.1f} arcsec"
    return f"{value / 60.0:.1f} arcmin" if value < 6000.0 else f"{value / 3600.0:.2f} deg"
