"""The readers of stars that users already have, against the shipped stars that the tests' own writers put there."""

import json
import shutil
import subprocess

import numpy as np
import pytest
from astropy.io import fits
from astropy.table import Table

from kochab.cli.main import main
from kochab.core.attitude import unit_vectors
from kochab.core.errors import CatalogueError
from kochab.core.progress import run
from kochab.sky import user_catalogues
from kochab.sky.user_catalogues import Cone, Where, open_user_catalogue
from kochab.sky.user_catalogues.astap_database import _half_width
from kochab.sky.user_catalogues.index_files import open_tree
from tests.sky import user_files
from tests.windows.mapped import let_go

PLACES = [(10.0, 20.0), (0.02, -10.29), (359.97, 12.8), (123.0, 89.7), (45.0, -87.5), (271.2, 46.03), (180.0, -90.0)]
"""Within areas, across 0 h, on the borders of rings, and at the poles."""
RADIUS_DEG = 0.8


@pytest.fixture(scope="module")
def stars(catalogue):
    """Shipped stars about the places, RA, Dec, magnitude (N, 3): degrees."""
    near = [catalogue.cone(unit_vectors(*place), np.radians(1.5)) for place in PLACES]
    rows = np.unique(np.concatenate(near))
    x, y, z = catalogue.vectors(rows).T
    return np.column_stack([np.degrees(np.arctan2(y, x)) % 360, np.degrees(np.arcsin(z)), catalogue.mag(rows)])


def make_astap(folder, stars, sky, size):
    user_files.write_astap(folder, "d05", stars, sky, size)
    return Where("ASTAP", "D05", folder)


def make_wide(folder, stars):
    user_files.write_wide(folder, "w08", stars)
    return Where("ASTAP", "W08", folder)


def make_index(folder, stars, **how):
    user_files.write_index(folder / "index-5206.fits", stars, **how)
    return Where("astrometry.net", "5200", folder)


def make_gaia(folder, stars, name):
    user_files.write_gaia(folder / name, stars)
    run(user_catalogues.choose(str(folder / name)))
    return Where("Gaia", name, folder / name)


MAKERS = {
    "1476 of 5 bytes": (lambda f, s: make_astap(f, s, "1476", 5), 0.0),
    "1476 of 6 bytes": (lambda f, s: make_astap(f, s, "1476", 6), 0.0),
    "290 of 5 bytes": (lambda f, s: make_astap(f, s, "290", 5), 0.0),
    "290 of 6 bytes": (lambda f, s: make_astap(f, s, "290", 6), 0.0),
    "W08": (make_wide, 0.0),
    "index": (make_index, 0.2),
    "index of the other byte order": (lambda f, s: make_index(f, s, big_endian=True), 0.2),
    "Gaia CSV": (lambda f, s: make_gaia(f, s, "g.csv"), None),
    "Gaia CSV, gzip": (lambda f, s: make_gaia(f, s, "g.csv.gz"), None),
    "Gaia FITS": (lambda f, s: make_gaia(f, s, "g.fits"), None),
    "Gaia VOTable": (lambda f, s: make_gaia(f, s, "g.vot"), None),
    "Gaia VOTable, gzip": (lambda f, s: make_gaia(f, s, "g.vot.gz"), None),
}


