"""A solution as CSV, DS9 regions or tags within a picture, and where its north is."""

import csv
import io
from collections.abc import Iterable

import numpy as np

from kochab.core.arrays import Floats
from kochab.core.attitude import east_north, unit
from kochab.core.solution import Solution

_COLUMNS = ("x", "y", "id", "name", "mag", "ra_deg", "dec_deg", "residual_px")
_REGION_RADIUS_PX = 8.0


def csv_text(rows: Iterable[Iterable[object]]) -> str:
    """Rows as CSV, a line each."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


def stars_csv(solution: Solution) -> str:
    """The identified stars, one a line, brightest first, with a line of column names.

    ``x``, ``y`` are px from the centre of the first pixel; degrees are ICRS; ``mag`` is V.
    """
    rows: list[tuple[object, ...]] = [_COLUMNS]
    for star in sorted(solution.named, key=lambda s: s.mag):
        place = f"{star.mag:.2f}", f"{star.ra_deg:.6f}", f"{star.dec_deg:.6f}", f"{star.residual_px:.3f}"
        rows.append((f"{star.x:.3f}", f"{star.y:.3f}", star.id, star.name, *place))
    return csv_text(rows)


def ds9_regions(solution: Solution) -> str:
    """A region file for SAOImage DS9, in ASCII: a circle on the sky for every identified star."""
    radius = _REGION_RADIUS_PX * solution.camera.scale_arcsec_px
    lines = ["# Region file format: DS9 version 4.1", "global color=green", "icrs"]
    for star in solution.named:
        label = (star.ascii_name or star.id).replace("{", "(").replace("}", ")")
        place = f"{star.ra_deg:.6f},{star.dec_deg:.6f}"
        lines.append(f'circle({place},{radius:.3f}") # text={{{label}}}')
    return "\n".join(lines) + "\n"


def compass(solution: Solution) -> tuple[Floats, Floats]:
    """Unit vectors (2,) on the screen (x right, y down) towards north and east at the centre."""
    camera = solution.camera
    middle = np.array([(camera.width - 1) / 2.0, (camera.height - 1) / 2.0])
    centre = solution.centre_vector
    ends = centre + 2.0 / camera.focal_px * east_north(centre)  # some two pixels away
    east, north = unit(solution.pixels_of(unit(ends)) - middle)
    return north, east


_AVM = """<?xpacket begin="\ufeff" id="W5M0MpCehiHzreSzNTczkc9d"?>
<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">
<rdf:Description rdf:about="" xmlns:avm="http://www.communicatingastronomy.org/avm/1.0/"
 xmlns:photoshop="http://ns.adobe.com/photoshop/1.0/">
<avm:MetadataVersion>1.2</avm:MetadataVersion>
<avm:Type>Observation</avm:Type>
<photoshop:Credit>{credit}</photoshop:Credit>
<avm:Spatial.CoordinateFrame>ICRS</avm:Spatial.CoordinateFrame>
<avm:Spatial.Equinox>2000.0</avm:Spatial.Equinox>
<avm:Spatial.CoordsystemProjection>TAN</avm:Spatial.CoordsystemProjection>
<avm:Spatial.Quality>{quality}</avm:Spatial.Quality>
<avm:Spatial.Rotation>{rotation:.6f}</avm:Spatial.Rotation>
{lists}<avm:Spatial.Notes><rdf:Alt>
<rdf:li xml:lang="x-default">Solved by Kochab; lens distortion left out, up to {worst_px:.1f} px.</rdf:li>
</rdf:Alt></avm:Spatial.Notes>
</rdf:Description></rdf:RDF></x:xmpmeta>
<?xpacket end="w"?>"""
_FULL_PX = 2.0
_WIDEST_RAD = 1.4  # 80 degrees: a gnomonic map grows without bound towards 90


def avm_packet(solution: Solution, credit: str) -> bytes:
    """An XMP packet that places a picture of the frame on the sky, empty when the standard has no words for it.

    Astronomy Visualization Metadata 1.2 (Hurt, Christensen and Gauthier 2011): one scale and one rotation about a
    reference pixel, fitted to the whole frame; what distortion leaves over is told in the notes. Pixels count from 1
    at the lower left, the rotation from up to north, both as in FITS. It can't tell a mirrored picture.
    """
    camera, centre = solution.camera, solution.centre_vector
    if camera.mirrored or solution.radius_rad > _WIDEST_RAD:
        return b""
    x, y = np.meshgrid(np.linspace(0.0, camera.width - 1.0, 21), np.linspace(0.0, camera.height - 1.0, 21))
    vectors = solution.sky_at(np.column_stack([x.ravel(), y.ravel()]))
    east, north = (vectors @ east_north(centre).T / (vectors @ centre)[:, None]).T
    seen, places = -east + 1j * north, x.ravel() + 1.0 + 1j * (camera.height - y.ravel())
    (slope, offset), *_ = np.linalg.lstsq(np.column_stack([places, np.ones_like(places)]), seen, rcond=None)
    worst_px = float(np.abs(slope * places + offset - seen).max() / np.abs(slope))
    reference, scale_deg = -offset / slope, np.degrees(np.abs(slope))
    lists = {
        "ReferenceValue": solution.ra_dec_deg,
        "ReferenceDimension": (camera.width, camera.height),
        "ReferencePixel": (reference.real, reference.imag),
        "Scale": (-scale_deg, scale_deg),
    }
    tags = ""
    for name, values in lists.items():
        cells = "".join(f"<rdf:li>{value:.12g}</rdf:li>" for value in values)
        tags += f"<avm:Spatial.{name}><rdf:Seq>{cells}</rdf:Seq></avm:Spatial.{name}>\n"
    from html import escape  # 2 ms, and a solve exports nothing

    text = _AVM.format(
        credit=escape(credit),
        quality="Full" if worst_px <= _FULL_PX else "Position",
        rotation=-np.degrees(np.angle(slope)),
        lists=tags,
        worst_px=worst_px,
    )
    return text.encode("utf-8")
