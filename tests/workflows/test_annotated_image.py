"""The shared picture: the file's own colours in full size, and the sky where it belongs."""

import re
import xml.etree.ElementTree as ET
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest
from PIL import Image

from kochab.core.attitude import attitude_from, radec_deg, unit_vectors, wrapped
from kochab.core.camera import Camera
from kochab.core.errors import KochabError
from kochab.core.frame import Frame, Hint, Site
from kochab.core.solution import NamedStar, Solution
from kochab.frames.sky_grid import grid_lines
from kochab.sky.horizon import Horizon
from kochab.sky.layer import MARKS, Layers, in_frame
from kochab.sky.sky_tables import sky_tables
from kochab.sky.small_bodies import shipped_small_bodies
from kochab.window.themes import THEMES
from kochab.workflows.annotated_image import (
    CREDIT,
    INKS,
    USUAL,
    annotate,
    annotated_picture,
    as_svg,
    dated_drawing,
    doubled,
    drawing_of,
    font_of,
    picture_of,
    write_stellarium,
)


def solution(ra=84.0, dec=-3.0, roll=20.0, fov_deg=10.0, mirrored=False, size=(1280, 960)):
    camera = Camera.centred(*size, size[0] / 2 / np.tan(np.radians(fov_deg) / 2), mirrored)
    return Solution(camera, attitude_from(ra, dec, roll), (), 0.2, -30.0, "test")


def rgb(size=(1280, 960)):
    """An eight-bit picture of three different skies."""
    return np.random.default_rng(1).integers(0, (90, 40, 60), (size[1], size[0], 3)).astype(np.uint8)


def test_a_dated_frame_has_its_planets_named():
    frame = Frame(np.zeros((960, 1280), np.uint8), hint=Hint(time_utc=datetime(2023, 11, 3, 22, 0, tzinfo=UTC)))
    picture = solution(39.9, 14.0)  # Jupiter at its opposition of 2023 (Astronomical Almanac: 2h 38m, +13.8)
    picture = replace(picture, stars=(NamedStar(1.0, 1.0, "", "", 6.0, 0.0, 0.0, 0.0),))
    assert ">Jupiter<" in as_svg(frame, dated_drawing(frame, picture))
    assert ">Jupiter<" not in as_svg(frame, dated_drawing(replace(frame, hint=Hint()), picture))


def test_a_finished_picture_keeps_its_colours_and_its_size():
    colour = rgb()
    frame = Frame(colour.mean(axis=2).astype(np.uint8), colour=colour)
    assert np.array_equal(np.asarray(picture_of(frame)), colour)
    drawn = np.asarray(annotated_picture(frame, drawing_of(solution())))
    assert drawn.shape == colour.shape
    assert 0.6 < (drawn == colour).all(axis=2).mean() < 0.999  # all but what is drawn


def test_other_colours_share_one_stretch():
    colour = rgb().astype(np.uint16) * 40
    levels = np.asarray(picture_of(Frame(colour.mean(axis=2).astype(np.uint16), colour=colour))).astype(int)
    same = (colour[..., 0] == colour[..., 1]) & (colour[..., 0] > 0)
    assert (levels[same][:, 0] == levels[same][:, 1]).all()
    assert np.median(levels[..., 0]) > np.median(levels[..., 1])  # not made grey


def test_a_mosaic_is_shown_in_full_size():
    mosaic = np.random.default_rng(2).integers(100, 200, (960, 1280)).astype(np.uint16)
    assert picture_of(Frame(mosaic, bayer="RGGB")).size == (1280, 960)


def test_names_are_those_of_the_sky_with_greek_letters_and_credit():
    words = {text: place for place, text, _ in drawing_of(solution()).words}
    assert {"M 42 Orion Nebula", "\N{GREEK SMALL LETTER IOTA} Ori", "Alnilam", CREDIT, "N", "E"} <= {*words}
    assert not [text for text in words if text.startswith(("HIP", "HD", "J0"))]


