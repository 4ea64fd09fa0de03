"""A solution as lines of text: what the panel shows and what is copied."""

import csv
import io
import math
from collections.abc import Iterable, Mapping

from kochab.core.camera import FisheyeCamera
from kochab.core.solution import NoSolution, Reason, Solution
from kochab.solver.diagnosis import DAY_SHARE
from kochab.text.angle_text import (
    AngleStyle,
    angle_text,
    arcsec_text,
    dec_text,
    false_alarm_text,
    milliseconds_text,
    ra_text,
    radec_plain,
)
from kochab.text.translation import in_english, number, tr, tr_noop

STAGES = {
    "read": tr_noop("read"),
    "detect": tr_noop("detect"),
    "identify": tr_noop("identify"),
    "attitude": tr_noop("attitude"),
    "total": tr_noop("total"),
}


def rows(s: Solution) -> list[tuple[str, str, str]]:
    """(title, value, explanation) of everything but the position."""
    w, h = s.camera.fov_deg
    x, y, roll = s.attitude.sigma_arcsec
    return [
        (tr("Rotation"), _rotation(s, ".3f"), tr("Position angle of up, east of north")),
        (tr("Field of view"), f"{angle_text(w)} × {angle_text(h)}", tr("Width and height of the frame on the sky")),
        (tr("Pixel scale"), tr("{scale:.4f} ″/px", scale=s.camera.scale_arcsec_px), tr("At the centre of the frame")),
        (
            tr("Matches"),
            tr("{stars} of {detections} detected stars", stars=len(s.stars), detections=s.detections),
            tr("Detected stars matched with the catalogue"),
        ),
        (
            tr("RMS"),
            tr("{px:.2f} px ({arcsec})", px=s.rms_px, arcsec=arcsec_text(s.rms_arcsec)),
            tr("Residual of the matched stars"),
        ),
        (
            tr("Uncertainty"),
            tr("{x} × {y}, rotation {roll}", x=arcsec_text(x), y=arcsec_text(y), roll=arcsec_text(roll)),
            tr("1σ of the pointing along the frame's x and y, and of the rotation"),
        ),
        (
            tr("Chance match"),
            f"{false_alarm_text(s.log10_false_alarm)}",
            tr("False-alarm probability: a match this good by chance (log₁₀ {log:.1f})", log=s.log10_false_alarm),
        ),
        (tr("Camera"), camera_text(s), tr("Focal length in pixels, and the distortion if fitted")),
        (tr("Method"), s.method, tr("How the stars were identified")),
        (tr("Time"), times_text(s.elapsed_ms), tr("How long each stage took")),
    ]


def field_text(s: Solution, altaz: str = "") -> str:
    """Uncertainty, field, pixel scale, rotation, and the height if told, for a card; no line breaks within a fact."""
    w, h = s.camera.fov_deg
    up = tr("Rotation {rotation}", rotation=_rotation(s, ".1f"))
    sigma = arcsec_text(max(s.attitude.sigma_arcsec[:2]))
    field = tr("Field {width} × {height}", width=angle_text(w), height=angle_text(h))
    scale = tr("Scale {scale:.4g}″/px", scale=s.camera.scale_arcsec_px)
    return "   ".join(fact.replace(" ", "\u00a0") for fact in (f"± {sigma}", field, scale, up, altaz) if fact)


def _rotation(s: Solution, spec: str) -> str:
    turn = number(s.roll_deg, f"+{spec}").replace("-", "−")  # the minus sign, as wide as the plus
    return tr("{turn}°, mirrored", turn=turn) if s.camera.mirrored else f"{turn}°"


def camera_text(s: Solution) -> str:
    """Focal length, whether distortion was fitted, and whether the lens is a fisheye."""
    c = s.camera
    text = tr("f = {focal:.1f} px, no distortion fitted", focal=c.focal_px)
    if c.distorted:
        text = tr("f = {focal:.1f} px, k1 = {k1}", focal=c.focal_px, k1=number(c.k1, "+.4g").replace("-", "−"))
    if c.aspect != 1.0:
        text = tr("{camera}, pixels {aspect:.4f} times as tall as wide", camera=text, aspect=c.aspect)
    return tr("fisheye, {camera}", camera=text) if isinstance(c, FisheyeCamera) else text


def times_text(elapsed_ms: Mapping[str, float]) -> str:
    """Stage times, total last, without the stages that were not reached."""
    times = {name: value for name, value in elapsed_ms.items() if value >= 0.05}
    known = [k for k in STAGES if k in times] + [k for k in times if k not in STAGES]
    return ", ".join(f"{tr(STAGES.get(k, k))} {milliseconds_text(times[k])}" for k in known) or tr("not measured")


def attitude_forms(s: Solution) -> list[tuple[str, str]]:
    """The attitude as (name, text): quaternion, matrix and angles of the frame's centre; the optical axis."""
    centre, axis = s.centre_attitude, s.attitude
    q = " ".join(f"{v:+.7f}" for v in centre.quaternion)
    m = "\n".join("  ".join(f"{v:+.8f}" for v in row) for row in centre.matrix)
    e, a = ("  ".join(f"{v:+.6f}" for v in attitude.euler_deg) for attitude in (centre, axis))
    return [
        (tr("Quaternion (w x y z), frame centre"), q),
        (tr("Matrix, ICRS to camera, frame centre"), m),
        (tr("RA, Dec, roll (frame centre, °)"), e),
        (tr("RA, Dec, roll (optical axis, °), at x {cx:.1f}, y {cy:.1f} px", cx=s.camera.cx, cy=s.camera.cy), a),
    ]


