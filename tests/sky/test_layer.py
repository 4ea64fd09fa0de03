"""The sky layer against the exact tangent projection and astropy's WCS, over frames of every width."""

import numpy as np
import pytest

from kochab.core.attitude import attitude_from
from kochab.core.camera import Camera
from kochab.core.errors import CatalogueError
from kochab.core.solution import Solution
from kochab.sky.layer import (
    GAP_PX,
    MOST,
    View,
    _spots,
    around_text,
    constellation_labels,
    faintest_of,
    in_frame,
    labels,
    outlined,
)
from kochab.sky.sky_tables import _chains, _variables, sky_tables

SIZE = (1500, 1000)
FRAMES = 150


def text_size(text):
    return 7.0 * len(text), 15.0


@pytest.fixture(scope="module")
def tables():
    return sky_tables()


def solution_at(ra, dec, roll=0.0, fov=4.5, k1=0.0, mirrored=False):
    """A frame ``fov`` degrees wide; ``k1`` is the share by which the corner is moved."""
    half = np.tan(np.radians(fov) / 2.0)
    focal = SIZE[0] / 2.0 / half
    corner2 = (SIZE[0] ** 2 + SIZE[1] ** 2) / 4.0 / focal**2
    middle = (SIZE[0] - 1) / 2.0, (SIZE[1] - 1) / 2.0
    camera = Camera(*SIZE, focal, *middle, k1 / corner2, mirrored=mirrored)
    return Solution(camera, attitude_from(ra, dec, roll), (), 0.2, -30.0, "test")


def random_frames(count, seed=17):
    """Frames of 0.1 to 60 degrees, and some whole-sky lenses, anywhere, with barrel and pincushion distortion."""
    rng = np.random.default_rng(seed)
    for number in range(count):
        fov = rng.uniform(90.0, 150.0) if number % 40 == 0 else 10.0 ** rng.uniform(-1.0, np.log10(60.0))
        ra, dec = rng.uniform(0.0, 360.0), np.degrees(np.arcsin(rng.uniform(-1.0, 1.0)))
        k1 = rng.uniform(-0.08, 0.08)
        yield solution_at(ra, dec, rng.uniform(-180, 180), fov, k1, bool(rng.random() < 0.5)), rng


def tangent_plane(solution, vectors):
    """Pixels by the textbook: spherical trigonometry about the optical axis, then the lens; no rotation matrix."""
    ra0, dec0 = np.radians(solution.attitude.ra_dec_deg)
    ra, dec = np.arctan2(vectors[:, 1], vectors[:, 0]), np.arcsin(np.clip(vectors[:, 2], -1.0, 1.0))
    depth = np.sin(dec0) * np.sin(dec) + np.cos(dec0) * np.cos(dec) * np.cos(ra - ra0)
    east = np.cos(dec) * np.sin(ra - ra0) / depth
    north = (np.cos(dec0) * np.sin(dec) - np.sin(dec0) * np.cos(dec) * np.cos(ra - ra0)) / depth
    roll, camera = np.radians(solution.attitude.roll_deg), solution.camera
    up, left = np.cos(roll) * north + np.sin(roll) * east, np.cos(roll) * east - np.sin(roll) * north
    bent = 1.0 + camera.k1 * (east**2 + north**2)
    x = camera.cx - (-1 if camera.mirrored else 1) * camera.focal_px * left * bent
    return np.column_stack([x, camera.cy - camera.focal_px * up * bent]), depth


def test_frames_of_every_size_have_no_name_over_another_and_no_object_out_of_place(tables):
    named = 0
    for solution, rng in random_frames(FRAMES):
        sky = in_frame(tables, solution)
        rows = {kind: [m for m in sky.marks if (m.kind == "star") == kind] for kind in (True, False)}
        for table, marks in ((tables.stars.vector, rows[True]), (tables.objects.vector, rows[False])):
            if marks:
                where, depth = tangent_plane(solution, table[[mark.row for mark in marks]])
                assert (depth > 0.0).all()
                assert np.abs(where - np.array([mark.xy for mark in marks])).max() < 1e-3
        scale = 10.0 ** rng.uniform(-0.5, 0.7)
        x, y = rng.uniform(0, SIZE[0]), rng.uniform(0, SIZE[1])
        view = View(scale, 600.0 - x * scale, 400.0 - y * scale, (0.0, 0.0, 1200.0, 800.0))
        amount = rng.uniform(0.2, 1.0)
        card = (20.0, 600.0, 400.0, 180.0)
        placed = labels(sky, view, faintest_of(view, solution, amount, amount), text_size, [card], amount)
        named += len(placed)
        boxes = np.array([card, *(label.box for label in placed)])
        low, high = boxes[:, :2], boxes[:, :2] + boxes[:, 2:]
        over = ((low[:, None] < high[None]) & (low[None] < high[:, None])).all(axis=2)
        assert over.sum() == len(boxes)  # each over itself alone
        assert (low >= 0.0).all()
        assert (high <= (1200.0, 800.0)).all()
        assert len({label.text for label in placed}) == len(placed)
    assert named > 3 * FRAMES