@pytest.mark.parametrize(
    ("name", "kind"), [("a.png", "PNG"), ("a.jpg", "JPEG"), ("a.JPEG", "JPEG"), ("a.tif", "TIFF"), ("a", "PNG")]
)
def test_the_name_says_the_format(tmp_path, name, kind):
    annotate(Frame(rgb()[..., 0]), solution(), tmp_path / name)
    with Image.open(tmp_path / name) as picture:
        assert picture.format == kind
        assert picture.size == (1280, 960)


TILTED = {"k1": -0.05, "cx": 700.0, "cy": 420.0}


# What pyavm says of a TIFF, which it searches for the packet, and of a file it reads twice.
@pytest.mark.filterwarnings("ignore:Only PNG and JPEG files can be properly parsed")
@pytest.mark.parametrize("name", ["a.png", "a.jpg", "a.tif"])
@pytest.mark.parametrize(
    ("answer", "off_px", "quality"),
    [
        (solution(84.0, -3.0, roll=20.0), 0.01, "Full"),
        (solution(359.9, 88.0, roll=-110.0, fov_deg=3.0), 0.01, "Full"),
        (solution(84.0, -3.0, roll=200.0, fov_deg=20.0), 5.0, "Position"),
    ],
    ids=["Orion", "pole", "distorted"],
)
def test_tags_place_the_picture_where_another_reader_has_it(tmp_path, name, answer, off_px, quality):
    """pyavm, of astropy's people, and the map that it makes of the tags."""
    if quality == "Position":
        answer = replace(answer, camera=replace(answer.camera, **TILTED))
    annotate(Frame(rgb()[..., 0]), answer, tmp_path / name)
    tags = pytest.importorskip("pyavm").AVM.from_image(str(tmp_path / name))
    assert (tags.Spatial.CoordinateFrame, tags.Spatial.Quality) == ("ICRS", quality)
    assert tags.Spatial.ReferenceDimension == [1280.0, 960.0]
    assert tags.Credit == CREDIT
    assert str(tags.Type) == "Observation"
    pixels = np.array([[0.0, 0.0], [1279.0, 0.0], [0.0, 959.0], [1279.0, 959.0], [639.5, 479.5], [200.0, 700.0]])
    upwards = np.column_stack([pixels[:, 0], 959.0 - pixels[:, 1]])  # the standard's first row is the lowest
    there = unit_vectors(*tags.to_wcs().all_pix2world(upwards, 0).T)
    off = np.linalg.norm(there - answer.sky_at(pixels), axis=1) * answer.camera.focal_px
    assert off.max() < off_px
    told = float(re.search(r"up to ([\d.]+) px", str(tags.Spatial.Notes))[1])
    assert off.max() < 1.3 * told + 0.06
    assert off.max() > 0.5 * told - 0.06


def test_a_small_frame_is_written_twice_as_large_and_stays_where_it_was(tmp_path):
    """At 400 px letters of 9 px hid what they named. The sky and the tags follow the pixels, through a lens with k1."""
    answer = solution(84.0, -3.0, roll=20.0, size=(400, 300))
    answer = replace(answer, camera=replace(answer.camera, k1=-0.05, cx=220.0))
    twice = doubled(answer)
    places = np.array([[0.0, 0.0], [399.0, 0.0], [12.5, 280.0], [199.5, 149.5]])
    assert twice.sky_at(2.0 * places + 0.5) == pytest.approx(answer.sky_at(places), abs=1e-12)
    annotate(Frame(rgb((400, 300))[..., 0]), answer, tmp_path / "a.png")
    with Image.open(tmp_path / "a.png") as picture:
        assert picture.size == (800, 600)
    tags = pytest.importorskip("pyavm").AVM.from_image(str(tmp_path / "a.png"))
    assert tags.Spatial.ReferenceDimension == [800.0, 600.0]
    there = unit_vectors(*tags.to_wcs().all_pix2world([[399.5, 299.5]], 0).T)
    assert np.degrees(np.linalg.norm(there - answer.sky_at(np.array([[199.5, 149.5]])))) < 0.05


