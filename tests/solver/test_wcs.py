"""The WCS that astropy reads back is our own projection, wherever the camera points."""

import re
import shutil
import subprocess
import warnings

import numpy as np
import pytest
from astropy.io import fits
from astropy.wcs import WCS
from hypothesis import given, settings
from hypothesis import strategies as st

from kochab.core.attitude import attitude_from, unit_vectors
from kochab.core.camera import Camera, FisheyeCamera
from kochab.core.errors import FrameError
from kochab.core.solution import Solution
from kochab.core.wcs import wcs_cards
from kochab.frames.wcs import wcs_text, write_solved_copy, write_wcs

WIDTH, HEIGHT = 1200, 800


def solution(ra, dec, roll, fov_deg, mirrored=False, offset=(0.0, 0.0), **lens):
    focal = WIDTH / (2 * np.tan(np.radians(fov_deg) / 2))
    camera = Camera(
        WIDTH, HEIGHT, focal, (WIDTH - 1) / 2 + offset[0], (HEIGHT - 1) / 2 + offset[1], mirrored=mirrored, **lens
    )
    return Solution(camera, attitude_from(ra, dec, roll), (), 0.3, -30.0, "test")


def grid():
    x, y = np.meshgrid(np.linspace(-0.5, WIDTH - 0.5, 13), np.linspace(-0.5, HEIGHT - 0.5, 11))
    return np.stack([x.ravel(), y.ravel()], axis=-1)


def header_of(answer):
    return fits.Header([*wcs_cards(answer.camera, answer.attitude)])


def disagreement_px(answer, header):
    """Worst distance, on the sky in pixels at the centre, between astropy's and our directions."""
    pixels = grid()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        ra, dec = WCS(header).all_pix2world(pixels[:, 0], pixels[:, 1], 0)
    theirs, ours = unit_vectors(ra, dec), answer.sky_at(pixels)
    return float(np.linalg.norm(theirs - ours, axis=1).max() * answer.camera.focal_px)


@settings(max_examples=20, deadline=None)
@given(
    ra=st.floats(0, 360),
    dec=st.one_of(st.floats(-90, 90), st.sampled_from([90.0, -90.0, 89.9999, -89.99])),
    roll=st.floats(-180, 180),
    fov=st.floats(0.3, 60),
    mirrored=st.booleans(),
    offset=st.tuples(st.floats(-60, 60), st.floats(-60, 60)),
    corner_shift=st.floats(-0.04, 0.04),
    p1=st.floats(-0.002, 0.002),
    p2=st.floats(-0.002, 0.002),
)
def test_astropy_agrees_with_our_projection(ra, dec, roll, fov, mirrored, offset, corner_shift, p1, p2):
    # k1 is chosen by what it does at the edge, so that narrow fields are distorted as well
    k1 = corner_shift / np.tan(np.radians(fov) / 2) ** 2
    answer = solution(ra, dec, roll, fov, mirrored, offset, k1=k1, p1=p1, p2=p2)
    assert disagreement_px(answer, header_of(answer)) < 0.1


@pytest.mark.parametrize("corner_shift", [-0.02, -0.01, -0.005, 0.002, 0.004, 0.008, 0.016, 0.03])
def test_the_polynomials_are_of_the_lowest_order_that_is_good_to_a_two_hundredth_of_a_pixel(corner_shift):
    k1 = corner_shift / np.tan(np.radians(20.0)) ** 2
    header = header_of(answer := solution(83.8, -5.4, 33.0, 40.0, k1=k1))
    assert 3 <= header["A_ORDER"] < 9
    assert disagreement_px(answer, header) < 0.005


@pytest.mark.parametrize("mirrored", [False, True])
def test_sky_to_pixels_inverts_distortion(mirrored):
    answer = solution(83.8, -5.4, 33.0, 40.0, mirrored, (12.0, -7.0), k1=-0.2, k2=0.05, p1=1e-3)
    pixels = grid()
    header = answer.wcs
    ra, dec = header.all_pix2world(pixels[:, 0], pixels[:, 1], 0)
    foc = header.wcs_world2pix(ra, dec, 0)
    # the polynomials take offsets from the reference point
    offsets = np.array(foc) + 1.0 - header.wcs.crpix[:, None]
    back = header.sip_foc2pix(*offsets, 1)
    np.testing.assert_allclose(np.transpose(back) - 1.0, pixels, atol=0.1)