@pytest.fixture(autouse=True)
def _own_settings(tmp_path, monkeypatch):
    monkeypatch.setenv("KOCHAB_CONFIG", str(tmp_path / "config"))
    monkeypatch.setenv("KOCHAB_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(user_catalogues, "usual_folders", lambda: [tmp_path / "usual"])


@pytest.mark.parametrize("maker", MAKERS)
def test_a_cone_has_the_stars_that_stand_in_it(tmp_path, stars, maker):
    """As a look at every star says, at poles and borders too, with a limit of magnitude and without."""
    make, brighter = MAKERS[maker]
    database = open_user_catalogue(make(tmp_path, stars))
    every = unit_vectors(stars[:, 0], stars[:, 1])
    for ra, dec in PLACES:
        apart = np.degrees(2.0 * np.arcsin(np.linalg.norm(every - unit_vectors(ra, dec), axis=1) / 2.0))
        # not those that a rounding may put in or out
        expected = stars[(apart < RADIUS_DEG - 1e-4)]
        found = database.cone(Cone(np.radians(ra), np.radians(dec), np.radians(RADIUS_DEG)))
        assert len(expected) <= len(found) <= (apart < RADIUS_DEG + 1e-4).sum()
        gap = np.linalg.norm(unit_vectors(expected[:, 0], expected[:, 1])[:, None] - found.vectors[None], axis=2)
        nearest = gap.argmin(axis=1)
        assert np.degrees(gap.min(axis=1)).max(initial=0.0) * 3600 < 0.1  # 0.077 and 0.039 arcsec a step
        if brighter is not None:
            assert found.mag[nearest] == pytest.approx(expected[:, 2] + brighter, abs=0.051)
        assert (np.diff(found.mag) >= 0).all()
        limit = float(np.median(found.mag))
        bright = database.cone(Cone(np.radians(ra), np.radians(dec), np.radians(RADIUS_DEG), limit))
        assert len(bright) == (found.mag <= limit + 1e-9).sum()


@pytest.mark.parametrize("sky", ["290", "1476"])
def test_areas_of_all_the_sky_are_told_apart(tmp_path, sky):
    """A star in each of 30,000 places, a cone of one arcsecond about each: none is looked for in a wrong file."""
    rng = np.random.default_rng(3)
    z = rng.uniform(-1, 1, 30_000)
    stars = np.column_stack([rng.uniform(0, 360, len(z)), np.degrees(np.arcsin(z)), rng.uniform(5, 12, len(z))])
    user_files.write_astap(tmp_path, "d05", stars, sky)
    database = open_user_catalogue(Where("ASTAP", "D05", tmp_path))
    for ra, dec, _ in stars[:1500]:
        assert len(database.cone(Cone(np.radians(ra), np.radians(dec), np.radians(1 / 3600))))
    assert database.reach().sky_share == pytest.approx(1.0)
    assert database.reach().density_deg2 == pytest.approx(30_000 / 41_253, rel=0.2)


def test_areas_without_a_star_do_not_count_for_how_deep_a_database_goes(tmp_path):
    """6,000 stars of magnitude 1.0 on half the sky's 41,253 square degrees, and as many empty areas."""
    rng = np.random.default_rng(5)
    dec = np.degrees(np.arcsin(rng.uniform(0.0, 1.0, 6000)))
    user_files.write_astap(tmp_path, "d05", np.column_stack([rng.uniform(0, 360, 6000), dec, np.full(6000, 1.0)]))
    reach = open_user_catalogue(Where("ASTAP", "D05", tmp_path)).reach()
    assert reach.faintest_mag == pytest.approx(1.0)
    assert reach.density_deg2 == pytest.approx(6000 / (41_253 / 2), rel=0.25)
    assert reach.sky_share == 1.0


def test_a_database_without_a_star_reaches_nothing_and_one_of_few_files_a_part_of_the_sky(tmp_path):
    user_files.write_astap(tmp_path, "d05", np.zeros((0, 3)))
    reach = open_user_catalogue(Where("ASTAP", "D05", tmp_path)).reach()
    assert (reach.faintest_mag, reach.density_deg2, reach.sky_share) == (-2.0, 0.0, 1.0)
    (few := tmp_path / "few").mkdir()
    two = [(10.0, 0.5, 7.0), (200.0, -40.0, 9.0)]
    user_files.write_astap(few, "d05", two, every_area=False)
    reach = open_user_catalogue(Where("ASTAP", "D05", few)).reach()
    assert (reach.faintest_mag, reach.sky_share) == (pytest.approx(9.0), pytest.approx(2 / 1476))


def test_one_file_for_all_the_sky_tells_how_deep_it_goes(tmp_path, stars):
    """Its density is of the whole sky's 41,253 square degrees."""
    reach = open_user_catalogue(make_wide(tmp_path, stars)).reach()
    assert reach.density_deg2 == pytest.approx(len(stars) / 41_252.96, rel=1e-6)
    assert reach.faintest_mag == pytest.approx(stars[:, 2].max(), abs=0.051)
    assert reach.sky_share == 1.0


def test_of_a_series_the_smallest_scale_is_searched_and_borders_count_once(tmp_path, stars):
    half = len(stars) // 2
    user_files.write_index(tmp_path / "index-5210.fits", stars[:50], index_id=5210)
    user_files.write_index(tmp_path / "index-5206-00.fits", stars[: half + 20], healpix=0, side=1)
    user_files.write_index(tmp_path / "index-5206-01.fits", stars[half - 20 :], healpix=1, side=1)
    database = open_user_catalogue(Where("astrometry.net", "5200", tmp_path))
    assert len(database.cone(Cone(0.0, 0.0, np.pi))) == len(stars)
    assert database.reach().sky_share == pytest.approx(2 / 12)


def test_the_light_series_tell_their_brightest_stars(tmp_path, stars):
    """They have no magnitudes, but the order in which each small cell was filled."""
    user_files.write_index(tmp_path / "index-5206.fits", stars, magnitudes="")
    found = open_user_catalogue(Where("astrometry.net", "5200", tmp_path)).cone(Cone(0.0, 0.0, np.pi))
    assert len(found) == len(stars)
    gap = np.linalg.norm(unit_vectors(stars[:, 0], stars[:, 1])[:, None] - found.vectors[None, :100], axis=2)
    assert np.mean(stars[gap.argmin(axis=0), 2]) < np.percentile(stars[:, 2], 20)


def test_what_the_writers_write_is_fits_for_astropy_too(tmp_path, stars):
    user_files.write_index(tmp_path / "i.fits", stars)
    with fits.open(tmp_path / "i.fits") as file:
        assert [h.columns.names[0] for h in file[1:]][2:5] == [
            "kdtree_split_stars",
            "kdtree_range_stars",
            "kdtree_data_stars",
        ]
    user_files.write_gaia(tmp_path / "g.fits", stars)
    read = Table.read(tmp_path / "g.fits")
    assert np.asarray(read["ra"]) == pytest.approx(stars[:, 0])
    assert np.asarray(read["phot_g_mean_mag"]) == pytest.approx(stars[:, 2], abs=1e-5)


DAMAGE = {
    "cut": lambda data: data[: len(data) * 2 // 3 + 1],
    "empty": lambda data: b"",
    "another file": lambda data: b"hello\n" * 40,
    "zeros": lambda data: bytes(len(data)),
}


@pytest.mark.parametrize("damage", DAMAGE)
@pytest.mark.parametrize("maker", ["1476 of 5 bytes", "290 of 6 bytes", "W08", "index", "Gaia FITS", "Gaia VOTable"])
def test_damage_is_one_sentence(tmp_path, stars, capsys, maker, damage):
    where = MAKERS[maker][0](tmp_path, stars[:4000])
    files = [where.path] if where.path.is_file() else [p for p in sorted(tmp_path.iterdir()) if p.is_file()]
    for path in files:
        path.write_bytes(DAMAGE[damage](path.read_bytes()))
    capsys.readouterr()
    assert main(["catalog", "use", str(where.path)]) == 2
    said = capsys.readouterr().err
    assert said.strip().count("\n") == 0
    assert said.strip().endswith(".")
    assert "Traceback" not in said


def test_a_tree_that_does_not_fit_its_stars_is_told(tmp_path, stars):
    path = tmp_path / "index-5206.fits"
    user_files.write_index(path, stars)
    tree = open_tree(path)
    at = path.read_bytes().index(np.ascontiguousarray(tree.cuts).tobytes())
    data = bytearray(path.read_bytes())
    data[at : at + 4] = (int(tree.cuts[0]) | 3).to_bytes(4, "little")  # there is no fourth axis
    del tree
    let_go()
    path.write_bytes(data)
    with pytest.raises(CatalogueError, match="does not fit its stars"):
        open_user_catalogue(Where("astrometry.net", "5200", tmp_path)).cone(Cone(0.0, 0.0, 0.1))


def test_catalogues_in_their_usual_folders_are_found_listed_used_and_forgotten(tmp_path, stars, capsys):
    usual = tmp_path / "usual"
    usual.mkdir()
    user_files.write_astap(usual, "D50", stars, "1476")
    user_files.write_wide(usual, "w08", stars[:300])
    user_files.write_index(usual / "index-5206.fits", stars)
    assert [w.title for w in user_catalogues.found()] == ["ASTAP D50", "ASTAP W08", "astrometry.net 5200"]
    assert not user_catalogues.asked_before()
    assert main(["catalog", "use", "d50", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["in_use"]["path"] == str(usual)
    assert user_catalogues.chosen() == Where("ASTAP", "D50", usual)
    assert user_catalogues.asked_before()
    assert main(["catalog", "list", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["catalogues"]
    assert {row["name"]: row["in_use"] for row in rows} == {"D50": True, "W08": False, "5200": False}
    assert rows[0]["faintest_mag"] == pytest.approx(stars[:, 2].max(), abs=0.1)
    (usual / "d50_0101.1476").write_bytes(b"damaged")
    assert main(["catalog", "list"]) == 0
    assert "d50_0101.1476" in capsys.readouterr().out
    assert main(["catalog", "use", "none"]) == 0
    assert user_catalogues.chosen() is None
    assert user_catalogues.asked_before()


@pytest.mark.parametrize("name", ["d80", "", "/nowhere", "kochab"])
def test_what_is_not_there_is_told(name, capsys):
    assert main(["catalog", "use", name]) == 2
    assert capsys.readouterr().err.strip().endswith(".")


def test_a_changed_table_is_not_read_as_the_old_one(tmp_path, stars):
    where = make_gaia(tmp_path, stars, "g.csv")
    assert len(open_user_catalogue(where).cone(Cone(0.0, 0.0, np.pi))) == len(stars)
    user_files.write_gaia(tmp_path / "g.csv", stars[:50])
    with pytest.raises(CatalogueError, match="has changed"):
        open_user_catalogue(where)
    run(user_catalogues.choose(str(tmp_path / "g.csv")))
    assert len(open_user_catalogue(where).cone(Cone(0.0, 0.0, np.pi))) == 50


ASTAP = shutil.which("astap_cli")


@pytest.mark.skipif(ASTAP is None, reason="Debian's astap-cli is not installed")
@pytest.mark.parametrize(("name", "sky"), [("h18", "1476"), ("g18", "290")])
def test_astap_solves_with_the_files_that_our_writer_wrote(tmp_path, catalogue, name, sky):
    """So what the reader is tested against is what ASTAP itself takes for its own."""
    centre, focal, size = unit_vectors(83.0, 22.0), 206264.8 / 3.0, np.array([1600, 1200])
    rows = catalogue.cone(centre, np.radians(3.0))
    vectors, mag = catalogue.vectors(rows), catalogue.mag(rows)
    x, y, z = vectors.T
    stars = np.column_stack([np.degrees(np.arctan2(y, x)) % 360, np.degrees(np.arcsin(z)), mag])
    user_files.write_astap(tmp_path, name, stars, sky)
    east = np.array([-np.sin(np.radians(83.0)), np.cos(np.radians(83.0)), 0.0])
    axes = np.stack([-east, np.cross(centre, east)]) @ vectors.T
    xy = (axes / (vectors @ centre) * focal).T + (size - 1) / 2
    pixels = np.random.default_rng(1).normal(1000.0, 15.0, (1200, 1600))
    across, down = np.arange(1600), np.arange(1200)
    for (px, py), flux in zip(xy, 380.0 * 10 ** (-0.4 * (mag - 12.0)), strict=True):
        if (np.array([px, py]) > -9).all() and (np.array([px, py]) < size + 9).all():
            spot = np.exp(-((down - py) ** 2) / 3.4)[:, None] * np.exp(-((across - px) ** 2) / 3.4)
            pixels += flux * spot
    fits.PrimaryHDU(np.clip(pixels, 0, 65535).astype(np.uint16)).writeto(tmp_path / "frame.fits")
    command = [
        ASTAP,
        "-f",
        "frame.fits",
        "-ra",
        "5.56",
        "-spd",
        "112",
        "-fov",
        "1",
        "-r",
        "3",
        "-z",
        "1",
        "-d",
        tmp_path,
    ]
    subprocess.run(list(map(str, command)), cwd=tmp_path, capture_output=True, timeout=120)
    facts = dict(line.split("=", 1) for line in (tmp_path / "frame.ini").read_text().splitlines() if "=" in line)
    assert facts["PLTSOLVD"] == "T"
    assert float(facts["CRVAL1"]) == pytest.approx(83.0, abs=1e-4)
    assert float(facts["CRVAL2"]) == pytest.approx(22.0, abs=1e-4)


@pytest.mark.parametrize(("radius_deg", "square_degrees"), [(1.0, 3.1414), (90.0, 20626.48), (180.0, 41252.96)])
def test_the_area_of_a_cone_is_that_of_its_cap(radius_deg, square_degrees) -> None:
    cone = Cone(1.0, -0.4, np.radians(radius_deg))
    assert np.degrees(np.degrees(cone.area_sr)) == pytest.approx(square_degrees, rel=1e-4)


@pytest.mark.parametrize("dec_deg", [0.0, -30.0, 50.0, 75.0])
@pytest.mark.parametrize("radius_deg", [0.2, 3.0, 14.0])
def test_a_cone_is_as_wide_in_right_ascension_as_its_edge(dec_deg, radius_deg) -> None:
    """The edge is walked on the sphere; beside a pole it goes all the way round."""
    dec, radius, turn = np.radians(dec_deg), np.radians(radius_deg), np.linspace(0.0, np.pi, 20001)
    north = np.sin(dec) * np.cos(radius) + np.cos(dec) * np.sin(radius) * np.cos(turn)
    ra = np.arctan2(np.sin(radius) * np.sin(turn) * np.cos(dec), np.cos(radius) - np.sin(dec) * north)
    assert ra.max() <= _half_width(dec, radius) < ra.max() + 2e-3
    assert _half_width(dec, np.pi / 2.0 - abs(dec)) == np.pi
