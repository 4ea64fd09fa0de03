"""The sky layer beside astrometry.net's annotator, which draws the pictures of nova.astrometry.net: nothing is missing."""

import json
import shutil
import subprocess

import numpy as np
import pytest
from astropy.io import fits
from astropy.wcs import WCS

import kochab
from kochab.core.attitude import east_north, unit_vectors
from kochab.sky.layer import in_frame
from kochab.sky.sky_tables import sky_tables
from tests.patterns import REPOSITORY

FRAMES = REPOSITORY.parent / "shared" / "frames"
PICTURES = sorted((REPOSITORY / "resources" / "samples").glob("*.*")) + sorted(FRAMES.glob("*.*"))[::4]
KINDS = (".jpg", ".png", ".fits", ".fit", ".tif", ".tiff")
STAR_ARCSEC, OBJECT_ARCSEC, STAR_PX = 60.0, 300.0, 3.0
EXCUSED = {"NGC 7772"}  # no object, says OpenNGC, whose type "Other" the sky layer leaves out


def annotations(solution, folder):
    """Names and ICRS vectors of what astrometry.net draws in a frame without distortion, whose map never folds."""
    width, height = solution.camera.width, solution.camera.height
    centre = np.array([(width - 1) / 2.0, (height - 1) / 2.0])
    sky = solution.sky_at(centre + np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]))
    plain = WCS(naxis=2)
    plain.wcs.ctype, plain.wcs.crpix, plain.wcs.crval = ["RA---TAN", "DEC--TAN"], centre + 1.0, solution.ra_dec_deg
    step = np.degrees(np.stack(east_north(sky[0])) @ (sky[1:] - sky[0]).T)
    plain.wcs.cd = step
    header = fits.Header({"CTYPE1": "RA---TAN", "CTYPE2": "DEC--TAN", "IMAGEW": width, "IMAGEH": height})
    for k in (0, 1):
        header[f"CRPIX{k + 1}"], header[f"CRVAL{k + 1}"] = float(centre[k] + 1.0), float(plain.wcs.crval[k])
        header[f"CD1_{k + 1}"], header[f"CD2_{k + 1}"] = float(step[0, k]), float(step[1, k])
    fits.PrimaryHDU(header=header).writeto(folder / "plain.wcs", overwrite=True)
    command = ["plot-constellations", "-w", folder / "plain.wcs", "-J", "-L", "-N", "-B"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    told = done.stdout + done.stderr
    for one in json.loads(told[told.index("{") : told.rindex("}") + 1])["annotations"]:
        at = plain.all_pix2world([[one["pixelx"] - 1.0, one["pixely"] - 1.0]], 0)[0]
        yield one["type"] == "star", set(one["names"]), unit_vectors(*at)


def missing(tables, solution, folder):
    """What of that the sky layer has not, or elsewhere; and how many stars and objects there were."""
    sky, scale = in_frame(tables, solution), solution.camera.scale_arcsec_px
    size, lost, counts = np.array([solution.camera.width, solution.camera.height]), [], [0, 0]
    for star, names, vector in annotations(solution, folder):
        at = solution.pixels_of(vector[None])[0]
        if not ((at > 5.0) & (at < size - 6.0)).all() or names & EXCUSED:
            continue
        counts[star] += 1
        reach = max(STAR_PX, (STAR_ARCSEC if star else OBJECT_ARCSEC) / scale)
        near = [mark for mark in sky.marks if np.hypot(*(mark.xy - at)) <= reach and (mark.kind == "star") == star]
        if star:
            found = bool(near)
        else:
            found = any(
                names & {*tables.objects.names(mark.row), *tables.objects.also[mark.row].split(",")} for mark in near
            )
        if not found:
            lost.append(min(names))
    return lost, counts


@pytest.mark.skipif(shutil.which("plot-constellations") is None, reason="astrometry.net is not installed")
def test_nothing_that_astrometry_net_names_is_missing(tmp_path):
    tables, lost, counts, frames = sky_tables(), {}, np.zeros(2, int), 0
    for picture in PICTURES:
        if picture.suffix.lower() not in KINDS:
            continue
        solution = kochab.solve(picture)
        if not isinstance(solution, kochab.Solution):
            continue
        gone, some = missing(tables, solution, tmp_path)
        wide = {
            name for name in gone if name == "Beehive" and max(solution.camera.fov_deg) < 1.5
        }  # larger than its frame
        frames, counts = frames + 1, counts + some
        if set(gone) - wide:
            lost[picture.name] = sorted(set(gone) - wide)
    print(f"{frames} frames, {counts[1]} stars, {counts[0]} objects")
    assert frames >= 5
    assert counts[1] > 30
    assert not lost