@pytest.mark.parametrize("lens", [{}, {"k1": -0.03, "k2": 0.004}, {"k1": 0.083, "k2": 0.008, "p1": 2e-3}])
@pytest.mark.parametrize("mirrored", [False, True])
def test_a_whole_sky_is_read_back_by_astropy(mirrored, lens):
    """1,200 px of a lens that shows 180 deg down the frame; ARC of paper II is the projection without distortion."""
    camera = FisheyeCamera(WIDTH, HEIGHT, HEIGHT / np.pi, 603.0, 395.0, mirrored=mirrored, **lens)
    answer = Solution(camera, attitude_from(200.0, 51.0, 33.0), (), 0.3, -30.0, "test")
    header = header_of(answer)
    assert header["CTYPE1"].startswith("RA---ARC")
    pixels = grid()
    pixels = pixels[np.hypot(*(pixels - [603.0, 395.0]).T) < HEIGHT / 2]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        ra, dec = WCS(header).all_pix2world(pixels[:, 0], pixels[:, 1], 0)
    off = np.linalg.norm(unit_vectors(ra, dec) - answer.sky_at(pixels), axis=1) * camera.focal_px
    assert off.max() < 0.3


@pytest.mark.parametrize(
    "camera",
    [
        FisheyeCamera(2832, 2832, 970.9, 1416.5, 1439.7, -0.0323, -0.00444, 9.4e-5, 9.6e-5),
        FisheyeCamera(3040, 3040, 1015.2, 1503.9, 1527.9, -0.0218, -0.00528, 2.3e-4, 2.1e-4),
        FisheyeCamera(2800, 2800, 960.0, 1410.0, 1430.0, -0.03, -0.006),
    ],
)
def test_a_whole_sky_of_a_large_sensor_is_read_back_to_the_horizon(camera):
    """Lenses of two real pictures: polynomials to 100 deg were 0.4 px off within 75."""
    answer = Solution(camera, attitude_from(35.0, 78.0, 33.0), (), 0.3, -30.0, "test")
    pixels = np.random.default_rng(1).uniform(0.0, camera.width - 1.0, (6000, 2))
    rays = camera.unproject(pixels)
    shown = (rays[:, 2] > 0.0) & (np.hypot(*(camera.project(rays) - pixels).T) < 0.01)  # the corners show no sky
    pixels = pixels[shown]
    ra, dec = answer.wcs.all_pix2world(pixels[:, 0], pixels[:, 1], 0)
    seen = answer.camera.project(unit_vectors(ra, dec) @ answer.attitude.matrix.T)
    assert np.hypot(*(seen - pixels).T).max() < 0.3


def test_an_ideal_lens_needs_no_sip():
    header = header_of(solution(10, 20, 30, 5))
    assert header["CTYPE1"] == "RA---TAN"
    assert not [k for k in header if k.startswith(("A_", "AP_"))]


def test_north_is_up_and_east_left_at_roll_zero():
    header = header_of(solution(100, 20, 0, 5))
    assert header["CD1_1"] < 0
    assert header["CD2_2"] < 0  # rows grow downwards
    assert abs(header["CD1_2"]) < 1e-12
    assert header_of(solution(100, 20, 0, 5, mirrored=True))["CD1_1"] > 0


@pytest.mark.filterwarnings("ignore:.*more axes:astropy.wcs.FITSFixedWarning")  # it has no image
def test_wcs_file_is_one_card_a_line_and_fits_at_once(tmp_path):
    answer = solution(310.36, 45.28, -71, 12, True, k1=0.05)
    path = tmp_path / "deneb.wcs"
    write_wcs(answer, path)
    lines = path.read_text("ascii").splitlines()
    assert {len(line) for line in lines[:-1]} == {79}
    assert lines[-1].strip() == "END"
    assert path.stat().st_size % 2880 == 0
    for header in (fits.Header.fromtextfile(path), fits.getheader(path), fits.Header.fromfile(path)):
        assert header["IMAGEW"] == WIDTH
        assert disagreement_px(answer, header) < 0.1
    assert WCS(str(path)).has_celestial
    assert wcs_text(answer) == path.read_text("ascii")


@pytest.mark.skipif(shutil.which("wcs-xy2rd") is None, reason="astrometry.net is not installed")
@pytest.mark.parametrize("mirrored", [False, True])
def test_astrometry_net_reads_the_wcs_file_as_its_own(tmp_path, mirrored):
    camera = Camera(1280, 960, 3000.0, 650.0, 470.0, k1=-0.05, mirrored=mirrored)
    answer = Solution(camera, attitude_from(84.0, -3.0, 20.0), (), 0.2, -30.0, "")
    write_wcs(answer, tmp_path / "a.wcs")
    for x, y in ((0.0, 0.0), (1279.0, 959.0), (300.0, 800.0)):
        place = ["-x", f"{x + 1.0}", "-y", f"{y + 1.0}"]
        told = subprocess.run(
            ["wcs-xy2rd", "-w", tmp_path / "a.wcs", *place], capture_output=True, text=True, check=True
        )
        ra, dec = map(float, re.findall(r"[-\d.]+", told.stdout.split("RA,Dec")[1]))
        off = np.linalg.norm(unit_vectors(ra, dec) - answer.sky_at(np.array([[x, y]]))[0])
        assert off * camera.focal_px < 0.01


