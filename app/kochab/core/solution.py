"""Where a frame points with its evidence, or why that is not known."""

import unicodedata
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field
from enum import StrEnum
from functools import lru_cache
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from kochab.core.arrays import Floats, Ints, Table
from kochab.core.attitude import Attitude, cross_product, unit, unit_vectors
from kochab.core.camera import Camera
from kochab.core.progress import Task
from kochab.core.values import frozen
from kochab.text.translation import tr, tr_noop

if TYPE_CHECKING:
    from astropy.wcs import WCS


@frozen(eq=False)
class Matches(Table):
    """Detections paired with catalogue stars; all arrays share the length M.

    ``detection`` (M,) indexes the detections, ``star`` (M,) the catalogue's rows; ``xy`` (M, 2)
    px; ``vectors`` (M, 3) ICRS unit vectors at the frame's date.
    """

    detection: Ints
    star: Ints
    xy: Floats
    vectors: Floats


class StarCatalogue(Protocol):
    """What is needed of a catalogue here."""

    def vectors(self, rows: Ints, year: float) -> Floats:
        """ICRS unit vectors (N, 3) at a Julian year."""
        ...

    def mag(self, rows: Ints) -> NDArray[np.floating]:
        """V magnitudes (N,)."""
        ...

    def brightest(self, vector: Floats, radius_rad: float, n: int, year: float) -> Ints:
        """The brightest rows of a cone around an ICRS unit vector.

        Parameters
        ----------
        vector : Floats
            Axis of the cone, ICRS unit vector (3,).
        radius_rad : float
            Its half angle, radians.
        n : int
            How many at most.
        year : float
            Epoch of the stars' places, Julian year.
        """
        ...

    def labels(self, rows: Ints) -> list[tuple[str, str]]:
        """Identifiers and names."""
        ...


@frozen(eq=False)
class Identification:
    """What an identifier returns: matches, a camera and an attitude good to about a pixel.

    ``log10_false_alarm`` bounds the probability of so good a match by chance, all ``candidates``
    that were tried counted. ``catalogue`` is the one whose rows the matches name, None for the shipped one.
    """

    matches: Matches
    camera: Camera
    attitude: Attitude
    log10_false_alarm: float
    method: str
    candidates: int = 1
    catalogue: StarCatalogue | None = None


@frozen
class NamedStar:
    """One identified star, for people and for JSON. ``mag`` is V; degrees are ICRS.

    One that is not ``fitted`` was found at its place after the solve, and took no part in it.
    """

    x: float
    y: float
    id: str
    name: str
    mag: float
    ra_deg: float
    dec_deg: float
    residual_px: float
    fitted: bool = True

    @property
    def ascii_name(self) -> str:
        """The name where there is no Greek: ``theta1 Ori`` is θ¹ Ori."""
        known = ((c, unicodedata.name(c, "")) for c in self.name)
        text = "".join(n.split()[-1].lower() if n.startswith("GREEK SMALL") else c for c, n in known)
        plain = unicodedata.normalize("NFKD", text.replace("lamda", "lambda"))  # Unicode writes LAMDA
        return plain.encode("ascii", "ignore").decode()