def test_nothing_of_the_frame_is_missing(tables):
    """Every object that the textbook puts into the frame is there, unless it is about as large as the frame."""
    for solution, _ in random_frames(60, seed=5):
        where, depth = tangent_plane(solution, tables.objects.vector)
        small = np.nan_to_num(tables.objects.major) / 60.0 < 0.2 * solution.camera.fov_deg[1]
        inside = (depth > 0.0) & small & np.isfinite(tables.ranks) & (where >= 0.0).all(axis=1)
        inside &= (where <= (SIZE[0] - 1, SIZE[1] - 1)).all(axis=1)
        turns = depth < 1.0 / np.sqrt(1.0 + 1.0 / max(-3.0 * solution.camera.k1, 1e-9))  # past the fold of a barrel
        expected = set(np.flatnonzero(inside & ~turns).tolist())
        found = {mark.row for mark in in_frame(tables, solution).marks if mark.kind != "star"}
        assert len(found) >= MOST - 1 or not expected - found  # the Gum Nebula is one of them, and too large to mark


def test_places_agree_with_astropy(tables):
    solution = solution_at(84.0, -2.5, 30.0, 6.0)
    marks = in_frame(tables, solution).marks
    stars = [mark for mark in marks if mark.kind == "star"]
    vectors = tables.stars.vector[[mark.row for mark in stars]]
    ra, dec = np.degrees(np.arctan2(vectors[:, 1], vectors[:, 0])), np.degrees(np.arcsin(vectors[:, 2]))
    x, y = solution.wcs.all_world2pix(ra, dec, 0)
    assert np.abs(np.column_stack([x, y]) - [mark.xy for mark in stars]).max() < 1e-3
    assert len(stars) > 15


def test_every_star_to_sixth_magnitude_can_be_marked_and_small_fields_have_numbers(tables, catalogue):
    """The deep list's stars to V 6 in forty fields of 10 degrees; in one degree of Lynx no star has a name."""
    rng = np.random.default_rng(4)
    wanted = 0
    for _ in range(40):
        solution = solution_at(rng.uniform(0, 360), np.degrees(np.arcsin(rng.uniform(-1, 1))), 0.0, 10.0)
        rows = catalogue.cone(solution.centre_vector, np.radians(4.0), 6.0)
        xy = solution.pixels_of(catalogue.vectors(rows, 2000.0))
        at = np.array([mark.xy for mark in in_frame(tables, solution, 2000.0).marks if mark.kind == "star"])
        gap = np.hypot(*(xy[:, None] - at[None]).transpose(2, 0, 1)).min(axis=1)
        inside = (xy > 0).all(axis=1) & (xy < SIZE).all(axis=1)
        wanted += int(inside.sum())
        assert gap[inside].max(initial=0.0) < 1.0  # px, 24 arcsec: the photocentre of a double
    assert wanted > 100
    first = in_frame(tables, solution_at(120.0, 45.0, 0.0, 1.0)).marks[0]
    assert first.text == "HD 65137"
    whole = View(1.0, 0.0, 0.0, (0.0, 0.0, *SIZE))
    assert first.mag <= faintest_of(whole, solution_at(120.0, 45.0, 0.0, 1.0))["star"]