# What is copied stays English with a decimal point.
@in_english()
def attitude_plain(s: Solution) -> str:
    """All forms for the clipboard."""
    return "\n".join(f"{name}:\n{text}" for name, text in attitude_forms(s))


@in_english()
def summary(s: Solution, style: AngleStyle, source: str = "") -> str:
    """Everything for the clipboard."""
    ra, dec = s.ra_dec_deg
    lines = [f"File: {source}"] if source else []
    lines.append(f"RA/Dec (ICRS): {radec_plain(ra, dec, style)}")
    lines += [f"{title}: {value}" for title, value, _ in rows(s)]
    return "\n".join([*lines, attitude_plain(s)])


# -- Many files, as a table and as CSV ---------------------------------------------------------

RESULT_TITLES = (
    tr_noop("File"),
    tr_noop("State"),
    "RA",
    tr_noop("Dec"),
    tr_noop("Rotation"),
    tr_noop("Field"),
    tr_noop("Scale"),
    tr_noop("Stars"),
    "±",
)
CSV_TITLES = "file,state,ra_deg,dec_deg,roll_deg,mirrored,fov_x_deg,fov_y_deg,scale_arcsec_px,matches,sigma_arcsec"


def result_cells(name: str, state: str, s: Solution | None, style: AngleStyle) -> list[str]:
    """One row under :data:`RESULT_TITLES`; without a solution name and state alone.

    Parameters
    ----------
    name : str
        The file's.
    state : str
        What became of it, in words.
    s : Solution or None
        Its solution; None: there is none.
    style : AngleStyle
        How coordinates are written.
    """
    if s is None:
        return [name, state]
    ra, dec = s.ra_dec_deg
    fov = " × ".join(angle_text(side) for side in s.camera.fov_deg)
    up = number(s.roll_deg, "+.2f").replace("-", "−") + "°"
    scale = tr("{scale:.4g}″/px", scale=s.camera.scale_arcsec_px)
    sigma = arcsec_text(max(s.attitude.sigma_arcsec[:2]))
    return [name, state, ra_text(ra, style), dec_text(dec, style), up, fov, scale, str(len(s.stars)), sigma]


def results_csv(files: Iterable[tuple[str, str, Solution | None]]) -> str:
    """(file, state, solution) of each as CSV under :data:`CSV_TITLES`; ICRS of the frame's centre."""
    out = io.StringIO()
    write = csv.writer(out, lineterminator="\n")
    write.writerow(CSV_TITLES.split(","))
    for name, state, s in files:
        row: list[object] = [name, state]
        if s is not None:
            ra, dec = s.ra_dec_deg
            row += [f"{ra:.6f}", f"{dec:+.6f}", f"{s.roll_deg:.4f}", s.camera.mirrored]
            row += [f"{side:.5f}" for side in s.camera.fov_deg]
            row += [f"{s.camera.scale_arcsec_px:.5f}", len(s.stars), f"{max(s.attitude.sigma_arcsec[:2]):.4f}"]
        write.writerow(row + [""] * (11 - len(row)))
    return out.getvalue()


# The ending of a measured number's name, what stands behind it, and what it is multiplied by.
UNITS = (
    ("_px", " px", 1.0),
    ("_deg", "°", 1.0),
    ("_arcsec", "″", 1.0),
    ("_ms", " ms", 1.0),
    ("_share", " %", 100.0),
    ("_sigma", " σ", 1.0),
)


def reason_text(n: NoSolution) -> str:
    """The reason as the title over its advice: a sky without stars is either too bright, or hidden or too dark."""
    if n.reason is not Reason.CLOUDED_OR_DARK:
        return tr(n.reason)
    return tr("too bright") if n.measured.get("background_share", 0.0) > DAY_SHARE else tr("no stars visible")


def measured_rows(n: NoSolution) -> list[tuple[str, str]]:
    """(what, how much) that was measured on a frame without a solution."""
    out = [(tr("stars detected"), f"{n.detections}")]
    for key, value in n.measured.items():
        name, unit, times = key, "", 1.0
        for suffix, mark, factor in UNITS:
            if name.endswith(suffix):
                name, unit, times = name.removesuffix(suffix), mark, factor
        if name in ("detections", "detected", "stars_found") and value == n.detections:
            continue
        out.append((tr(name.replace("_", " ").replace("fwhm", "FWHM")), f"{_plain_number(times * value)}{unit}"))
    return out


def _plain_number(value: float) -> str:
    """Three figures, as many decimals as that takes, and no power of ten."""
    if not math.isfinite(value):
        return tr("unknown")
    if value == 0 or abs(value) >= 100:
        return number(value, ".0f")
    plain = f"{value:.{min(2 - math.floor(math.log10(abs(value))), 6)}f}".rstrip("0").rstrip(".")
    return number(float(plain), f".{len(plain.partition('.')[2])}f")


@in_english()
def failure_plain(n: NoSolution, source: str = "") -> str:
    """A failed solve for the clipboard."""
    lines = [f"File: {source}"] if source else []
    lines += [f"No solution: {n.reason}", f"Advice: {n.advice}"]
    if n.tried and n.searched:
        lines.append(f"Tried: {n.tried}")
    lines += [f"{name}: {value}" for name, value in measured_rows(n)]
    return "\n".join([*lines, f"Time: {times_text(n.elapsed_ms)}"])