@pytest.mark.parametrize("answer", [solution(mirrored=True), solution(fov_deg=165.0)], ids=["mirrored", "all sky"])
def test_what_the_tags_have_no_words_for_is_not_told(tmp_path, answer):
    annotate(Frame(rgb()[..., 0]), answer, tmp_path / "a.jpg")
    assert b"avm" not in (tmp_path / "a.jpg").read_bytes()


def test_pdf_and_svg(tmp_path):
    frame = Frame(rgb()[..., 0])
    annotate(frame, solution(), tmp_path / "a.pdf")
    assert (tmp_path / "a.pdf").read_bytes()[:5] == b"%PDF-"
    annotate(frame, solution(), tmp_path / "a.svg")
    root = ET.parse(tmp_path / "a.svg").getroot()  # our own
    texts = [node.text for node in root.iter("{http://www.w3.org/2000/svg}text")]
    assert "M 42 Orion Nebula" in texts
    assert len(list(root.iter("{http://www.w3.org/2000/svg}polyline"))) > 10


@pytest.mark.parametrize("mirrored", [False, True])
def test_a_script_for_stellarium_has_the_corners_of_the_picture(tmp_path, mirrored):
    """In Stellarium's own list M 1's picture, north up, begins in the south-east and goes on to the south-west."""
    answer = solution(roll=0.0, mirrored=mirrored)
    write_stellarium(Frame(rgb()[..., 0], colour=rgb()), answer, tmp_path / "a.ssc")
    told = (tmp_path / "a.ssc").read_text("utf-8")
    numbers = re.search(r'loadSkyImage\("a.png", "a.png", ([^;]*), 2.5, 14, true\);', told)[1]
    corners = np.array(numbers.split(","), dtype=float).reshape(4, 2)
    right, low = 1279.5, 959.5
    theirs = answer.wcs.all_pix2world([[-0.5, low], [right, low], [right, -0.5], [-0.5, -0.5]], 0)
    assert corners == pytest.approx(theirs, abs=1e-5)
    (first_ra, first_dec), (next_ra, _), (_, last_dec) = corners[0], corners[1], corners[3]
    assert first_dec < last_dec
    assert (first_ra > next_ra) is not mirrored
    assert 'core.moveToRaDecJ2000("84.000000d", "-3.000000d", 1);' in told
    with Image.open(tmp_path / "a.png") as picture:
        assert picture.size == (1280, 960)
    with pytest.raises(KochabError, match="wider than 20°"):
        write_stellarium(Frame(rgb()[..., 0], colour=rgb()), solution(fov_deg=30.0), tmp_path / "b.ssc")


def test_what_cannot_be_written_raises(tmp_path):
    with pytest.raises(OSError, match="No such file"):
        annotate(Frame(rgb()[..., 0]), solution(), tmp_path / "absent" / "a.png")


@pytest.mark.parametrize(("dec", "fov"), [(0.0, 1.0), (38.8, 10.0), (88.0, 60.0)])
@pytest.mark.parametrize("mirrored", [False, True])
def test_the_grid_shows_round_right_ascensions_and_declinations(dec, fov, mirrored):
    answer = solution(83.0, dec, 20.0, fov, mirrored)
    places = np.concatenate([xy for xy, ink, _ in drawing_of(answer).strokes if ink[:7] == INKS["grid"]])
    wanted = {kind: [] for kind in ("ra", "dec")}
    for line in grid_lines(answer, -0.5, -0.5, 1279.5, 959.5):
        wanted[line.kind].append(line.value_deg)
    ras, decs = np.array([radec_deg(v) for v in answer.sky_at(places)]).T
    from_ra = np.abs(wrapped(ras[:, None] - wanted["ra"])).min(axis=1) * np.cos(np.radians(decs))
    from_dec = np.abs(decs[:, None] - wanted["dec"]).min(axis=1)
    assert np.minimum(from_ra, from_dec).max() < answer.camera.scale_arcsec_px / 3600.0


def test_the_colours_are_those_of_the_window():
    assert {name: getattr(THEMES["dark"], name) for name in INKS} == INKS