def test_an_ellipse_has_its_axes_and_position_angle(tables):
    """M 31: 178 by 70 arcmin, the major axis 35 degrees east of north."""
    solution = solution_at(10.685, 41.269, 0.0, 6.0)
    m31 = next(mark for mark in in_frame(tables, solution).marks if mark.text.startswith("M 31 "))
    step = (m31.shapes[0] - m31.xy) * solution.camera.scale_arcsec_px / 60.0
    far = np.hypot(*step.T)
    assert far.max() * 2.0 == pytest.approx(177.83, rel=0.01)
    assert far.min() * 2.0 == pytest.approx(69.66, rel=0.01)
    left, down = -step[int(far.argmax())] * (1, -1)
    assert np.degrees(np.arctan2(left, -down)) % 180.0 == pytest.approx(35.0, abs=4.0)  # east is left, in steps of 7.5


@pytest.mark.parametrize(
    ("ra", "dec", "fov", "present"),
    [
        (83.8, -4.0, 12.0, ["M 42 Orion Nebula", "ι Ori", "NGC 2024 Flame Nebula", "Alnilam"]),
        (
            84.6,
            -2.75,
            4.5,
            ["B 33 Horsehead Nebula", "NGC 2024 Flame Nebula", "IC 434", "NGC 2023", "Alnitak", "σ Ori"],
        ),
        (10.7, 41.3, 4.0, ["M 31 Andromeda Galaxy", "M 32", "M 110"]),
        (56.9, 24.1, 8.0, ["M 45 Pleiades"]),
        (281.0, -20.0, 60.0, ["M 8", "M 22", "Nunki", "Antares"]),
        (344.5, 62.5, 2.0, ["C 9 Cave Nebula"]),
    ],
)
def test_what_everybody_looks_for_is_named(tables, ra, dec, fov, present):
    solution = solution_at(ra, dec, 10.0, fov)
    view = View(0.8, 0.0, 0.0, (0.0, 0.0, 1200.0, 800.0))
    placed = labels(in_frame(tables, solution), view, faintest_of(view, solution), text_size)
    texts = {label.text for label in placed}
    short = {label.mark.short for label in placed}
    assert not [name for name in present if name not in texts | short]
    assert not [text for text in texts if text.startswith(("J0", "HD "))]


def test_closer_shows_more_and_the_amount_too(tables):
    solution = solution_at(187.7, 12.4, 0.0, 10.0)
    sky = in_frame(tables, solution)
    counts = []
    for scale, amount in ((0.8, 0.2), (0.8, 0.5), (0.8, 0.9)):
        view = View(scale, 0.0, 0.0, (0.0, 0.0, 1200.0, 800.0))
        counts.append(len(labels(sky, view, faintest_of(view, solution, amount, amount), text_size, (), amount)))
    assert counts[0] < counts[1] < counts[2]
    far, near = (View(s, 600 - 750 * s, 400 - 500 * s, (0.0, 0.0, 1200.0, 800.0)) for s in (0.8, 3.0))
    assert faintest_of(near, solution)["object"] > faintest_of(far, solution)["object"]
    assert len(outlined(sky, near, {"object": 14.0})) > 5


def test_a_name_stands_beside_the_disc_of_its_star_however_close_one_looks(tables):
    solution = solution_at(83.6, -1.0, 0.0, 15.0)
    sky = in_frame(tables, solution)
    for scale in (0.8, 6.0):
        view = View(scale, 600 - 750 * scale, 400 - 500 * scale, (0.0, 0.0, 1200.0, 800.0))
        found = [one for one in labels(sky, view, faintest_of(view, solution), text_size) if one.mark.kind == "star"]
        assert found
        for label in found:
            x, y, width, height = label.box
            at = view.to_screen(label.mark.xy)
            apart = np.maximum(np.maximum((x, y) - at, at - (x + width, y + height)), 0.0)
            assert np.hypot(*apart) > max(5.0, 4.0 * scale) * 0.7


def test_a_name_may_stand_on_any_of_eight_sides_of_its_outline_and_touches_none():
    """Of a circle of 20 px: its box is a gap away from the nearest point, left, right, above, below and in the corners."""
    angle = np.radians(np.arange(360.0))
    circle, size = 20.0 * np.stack([np.cos(angle), np.sin(angle)], axis=1), np.array([50.0, 15.0])
    corners = np.array(list(_spots(circle, np.zeros(2), *size)))[:8]
    middles = corners + size / 2.0
    assert {tuple(np.sign(one.round(6)).astype(int)) for one in middles} == {
        (x, y) for x in (-1, 0, 1) for y in (-1, 0, 1) if x or y
    }
    gap = np.hypot(*np.maximum(np.abs(middles) - size / 2.0, 0.0).T) - 20.0
    assert np.all((gap > 0.99 * GAP_PX) & (gap < 1.5 * GAP_PX))
    x, y = np.sign(middles[0].round(6)).astype(int).tolist()
    assert (x, y) == (1, 0), "to the right of it first"