def test_wcs_file_that_cannot_be_written_raises(tmp_path):
    with pytest.raises(OSError, match="No such file"):
        write_wcs(solution(1, 2, 3, 4), tmp_path / "absent" / "a.wcs")


@pytest.mark.parametrize("compressed", [False, True])
def test_solved_copy_keeps_data_and_replaces_the_old_wcs(tmp_path, compressed):
    data = np.arange(WIDTH * HEIGHT, dtype=np.uint16).reshape(HEIGHT, WIDTH)
    old = {
        "CTYPE1": "RA---TAN",
        "CTYPE2": "DEC--TAN",
        "CDELT1": 1.0,
        "CROTA2": 12.0,
        "A_ORDER": 2,
        "A_2_0": 0.5,
        "OBJECT": "Deneb",
    }
    hdu = fits.CompImageHDU(data) if compressed else fits.PrimaryHDU(data)
    hdu.header.update(old)
    hdus = fits.HDUList([fits.PrimaryHDU(), hdu]) if compressed else fits.HDUList([hdu])
    source, target = tmp_path / "in.fits", tmp_path / "out.fits"
    hdus.writeto(source)
    before = source.read_bytes()
    answer = solution(310.36, 45.28, -71, 12)
    write_solved_copy(answer, source, target)
    assert source.read_bytes() == before
    with fits.open(target) as copy:
        image = copy[1 if compressed else 0]
        np.testing.assert_array_equal(image.data, data)
        assert image.header["OBJECT"] == "Deneb"
        assert not {"CDELT1", "CROTA2", "A_ORDER", "A_2_0"} & set(image.header)
        assert disagreement_px(answer, image.header) < 0.1
    assert sorted(p.name for p in tmp_path.iterdir()) == ["in.fits", "out.fits"]


def test_solved_copy_may_replace_its_source_and_refuses_what_is_not_fits(tmp_path):
    answer = solution(310.36, 45.28, -71, 12)
    path = tmp_path / "a.fits"
    fits.PrimaryHDU(np.zeros((HEIGHT, WIDTH), np.float32)).writeto(path)
    write_solved_copy(answer, path, path)
    assert fits.getheader(path)["PLTSOLVD"] is True
    text = tmp_path / "text.fits"
    text.write_text("not a picture")
    with pytest.raises(FrameError):
        write_solved_copy(answer, text, tmp_path / "b.fits")
    assert not (tmp_path / "b.fits").exists()


def test_a_lens_that_folds_its_corners_back_is_right_where_it_is_not_folded():
    answer = solution(50, -20, 20, 60, k1=-0.4)
    pixels = grid()
    camera = answer.camera
    with np.errstate(invalid="ignore"):
        back = camera.project(camera.unproject(pixels))
        seen = np.abs(back - pixels).max(axis=1) < 0.01
    assert 0 < np.count_nonzero(~seen) < len(seen) // 2  # the corners are beyond the fold
    ra, dec = answer.wcs.all_pix2world(*pixels[seen].T, 0)
    off = np.linalg.norm(unit_vectors(ra, dec) - answer.sky_at(pixels[seen]), axis=1)
    inner = np.hypot(*(pixels[seen] - [599.5, 399.5]).T) < 450
    assert off[inner].max() * camera.focal_px < 2.0  # without leaving them out: 50 px


def test_a_table_of_absurd_width_is_copied_unread(tmp_path, monkeypatch):
    table = fits.BinTableHDU.from_columns([fits.Column("n", "J", array=np.arange(9))])
    path = tmp_path / "a.fits"
    fits.HDUList([fits.PrimaryHDU(np.zeros((40, 50), np.int16)), table]).writeto(path)
    raw = path.read_bytes()
    start = raw.index(b"TFIELDS = ")
    path.write_bytes(raw[:start] + b"TFIELDS =            300000000" + raw[start + 30 :])
    monkeypatch.setattr(fits, "open", None)  # it would never return
    table_bytes = path.read_bytes()[path.read_bytes().index(b"XTENSION") :]
    write_solved_copy(solution(10.0, 20.0, 0.0, 5.0), path, path)
    assert path.read_bytes().endswith(table_bytes)
