"""Places of bodies for the Minor Planet Center, in its ADES format as pipe-separated values.

Version 2022: Chesley and others, "ADES: Astrometric Data Exchange Standard", https://github.com/IAU-ADES/ADES-Master. A
row is what one frame shows; its sigmas are those of that place and magnitude.
"""

import re
from collections.abc import Iterator
from datetime import UTC

from kochab.core import __version__
from kochab.core.errors import UsageError
from kochab.core.values import frozen
from kochab.workflows.night.strangers import Sight, Stranger, StrangerKind
from kochab.workflows.night.summary import Night

COLUMNS = (
    *("permID", "provID", "trkSub", "mode", "stn", "obsTime", "ra", "dec", "rmsRA", "rmsDec", "astCat"),
    *("mag", "rmsMag", "band", "photCat", "exp"),
)
CATALOGUE = "Tycho2"
NUMBERED = re.compile(r"(\d+)(?: .*)?")
COMET = re.compile(r"(\d+[PDI])(?:/.*)?")
PROVISIONAL = re.compile(r"(?:[ADCPX]/)?\d{4} [A-Z]{1,2}\d*|\d{4} (?:P-L|T-[123])")
CODE = re.compile(r"[0-9A-Z][0-9]{2}")


@frozen
class Observatory:
    """Who observes, where and with what: the MPC's code of the site, a name, aperture in metres, design, detector."""

    code: str
    observer: str
    aperture_m: float
    design: str
    detector: str

    @classmethod
    def parse(cls, code: str, observer: str, telescope: str) -> "Observatory":
        """What a person types; UsageError says what is wrong.

        Parameters
        ----------
        code : str
            Of the Minor Planet Center: three letters or digits.
        observer : str
            A name.
        telescope : str
            Aperture in metres, design and detector with commas between, such as ``0.2,reflector,CMOS``.
        """
        if not CODE.fullmatch(code.strip().upper()):
            raise UsageError("{text} is not an MPC observatory code, such as 703.", text=code)
        if not _plain(observer):
            raise UsageError("--ades needs --observer NAME.")
        parts = [_plain(part) for part in telescope.split(",")]
        try:
            aperture, design, detector = float(parts[0]), *parts[1:]
            if not (0.0 < aperture < 100.0 and design and detector):
                raise ValueError
        except ValueError as error:
            text = "--telescope {text} is not understood: give aperture in metres, design, detector."
            raise UsageError(text, text=telescope or "''") from error
        return cls(code.strip().upper(), _plain(observer)[:100], aperture, design[:35], detector[:25])


def _plain(text: str) -> str:
    """One line of a header: what is no printable letter, and a bar, would end it."""
    return " ".join("".join(c if c.isprintable() and c != "|" else " " for c in text).split())


def ades_psv(night: Night, observatory: Observatory) -> str:
    """The file of a night's bodies, known and unknown, "" for none; new stars are no bodies."""
    bodies = [one for one in night.strangers if one.kind is not StrangerKind.NEW_STAR]
    rows = [row for k, one in enumerate(bodies) for row in _rows(one, k, night, observatory)]
    if not rows:
        return ""
    head = [
        *("# version=2022", "# observatory", f"! mpcCode {observatory.code}"),
        *("# submitter", f"! name {observatory.observer}", "# observers", f"! name {observatory.observer}"),
        *("# measurers", f"! name {observatory.observer}", "# telescope", f"! design {observatory.design}"),
        *(f"! aperture {observatory.aperture_m:g}", f"! detector {observatory.detector}"),
        *("# software", f"! astrometry Kochab {__version__}"),
    ]
    return "\n".join([*head, "|".join(COLUMNS), *("|".join(row[name] for name in COLUMNS) for row in rows)]) + "\n"


def _rows(body: Stranger, k: int, night: Night, observatory: Observatory) -> Iterator[dict[str, str]]:
    mode = "CMO" if "CMO" in observatory.detector.upper() else "CCD"
    for frame, sight in zip(body.frames, body.sights, strict=True):
        time = night.frames[frame].time_utc
        if time is not None:
            of_frame = night.frames[frame].exposure_s
            yield {
                **dict.fromkeys(COLUMNS, ""),
                **_identity(body.name, k),
                **{"mode": mode, "stn": observatory.code, "astCat": CATALOGUE, "photCat": CATALOGUE, "band": "V"},
                "obsTime": f"{time.astimezone(UTC):%Y-%m-%dT%H:%M:%S}.{time.microsecond // 10000:02d}Z",
                **_place(sight),
                "exp": f"{of_frame:.4g}" if of_frame else "",
            }


def _place(sight: Sight) -> dict[str, str]:
    """Degrees, arcsec (of right ascension those on the sky), magnitudes."""
    one = f"{sight.sigma_arcsec:.3f}"
    return {
        **{"ra": f"{sight.ra_deg % 360.0:.6f}", "dec": f"{sight.dec_deg:+.6f}"},
        **{"rmsRA": one, "rmsDec": one},
        **{"mag": f"{sight.mag:.2f}", "rmsMag": f"{sight.sigma_mag:.2f}"},
    }


def _identity(name: str, k: int) -> dict[str, str]:
    """A body's designation as the Minor Planet Center writes it; an unknown one gets a tracklet name of our own."""
    if not name:
        return {"trkSub": f"KOC{k + 1:03d}"}
    if PROVISIONAL.fullmatch(short := name.split(" (")[0]):
        return {"provID": short}
    if found := COMET.fullmatch(name) or NUMBERED.fullmatch(name):
        return {"permID": found[1]}
    return {"trkSub": re.sub("[^A-Za-z0-9]", "", name)[:8] or f"KOC{k + 1:03d}"}