def test_lines_stay_on_the_sky_they_belong_to(tables):
    """Each place of the ecliptic and of the galactic equator is on its great circle; boundaries cross narrow frames."""
    poles = {"ecliptic": [0.0, -0.3977771, 0.9174821], "galactic": [-0.8676661, -0.1980764, 0.4559838]}
    found = dict.fromkeys(poles, 0)
    for solution, _ in random_frames(80, seed=9):
        lines = in_frame(tables, solution).lines
        for kind, pole in poles.items():
            for line in lines[kind]:
                assert np.abs(solution.sky_at(line) @ pole).max() < 1e-6
                found[kind] += 1
    assert min(found.values()) > 5
    for chain in tables.lines["boundaries"][::40]:
        middle = chain[0] + chain[1]
        ra, dec = (
            np.degrees(np.arctan2(middle[1], middle[0])),
            np.degrees(np.arcsin(middle[2] / np.linalg.norm(middle))),
        )
        narrow = in_frame(tables, solution_at(ra, dec, 0.0, 0.3)).lines["boundaries"]
        assert min(np.hypot(*(line - (749.5, 499.5)).T).min() for line in narrow) < 60.0


def test_fast_stars_move_with_the_years(tables):
    solution = solution_at(269.454, 4.668, 0.0, 0.5)
    then, now = (
        next(mark.xy for mark in in_frame(tables, solution, year).marks if "Barnard" in mark.text)
        for year in (2000, 2026)
    )
    moved = np.hypot(*(now - then)) * solution.camera.scale_arcsec_px
    assert moved == pytest.approx(26.0 * 10.39, rel=0.02)  # 10.39 arcsec a year


def test_outlines_are_closed_and_names_stand_beside_them(tables):
    """Stellarium's polylines end a side short: NGC 1432's 4.9 arcmin from where it begins."""
    assert len(tables.outlines) > 60
    for shapes in tables.outlines.values():
        assert all(np.array_equal(shape[0], shape[-1]) for shape in shapes)
    beside = 0
    for ra, dec, fov in [(84.05, -2.0, 6.0), (56.7, 24.1, 3.0), (314.0, 44.4, 8.0), (161.3, -59.9, 6.0)]:
        solution = solution_at(ra, dec, 0.0, fov)
        view = View(1.0, 0.0, 0.0, (0.0, 0.0, *map(float, SIZE)))
        for label in labels(in_frame(tables, solution), view, faintest_of(view, solution), text_size):
            x, y, width, height = label.box
            inside = np.hypot(*(np.array([x + width / 2.0, y + height / 2.0]) - label.mark.xy - 0.5)) < 1.0
            if label.mark.radius > 30.0 and label.mark.row in tables.outlines and not inside:
                places = np.concatenate(label.mark.shapes) + 0.5
                gap = np.maximum(
                    np.abs(places - (x + width / 2.0, y + height / 2.0)) - (width / 2.0, height / 2.0), 0.0
                )
                assert np.hypot(*gap.T).min() <= 1.5 * GAP_PX
                beside += 1
    assert beside >= 4


def test_every_outline_is_about_its_own_object(tables):
    """Stellarium has the Running Man's under a number of the Large Magellanic Cloud, 61 degrees away."""
    for row, shapes in tables.outlines.items():
        away = np.arccos(np.clip(np.vstack(shapes) @ tables.objects.vector[row], -1.0, 1.0))
        own = np.nan_to_num(
            np.radians(tables.objects.major[row] / 120.0)
        )  # the middle of Barnard's Loop is no part of it
        assert away.min() < max(np.ptp(away), np.radians(1.5), own), tables.texts[row]
    merope = tables.objects.name.tolist().index("IC 349")
    assert tables.objects.major[merope] < 1.0  # arcmin: not the 26 of NGC 1435 around it