@frozen(eq=False)
class Solution:
    """A pointing with its evidence. Angles are ICRS (J2000) and belong to the frame's centre.

    ``camera`` and ``attitude`` are the fitted model that projects stars to pixels: that attitude is the optical
    axis', where the lens is symmetric, which may be pixels or arcminutes from the centre. :attr:`centre_attitude` is
    the rotation that goes with :attr:`ra_dec_deg` and :attr:`roll_deg`. The covariance of both is that of the centre.
    ``stars`` are those that the fit used, ``seen`` others that were found at their places.
    """

    camera: Camera
    attitude: Attitude
    stars: tuple[NamedStar, ...]
    rms_px: float
    log10_false_alarm: float
    method: str
    detections: int = 0
    elapsed_ms: Mapping[str, float] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    seen: tuple[NamedStar, ...] = ()

    @property
    def named(self) -> tuple[NamedStar, ...]:
        """Every identified star; where ``seen`` has some, brightest first, else as the fit has them."""
        return tuple(sorted((*self.stars, *self.seen), key=lambda star: star.mag)) if self.seen else self.stars

    @property
    def named_px(self) -> Floats:
        """Pixels (N, 2) of :attr:`named`."""
        return np.array([(star.x, star.y) for star in self.named]).reshape(-1, 2)

    @property
    def stars_px(self) -> Floats:
        """Pixels (N, 2) of the matched stars."""
        return np.array([(star.x, star.y) for star in self.stars]).reshape(-1, 2)

    @property
    def star_vectors(self) -> Floats:
        """ICRS unit vectors (N, 3) of the matched stars."""
        places_deg = np.array([(star.ra_deg, star.dec_deg) for star in self.stars]).reshape(-1, 2)
        return unit_vectors(places_deg[:, 0], places_deg[:, 1])

    @property
    def centre_attitude(self) -> Attitude:
        """From ICRS to axes at the middle of the frame: z out, y down the column there, x to the right.

        Distortion included, so that y is the recorded frame's down and not the undistorted one's.
        """
        return _at_the_middle(self.camera, self.attitude)

    @property
    def centre_vector(self) -> Floats:
        """ICRS unit vector (3,) at the middle of the frame, distortion included."""
        return self.centre_attitude.boresight

    @property
    def ra_dec_deg(self) -> tuple[float, float]:
        """ICRS degrees of the middle of the frame."""
        return self.centre_attitude.ra_dec_deg

    @property
    def roll_deg(self) -> float:
        """Position angle of the frame's up at its middle, degrees east of north."""
        return self.centre_attitude.roll_deg

    @property
    def rms_arcsec(self) -> float:
        """Residual RMS on the sky."""
        return self.rms_px * self.camera.scale_arcsec_px

    def sky_at(self, pixels: Floats) -> Floats:
        """ICRS unit vectors (N, 3) of pixels (N, 2)."""
        return np.asarray(self.camera.unproject(pixels) @ self.attitude.matrix)

    @property
    def radius_rad(self) -> float:
        """From the centre to the frame's farthest corner."""
        corners = np.array([[x, y] for x in (-0.5, self.camera.width - 0.5) for y in (-0.5, self.camera.height - 0.5)])
        return float(np.arccos(np.clip((self.sky_at(corners) @ self.centre_vector).min(), -1.0, 1.0)))

    def pixels_of(self, vectors: Floats) -> Floats:
        """Pixels (N, 2) of ICRS unit vectors (N, 3); NaN far outside the field, where the distortion folds back."""
        seen = np.asarray(vectors) @ self.attitude.matrix.T
        pixels = self.camera.project(seen)
        # Beyond reach the polynomial would fold stars from 70° away back into the frame.
        off_axis_rad = np.arctan2(np.hypot(seen[..., 0], seen[..., 1]), seen[..., 2])
        pixels[off_axis_rad > self.camera.reach_rad] = np.nan
        return pixels

    @property
    def wcs(self) -> "WCS":
        """The same as an `astropy.wcs.WCS`, TAN or TAN-SIP; its pixel (0, 0) is our (0, 0)."""
        from kochab.core.wcs import astropy_wcs  # astropy takes half a second to import

        return astropy_wcs(self.camera, self.attitude)

    def _repr_html_(self) -> str:
        """For a notebook: pointing, field, uncertainty, chance match and the brightest stars."""
        from kochab.text import angle_text as text

        ra, dec = self.ra_dec_deg
        width, height = map(text.angle_text, self.camera.fov_deg)
        x, y, roll = map(text.arcsec_text, self.attitude.sigma_arcsec)
        rows = {
            "Centre (ICRS)": text.radec_text(ra, dec, text.AngleStyle.SEXAGESIMAL),
            "": text.radec_text(ra, dec, text.AngleStyle.DECIMAL),
            "Field of view": f"{width} × {height}, {self.camera.scale_arcsec_px:.4g}″/px",
            "Rotation": f"{self.roll_deg:.3f}° east of north" + ", mirrored" * self.camera.mirrored,
            "Uncertainty (1σ)": f"{x} × {y}, rotation {roll}",
            "Stars matched": f"{len(self.stars)} of {self.detections}, RMS {self.rms_px:.2f} px",
            "Chance match": text.false_alarm_text(self.log10_false_alarm),
        }
        stars = [("Star", "V", "RA", "Dec", "x", "y", "Residual")]
        for star in sorted(self.stars, key=lambda star: star.mag)[:8]:
            place = (f"{star.ra_deg:.4f}°", f"{star.dec_deg:+.4f}°", f"{star.x:.1f}", f"{star.y:.1f}")
            stars.append((star.name or star.id, f"{star.mag:.2f}", *place, f"{star.residual_px:.2f} px"))
        return _html("Solution", [*rows.items()]) + _html("", stars, header=True) + _notes(self.warnings)