def test_what_is_off_is_not_drawn_and_the_colour_is_the_chosen_one():
    answer, everything = solution(60.0, 20.0, fov_deg=60.0), Layers(dict.fromkeys(MARKS, True))
    evening = Horizon(Site(50.0, 8.0), datetime(2026, 1, 15, 22, 0, tzinfo=UTC))
    answer = replace(answer, stars=(NamedStar(99.0, 99.0, "", "", 6.0, 0.0, 0.0, 0.0),))
    found = np.array([[700.0, 500.0]])

    def inks(layers):
        drawn = drawing_of(answer, layers=layers, horizon=evening, detected=found)
        return {ink[:7] for _, ink, _ in drawn.strokes} | {ink for *_, ink in drawn.words}

    own = drawing_of(answer, layers=everything, detected=answer.stars_px).strokes
    assert INKS["detected"] not in {ink[:7] for _, ink, _ in own}  # an identified star has its own circle
    colours = {layer: f"#1234{k:02x}" for k, layer in enumerate(sorted({*MARKS} - {"bodies", "compass"}))}
    assert not set(colours.values()) & inks(everything)
    assert set(colours.values()) <= inks(replace(everything, colour=colours))
    for layer in colours:
        off = replace(everything, on=everything.on | {layer: False}, colour={layer: "#123456"})
        assert "#123456" not in inks(off), layer
    assert inks(Layers(dict.fromkeys(MARKS, False))) == {INKS["dark"]}  # the credit


def test_lines_are_as_strong_as_in_the_window():
    layers = Layers(dict.fromkeys(MARKS, False) | {"grid": True})
    for amount, strength in ((0.5, "55"), (1.0, "ff")):
        layers.amount["grid"] = amount
        assert {ink for _, ink, _ in drawing_of(solution(), layers=layers).strokes} == {INKS["grid"] + strength}
    layers.amount["grid"] = 0.5
    lines = drawing_of(solution(), layers=layers)
    lines.words.clear()
    drawn = np.asarray(annotated_picture(Frame(np.zeros((960, 1280), np.uint8)), lines))
    colours, counts = np.unique(drawn[drawn.any(axis=2)], axis=0, return_counts=True)
    assert (colours <= (45, 56, 68)).all()  # a third, where two lines cross, too
    assert colours[counts.argmax()].tolist() == [45, 56, 68]


def test_the_horizon_is_drawn_where_and_when_the_frame_says_so():
    hint = Hint(time_utc=datetime(2026, 1, 15, 22, 0, tzinfo=UTC), site=Site(50.0, 8.0))
    layers = replace(USUAL, on=USUAL.on | {"altaz": True})

    def texts(hint):
        frame = Frame(np.zeros((960, 1280), np.uint8), hint=hint)
        return [text for _, text, _ in dated_drawing(frame, solution(), layers=layers).words]

    told = texts(hint)
    assert [text for text in told if text.startswith("alt +3")]  # Orion's belt stands at 38 degrees
    assert [text for text in told if text.startswith("az 1")]
    for less in (replace(hint, site=None), replace(hint, time_utc=None), replace(hint, time_of_file=True)):
        assert not [text for text in texts(less) if text.startswith(("alt ", "az "))]


@pytest.mark.parametrize(("ra", "dec", "name"), [(60.0, 20.0, "Ecliptic"), (84.0, 29.0, "Galactic equator")])
def test_a_circle_of_the_sky_is_named_once_and_on_itself(ra, dec, name):
    picture = solution(ra, dec, fov_deg=20.0)
    on = dict.fromkeys(MARKS, False) | {"ecliptic": True, "galactic": True}
    drawn = drawing_of(picture, layers=Layers(on))
    (place,) = [place for place, text, _ in drawn.words if text == name]
    ink = INKS["ecliptic" if name == "Ecliptic" else "galaxy"]
    line = np.concatenate([xy for xy, of, _ in drawn.strokes if of[:7] == ink])
    dense = np.column_stack([np.interp(np.linspace(0, 1, 500), np.linspace(0, 1, len(line)), side) for side in line.T])
    assert np.hypot(*(dense - place).T).min() < 3.0 * drawn.letter
    assert not [text for _, text, _ in drawing_of(picture).words if text == name]  # while it is off


