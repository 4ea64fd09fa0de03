"""What the Laboratory's table says of a trial, column by column."""

from collections.abc import Callable
from dataclasses import dataclass

from app.ui.formats import (
    AngleStyle,
    angle_text,
    arcsec_text,
    false_alarm_text,
    milliseconds_text,
    radec_text,
)
from app.workflows.laboratory import Trial
from app.workflows.laboratory_kinds import Kind

LAST = float("inf")
NOTHING = "–"


@dataclass(frozen=True, slots=True)
class Said:
    """A cell: its text, what it is sorted by if not that, and more for who asks."""

    text: str
    rank: float | None = None
    tip: str = ""


def columns_of(kind: Kind) -> dict[str, Callable[[Trial], Said]]:
    """The columns of a table of this kind, by title."""
    first = {Kind.METHOD: "Method", Kind.DETECTOR: "Detector", Kind.ATTITUDE: "Attitude"}[kind]
    more: dict[Kind, dict[str, Callable[[Trial], Said]]] = {
        Kind.METHOD: {"Matches": _matches, "Wrong": _wrong, "Time": _time},
        Kind.DETECTOR: {
            "Found": _found, "True": _true, "Matches": _matches, "Wrong": _wrong, "RMS": _rms,
            "Time": _time,
        },
        Kind.ATTITUDE: {
            "From the fit": _from_fit, "Matches": _matches, "Wrong": _wrong, "RMS": _rms,
            "Time": _time,
        },
    }  # fmt: skip
    return {
        first: lambda t: Said(t.name), "Answer": _answer, **more[kind], "Sigma": _sigma,
        "Reason": lambda t: Said(t.reason, None, t.advice), "Paper": lambda t: Said(t.paper),
    }  # fmt: skip


def answer(t: Trial) -> str:
    """Right, wrong, or none; where it points when nobody knows better."""
    if not t.answered or t.ra_dec_deg is None:
        return "none"
    if t.right is None:
        return radec_text(*t.ra_dec_deg, AngleStyle.SEXAGESIMAL)
    off = angle_text((t.off_arcsec or 0.0) / 3600.0)
    return f"right, {off} off" if t.right else f"WRONG, {off} off"


def _answer(t: Trial) -> Said:
    # Right answers first, then those nobody can judge, then wrong ones, then none.
    rank = {True: 0.0, None: 1.0, False: 2.0}[t.right] if t.answered else 3.0
    if t.ra_dec_deg is None:
        return Said(answer(t), rank, t.advice)
    odds = false_alarm_text(t.log10_false_alarm if t.log10_false_alarm is not None else LAST)
    where = radec_text(*t.ra_dec_deg, AngleStyle.SEXAGESIMAL)
    return Said(answer(t), rank, f"{where}\nby chance: {odds}")


def _matches(t: Trial) -> Said:
    return Said(f"{t.matches}" if t.answered else NOTHING, float(t.matches))


def _wrong(t: Trial) -> Said:
    return Said(NOTHING, LAST) if t.wrong is None else Said(f"{t.wrong}", t.wrong)


def _found(t: Trial) -> Said:
    return Said(NOTHING, LAST) if t.found is None else Said(f"{t.found.stars}", t.found.stars)


def _true(t: Trial) -> Said:
    found = t.found
    if found is None or found.true is None:
        return Said(NOTHING, LAST, "Known for simulated fields only")
    place = "" if found.error_px is None else f", their places {found.error_px:.2f} px off"
    tip = f"{found.true} of the {found.there} stars were found{place}"
    return Said(f"{found.true} of {found.there}", -found.true, tip)


def _rms(t: Trial) -> Said:
    if t.rms_px is None:
        return Said(NOTHING, LAST)
    return Said(f"{t.rms_px:.2f} px", t.rms_px, "Of the matched stars’ places, as fitted")


def _from_fit(t: Trial) -> Said:
    if t.from_fit_arcsec is None:
        return Said(NOTHING, 0.0 if t.answered else LAST)
    away, roll = t.from_fit_arcsec
    tip = f"{arcsec_text(away)} on the sky, {arcsec_text(roll)} in roll"
    return Said(arcsec_text(away), away, f"From the attitude of the fit: {tip}")


def _time(t: Trial) -> Said:
    spent = duration_text(t.seconds)
    tables = duration_text(t.tables_s)
    first = f"; making its tables took {tables}, once" if t.tables_s > 0 else ""
    return Said(spent, t.seconds, f"{spent} of processor time{first}")


def _sigma(t: Trial) -> Said:
    if t.sigma_arcsec is None:
        return Said(NOTHING, LAST, "Too few matches to tell" if t.answered else "")
    x, y, roll = (arcsec_text(value) for value in t.sigma_arcsec)
    most = max(t.sigma_arcsec[:2])
    return Said(arcsec_text(most), most, f"From the matches’ residuals: {x} × {y}, roll {roll}")


def duration_text(seconds: float) -> str:
    """A processor time; microseconds where there are not many."""
    return f"{1e6 * seconds:.0f} µs" if 0 < seconds < 1e-3 else milliseconds_text(1e3 * seconds)