@lru_cache(maxsize=8)  # one solution's is asked for a dozen times
def _at_the_middle(camera: Camera, attitude: Attitude) -> Attitude:
    """As :attr:`Solution.centre_attitude` has it."""
    # Half a pixel up and down the column: y follows the recorded column, which distortion bends.
    steps = np.array([[0.0, -0.5], [0.0, 0.0], [0.0, 0.5]])
    above, z, below = camera.unproject(np.array([camera.width - 1, camera.height - 1]) / 2 + steps)
    x = unit(cross_product(below - above, z))
    return Attitude(np.stack([x, cross_product(z, x), z]) @ attitude.matrix, attitude.covariance)


class Reason(StrEnum):
    """Why there is no solution."""

    TOO_FEW_STARS = tr_noop("too few stars")
    TRAILED = tr_noop("trailed")
    OUT_OF_FOCUS = tr_noop("out of focus")
    CLOUDED_OR_DARK = tr_noop("clouded or dark")
    FIELD_TOO_SMALL = tr_noop("field too small for the catalogue")
    NO_PATTERN_AGREED = tr_noop("no pattern agreed")
    DISTORTION_TOO_STRONG = tr_noop("distortion too strong")
    TIMED_OUT = tr_noop("timed out")
    OUTSIDE_RADIUS = tr_noop("outside the search radius")
    ANOTHER_FIELD = tr_noop("field of view differs")


@frozen
class NoSolution:
    """No solution is a value: why, what was measured and tried, and one thing to do next."""

    reason: Reason
    advice: str
    tried: str = ""
    detections: int = 0
    elapsed_ms: Mapping[str, float] = field(default_factory=dict)
    measured: Mapping[str, float] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()

    @property
    def searched(self) -> bool:
        """Whether anything was tried: a method that lacks what it needs tries ``nothing``."""
        return not self.tried.startswith("nothing")

    def _repr_html_(self) -> str:
        """For a notebook: the reason, what was measured, and what to do."""
        rows = [("Reason", str(self.reason)), ("Advice", self.advice), ("Stars detected", str(self.detections))]
        rows += [("Tried", self.tried)] * bool(self.tried)
        rows += [(name.replace("_", " "), f"{value:.4g}") for name, value in self.measured.items()]
        return _html("No solution", rows) + _notes(self.warnings)


def no_solution_text(failure: NoSolution) -> str:
    """Why and what to do, as a sentence each."""
    reason = tr(failure.reason)
    return f"{reason[:1].upper()}{reason[1:]}: {failure.advice}"


SolveNow = Callable[[], Task[Solution | NoSolution]]
"""Each call takes a new frame and solves it."""


def _html(title: str, rows: Sequence[Sequence[str]], header: bool = False) -> str:
    """A table; the first row or else the first column is its header."""
    from html import escape  # 5 ms, and what is printed needs none

    out = []
    for k, row in enumerate(rows):
        tags = ["th" if (k == 0 if header else j == 0) else "td" for j in range(len(row))]
        cells = (f"<{tag}>{escape(cell)}</{tag}>" for tag, cell in zip(tags, row, strict=True))
        out.append(f"<tr>{''.join(cells)}</tr>")
    return f"<table>{f'<caption>{title}</caption>' * bool(title)}{''.join(out)}</table>"


def _notes(warnings: Sequence[str]) -> str:
    from html import escape

    return "".join(f"<p>{escape(text)}</p>" for text in warnings)