def on_screen(tables, solution, amount=0.5):
    sky = in_frame(tables, solution)
    view = View(1.0, 0.0, 0.0, (4.0, 4.0, SIZE[0] - 4.0, SIZE[1] - 4.0))
    return sky, view, labels(sky, view, faintest_of(view, solution), text_size, amount=amount)


@pytest.mark.parametrize("fov", [10.0, 30.0, 60.0])
def test_stars_to_fourth_magnitude_are_named_however_wide_the_frame_is(tables, fov):
    """24 in 100 were, of frames of 30 degrees and more; names that find no room are left out."""
    rng, total, named = np.random.default_rng(1), 0, 0
    for _ in range(20):
        place = rng.uniform(0.0, 360.0), float(np.degrees(np.arcsin(rng.uniform(-1.0, 1.0))))
        sky, _, shown = on_screen(tables, solution_at(*place, rng.uniform(-180.0, 180.0), fov))
        bright = {m.row for m in sky.marks if m.kind == "star" and tables.stars.mag[m.row] < 4.0}
        total += len(bright)
        named += len(bright & {label.mark.row for label in shown if label.mark.kind == "star"})
    assert total > 15
    assert named > 0.88 * total


def test_figures_say_which_constellation_they_are(tables):
    """Half of Orion is enough; a field with one star of a figure has no name of it; none lies over another name."""
    sky, view, shown = on_screen(tables, solution_at(84.0, 0.0, 20.0, 35.0))
    boxes = [label.box for label in shown]
    found = dict(constellation_labels(sky, view, text_size, boxes))
    assert {"ORION", "LEPUS"} <= {*found}
    x, y, w, h = found["ORION"]
    assert not any(x < u + a and u < x + w and y < v + b and v < y + h for u, v, a, b in boxes)
    middle = np.array([x + w / 2.0, y + h / 2.0])
    orion = next(vectors for name, vectors in tables.constellations if name == "Orion")
    assert np.hypot(*(solution_at(84.0, 0.0, 20.0, 35.0).pixels_of(orion).mean(axis=0) - middle)) < 350.0
    assert in_frame(tables, solution_at(10.68, 41.27, 0.0, 2.0)).constellations == ()


def test_a_frame_within_an_object_says_so(tables):
    assert around_text(tables, solution_at(97.98, 4.94, 0.0, 0.4)) == "within Rosette Nebula"
    assert around_text(tables, solution_at(56.7, 24.1, 0.0, 0.3)) == "within Pleiades"
    assert around_text(tables, solution_at(10.68, 41.27, 0.0, 6.0)) == ""


def test_two_stars_that_are_one_on_the_screen_have_one_name(tables):
    """Alpha Centauri was Rigil Kentaurus and Toliman at once; Mizar and Alcor keep their names where both are seen."""
    wide = {label.text for label in on_screen(tables, solution_at(219.9, -60.8, 0.0, 30.0))[2]}
    assert wide & {"Rigil Kentaurus", "Toliman"} == {"Rigil Kentaurus"}
    bear = {label.text for label in on_screen(tables, solution_at(201.0, 55.0, 0.0, 12.0))[2]}
    assert {"Mizar", "Alcor"} <= bear


@pytest.mark.parametrize("name", ["NGC 1909", "NGC 2237", "ESO 56-115", "IC 2944", "Sh2-276"])
def test_an_outline_that_bears_another_number_is_its_objects(tables, name):
    """IC 2118 is the Witch Head, Sh2-275 the Rosette, C 100 the Running Chicken, LBN 933 an arc of Barnard's Loop."""
    (row,) = np.flatnonzero(tables.objects.name == name).tolist()
    middle = np.concatenate(tables.outlines[row]).mean(axis=0)
    assert np.degrees(np.arccos(middle @ tables.objects.vector[row] / np.linalg.norm(middle))) < 8.0


@pytest.mark.parametrize("read", [_chains, _variables])
@pytest.mark.parametrize("text", ["head\nx\tnorth\t1\n", "head\n1\t2\t3 4 5\n", None])
def test_a_damaged_or_missing_table_is_one_sentence(tmp_path, read, text):
    path = tmp_path / "table.tsv"
    if text is not None:
        path.write_text(text, encoding="utf-8")
    with pytest.raises(CatalogueError, match=r"table\.tsv is missing or damaged"):
        read(path)