def test_values_of_a_grid_stand_free_of_names_and_the_credit():
    letter = drawing_of(solution()).letter
    font = font_of(letter)
    for ra, dec, fov in [(84.0, -3.0, 10.0), (187.7, 12.4, 15.0), (266.4, -29.0, 40.0)]:
        words = drawing_of(
            solution(ra, dec, fov_deg=fov), layers=replace(USUAL, on=USUAL.on | {"compass": False})
        ).words
        boxes = [(x, y, x + font.getbbox(text)[2], y + font.getbbox(text)[3]) for (x, y), text, _ in words]
        assert [1 for _, text, _ in words if text.endswith("°")]
        for k, one in enumerate(boxes):
            for other in boxes[:k]:
                assert one[0] >= other[2] or other[0] >= one[2] or one[1] >= other[3] or other[1] >= one[3]


BARE = Frame(np.zeros((960, 1280), np.uint8))


def test_fast_stars_are_named_where_they_are_when_the_frame_was_taken():
    """Barnard's star runs 10.4 arcsec a year to the north (Hipparcos): here 2.6 px from 2000 to 2025."""
    answer = solution(269.45, 4.7, roll=0.0, fov_deg=128.0 / 3600.0 * 10.0)
    frame = Frame(np.zeros((960, 1280), np.uint8), hint=Hint(time_utc=datetime(2025, 1, 1, tzinfo=UTC)))
    tables = sky_tables()
    fastest = int(np.argmax(np.linalg.norm(tables.stars.step, axis=1)))
    marks = [next(m for m in in_frame(tables, answer, year).marks if m.row == fastest) for year in (2000.0, 2025.0)]
    assert (marks[0].xy - marks[1].xy)[1] * answer.camera.scale_arcsec_px == pytest.approx(259.0, abs=3.0)
    words = [
        {text: place for place, text, _ in drawn.words} for drawn in (dated_drawing(frame, answer), drawing_of(answer))
    ]
    name = marks[0].text
    assert words[1][name][1] - words[0][name][1] == pytest.approx((marks[0].xy - marks[1].xy)[1], abs=1.0)


@pytest.mark.parametrize("name", ["a.png", "a.svg"])
def test_the_bodies_of_the_persons_elements_are_looked_for(name, tmp_path, monkeypatch):
    asked = []

    def marks(frame, solution, site=None, more=()):
        asked.append(more)
        return ()
        yield

    monkeypatch.setattr("kochab.workflows.annotated_image.body_marks", marks)
    table = shipped_small_bodies()
    annotate(Frame(rgb()[..., 0]), solution(), tmp_path / name, [table])
    assert asked == [[table]]


@pytest.mark.parametrize("roll_deg", [-170.0, -90.0, -45.0, 0.0, 30.0, 90.0, 135.0])
@pytest.mark.parametrize("width", [480, 1280])
def test_the_compass_stays_in_the_frame_and_off_every_name_and_the_credit(roll_deg, width):
    """It touched the frame's edge, names and the credit line where an arrow pointed up or down."""
    focal = width / 2.0 / np.tan(np.radians(20.0))
    camera = Camera.centred(width, width, float(focal))
    made = drawing_of(Solution(camera, attitude_from(84.0, 0.0, roll_deg), (), 0.2, -30.0, ""))

    def box(word):
        (x, y), text, _ = word
        left, top, right, bottom = font_of(made.letter).getbbox(text)
        return x + left, y + top, x + right, y + bottom

    arrows = [word for word in made.words if word[1] in ("N", "E")]
    others = [word for word in made.words if word not in arrows]
    assert len(arrows) == 2
    for a, b, c, d in map(box, arrows):
        assert a >= 0.0
        assert d <= width
        for u, v, w, h in map(box, others):
            assert not (a < w and u < c and b < h and v < d)
