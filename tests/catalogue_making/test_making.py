import gzip

import numpy as np
import pytest

from catalogs.making.build import build
from catalogs.making.merge import KEPT, SIDE, cell_of
from catalogs.making.objects import MORE_OBJECTS, read_stellarium
from catalogs.making.sources import EARLY, offsets, read_stars, triangles
from kochab.core.attitude import unit_vectors
from kochab.core.errors import CatalogueError, UsageError
from kochab.core.progress import run
from kochab.sky import Catalogue, catalogue_file, open_catalogue
from kochab.sky.inventory import inventory
from kochab.sky.names import StarNames, read_objects
from kochab.sky.proper_motion import moved
from kochab.sky.user_catalogues.index_files import read_index
from tests.sky.packages import index_file, star_file, write_packages

YEARS = 2000.0 - EARLY


def shifted(ra, dec, pm, years):
    """(ra, dec) in degrees after ``years`` of ``pm`` mas/yr."""
    v = moved(unit_vectors(ra, dec)[None], np.array([pm], float), years)[0]
    return np.degrees(np.arctan2(v[1], v[0])) % 360, np.degrees(np.arcsin(v[2]))


VEGA = {"ra": 279.2347, "dec": 38.7837, "pm": (200.9, 286.2), "v": 0.0, "bv": 0.0, "hip": 91262, "plx": 130.2}
FAST = (1500.0, -900.0)


@pytest.fixture(scope="module")
def sky(tmp_path_factory):
    """A handful of stars, each with one thing to get right."""
    folder = tmp_path_factory.mktemp("packages")
    old7, old8 = (shifted(ra, dec, FAST, -YEARS) for ra, dec in ((10.0, 20.0), (50.0, -30.0)))
    at_2024 = shifted(10.0, 20.0, FAST, 24.0)
    bright = [
        VEGA,
        {"ra": old7[0], "dec": old7[1], "pm": FAST, "v": 5.2, "hip": 7},  # early, in the list
        {"ra": old8[0], "dec": old8[1], "pm": FAST, "v": 9.1, "hip": 8},  # early, no partner
        {"ra": 100.0, "dec": 60.0, "pm": FAST, "v": 9.2, "hip": 9},  # right, with a partner
        {"ra": 200.0, "dec": 5.0, "v": 6.0, "hip": 10, "component": 1},
        {"ra": 200.0, "dec": 5.0 + 1.0 / 3600, "v": 6.0, "hip": 10, "component": 2},
        {"ra": 120.0, "dec": -45.0, "v": 5.0},  # a globular cluster's core
    ]
    faint = [
        {"ra": 30.0, "dec": 30.0, "pm": (50.0, 20.0), "v": 9.50, "bv": 0.5},
        {"ra": 31.0, "dec": 30.0, "v": 9.8, "bv": 3.2},  # no partner, no real colour
    ]
    tycho = [(100.0, 60.0, 9.31), (30.0, 30.0, 9.60), (150.0, -70.0, 11.40), (359.9999, -0.0001, 12.1), (0.0, 0.0, 1.9)]
    listed = [
        {"ra": at_2024[0], "dec": at_2024[1], "v": 5.21, "hip": 7},
        {**VEGA, **dict(zip(("ra", "dec"), shifted(279.2347, 38.7837, VEGA["pm"], 24.0), strict=True)), "v": 0.03},
        {"ra": 200.0, "dec": 5.0, "v": 5.25, "hip": 10},
    ]
    write_packages(folder, bright, faint, tycho, listed)
    return folder


@pytest.fixture(scope="module")
def built(sky, tmp_path_factory):
    out = tmp_path_factory.mktemp("built")
    manifest = run(build(sky, out))
    catalogue = Catalogue(out / "deep.kcat")
    catalogue.names = StarNames(out)
    return catalogue, manifest, out


def seconds(catalogue, ra, dec):
    """Distance to the nearest star in arcsec, and its row."""
    gap = np.linalg.norm(catalogue.vectors(np.arange(len(catalogue))) - unit_vectors(ra, dec), axis=1)
    return np.degrees(gap.min()) * 3600, int(gap.argmin())


@pytest.mark.parametrize(("hip", "ra", "dec"), [(7, 10.0, 20.0), (8, 50.0, -30.0), (9, 100.0, 60.0)])
def test_every_star_is_taken_to_j2000(built, hip, ra, dec):
    catalogue, *_ = built
    gap, row = seconds(catalogue, ra, dec)
    assert gap < 0.05
    assert catalogue.label(row)[0] == f"HIP {hip}"
    assert bool(catalogue.flags([row])[0] & catalogue_file.REDATED) == (hip != 9)


def test_close_components_become_their_photocentre(built):
    catalogue, *_ = built
    gap, row = seconds(catalogue, 200.0, 5.0 + 0.5 / 3600)
    assert gap < 0.02
    assert catalogue.flags([row])[0] & catalogue_file.MERGED
    assert catalogue.mag([row])[0] == pytest.approx(5.25)
    assert len(catalogue.cone(unit_vectors(200.0, 5.0), np.radians(0.1))) == 1


def test_artefacts_and_stars_without_a_place_are_dropped(built):
    catalogue, manifest, _ = built
    assert manifest["counts"]["artefacts dropped"] == 2
    assert seconds(catalogue, 120.0, -45.0)[0] > 3600
    assert seconds(catalogue, 31.0, 30.0)[0] > 600
    assert seconds(catalogue, 0.0, 0.0)[0] > 0.3  # the true star beside it stays
    assert len(catalogue) == 8


def test_v_comes_from_vt_with_and_without_colour(built):
    catalogue, *_ = built
    coloured, plain = seconds(catalogue, 30.0, 30.0)[1], seconds(catalogue, 150.0, -70.0)[1]
    bv = round((0.5 + 0.5) / 4 * 127) * 4 / 127 - 0.5
    assert catalogue.mag([coloured])[0] == pytest.approx(9.60 - 0.121 * bv + 0.009, abs=2e-3)
    assert catalogue.bv([coloured])[0] == pytest.approx(bv, abs=0.011)
    assert catalogue.mag([plain])[0] == pytest.approx(11.30, abs=2e-3)
    assert np.isnan(catalogue.bv([plain])[0])
    assert catalogue.flags([plain])[0] == catalogue_file.V_FROM_VT


def test_names_and_numbers_are_carried(built):
    catalogue, *_ = built
    assert catalogue.label(catalogue.find("harp STAR")) == ("HIP 91262", "Vega")
    assert catalogue.find("HD 172167") == catalogue.find("3 Lyrae") == catalogue.find("alpha lyr")
    assert catalogue.label(catalogue.find("R And")) == ("HIP 7", "61 Cyg A")
    objects = read_objects(built[2] / "objects.tsv")
    assert objects.vector[objects.messier == "M31"][0] == pytest.approx(unit_vectors(10.685, 41.269), abs=1e-4)
    with pytest.raises(UsageError):
        catalogue.find("NGC 1A")
    row = catalogue.bright_rows(np.array([catalogue.find("vega")]))[0]
    assert catalogue.names.bright.column("parallax")[row] == 13020


def test_figures_are_written_as_chains(built):
    lines = (built[2] / "lines.tsv").read_text().splitlines()
    assert lines == ["constellation\thip", "Lyr\t91262 7 8", "Cyg\t8 91262"]


def test_variables_have_their_minimum_an_amplitude_or_a_limit(built):
    """R And's is given; X Cyg is 0.5 fainter; Y Lyr's minimum is below 16.5, which is no minimum; CST is constant."""
    rows = (built[2] / "variables.tsv").read_text().splitlines()
    assert rows[1:] == ["7\tM\tV\t5.8\t15.2\t409.2", "8\tEA\tHp\t6\t6.5\t2.5", "9\tRCB\tV\t8.3\t\t"]
    assert built[1]["counts"]["variable stars"] == 3


def test_objects_bring_numbers_sizes_and_the_names_of_both_sources(built):
    rows = [line.split("\t") for line in (built[2] / "objects.tsv").read_text().splitlines()]
    by_name = {row[0]: dict(zip(rows[0], row, strict=True)) for row in rows[1:]}
    ours = {line.split("\t")[0] for line in MORE_OBJECTS.read_text("utf-8").splitlines()}
    assert sorted({*by_name} - ours) == ["IC 434", "NGC 2024", "NGC 224", "Sh2-155"]
    assert (by_name["Palomar 5"]["mag"], by_name["Palomar 5"]["band"], by_name["Palomar 5"]["also"]) == (
        "11.75",
        "V",
        "Pal 5",
    )
    m31, flame, ic434, cave = (by_name[name] for name in ("NGC 224", "NGC 2024", "IC 434", "Sh2-155"))
    assert (m31["size_arcmin"], m31["minor_arcmin"], m31["pa_deg"]) == ("177.83", "69.66", "35")
    assert m31["common"] == "Andromeda Galaxy"
    assert (flame["common"], flame["size_arcmin"], flame["also"]) == ("Flame Nebula", "120", "Sh2-277,Lips")
    assert ic434["common"] == ""  # 37 arcmin from the Flame, whose name it has in one of the two
    assert (cave["common"], cave["type"], cave["also"]) == ("Cave Nebula", "HII", "")
    counts = built[1]["counts"]
    assert [counts[f"names {what}"] for what in ("of both sources", "struck out", "of OpenNGC alone")] == [1, 1, 0]


def test_outlines_and_boundaries_are_written_in_degrees(built):
    assert (built[2] / "outlines.tsv").read_text().splitlines()[1] == "NGC 2024\t84.0000 -1.5000 87.0000 -2.0000"
    assert (built[2] / "boundaries.tsv").read_text().splitlines()[1] == "Aql CMa\t30.0000 -1.0000 45.0000 2.0000"


@pytest.mark.parametrize("data", [b"", b"\x1f\x8b123", gzip.compress(b"\0" * 30, mtime=0)])
def test_a_broken_table_of_objects_is_said(tmp_path, data):
    (tmp_path / "catalog.dat").write_bytes(data)
    with pytest.raises(CatalogueError, match=r"catalog\.dat is not"):
        read_stellarium(tmp_path / "catalog.dat")


def test_the_check_finds_the_listed_stars_close(built):
    check = built[1]["check_against_independent_list"]
    assert check["listed"] == check["found"] == 3
    assert check["largest arcsec"] < 0.15


def test_the_same_sources_give_the_same_bytes(sky, built, tmp_path):
    run(build(sky, tmp_path))
    names = sorted(p.name for p in built[2].iterdir())
    assert names == sorted(p.name for p in tmp_path.iterdir())
    assert len(names) == 12
    for name in names:
        assert (tmp_path / name).read_bytes() == (built[2] / name).read_bytes(), name


def test_the_inventory_counts_the_bright_stars_that_have_a_number_or_a_parallax(built):
    """Only Vega has a parallax, an SAO and an HR number; two components share one Hipparcos number."""
    bright = run(inventory(built[2]))["bright"]
    assert bright == {"rows": 6, "hip": 5, "hd": 2, "hr": 1, "sao": 1, "with_parallax": 1}


def test_the_inventory_sees_what_was_altered(built, tmp_path):
    for file in built[2].iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    assert run(inventory(tmp_path))["ok"]
    data = bytearray((tmp_path / "names.tsv").read_bytes())
    data[-3] ^= 1
    (tmp_path / "names.tsv").write_bytes(bytes(data))
    told = run(inventory(tmp_path))
    assert not told["ok"]
    assert [f["name"] for f in told["files"] if not f["ok"]] == ["names.tsv"]


def test_missing_sources_are_named(tmp_path):
    with pytest.raises(CatalogueError, match=r"lack Stellarium's stars"):
        run(build(tmp_path, tmp_path / "out"))


@pytest.mark.parametrize(("level", "kind"), [(0, 0), (2, 0), (3, 1)])
def test_star_files_come_back(tmp_path, level, kind):
    rng = np.random.default_rng(level)
    v = rng.normal(size=(300, 3))
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    ra, dec = np.degrees(np.arctan2(v[:, 1], v[:, 0])) % 360, np.degrees(np.arcsin(v[:, 2]))
    stars = [{"ra": a, "dec": d, "v": 9.2, "hip": 5 * (1 - kind)} for a, d in zip(ra, dec, strict=True)]
    star_file(tmp_path / "stars_x.cat", level, kind, stars)
    read = read_stars(tmp_path / "stars_x.cat")
    near = np.linalg.norm(read.vector[:, None] - v, axis=2)
    assert np.degrees(near.min(axis=0).max()) * 3600 < (0.05 if kind else 1e-3)
    assert sorted(near.argmin(axis=1).tolist()) == list(range(300))
    assert read.mag == pytest.approx(9.2)
    assert set(read.hip.tolist()) == {5 * (1 - kind)}


@pytest.mark.parametrize("data", [b"", b"x" * 500, b"\x0a\x04\x5f\x83" + b"\0" * 200])
def test_broken_star_files_are_said(tmp_path, data):
    (tmp_path / "stars_0.cat").write_bytes(data)
    with pytest.raises(CatalogueError, match=r"stars_0\.cat"):
        read_stars(tmp_path / "stars_0.cat")


def test_triangles_tile_the_sphere():
    corners = triangles(2)
    assert corners.shape == (320, 3, 3)
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    volume = np.abs(np.einsum("ij,ij->i", a, np.cross(b, c)))
    dots = 1 + sum(np.einsum("ij,ij->i", p, q) for p, q in ((a, b), (b, c), (c, a)))
    assert (2 * np.arctan2(volume, dots)).sum() == pytest.approx(4 * np.pi)


def test_index_files_come_back(tmp_path):
    index_file(tmp_path / "index.fits", [(12.0, 34.0, 9.5), (200.0, -80.0, 11.0)])
    vector, columns = read_index(tmp_path / "index.fits")
    truth = unit_vectors(np.array([12.0, 200.0]), np.array([34.0, -80.0]))
    assert offsets(vector, truth) == pytest.approx(0.0, abs=1e-3)
    assert columns["MAG_VT"] == pytest.approx([9.5, 11.0])


def test_a_file_that_is_no_index_is_said(tmp_path):
    (tmp_path / "no.fits").write_bytes(b"SIMPLE  =                    T")
    with pytest.raises(CatalogueError, match=r"no\.fits is not a FITS file"):
        read_index(tmp_path / "no.fits")


def test_cells_are_of_one_size():
    v = np.random.default_rng(5).normal(size=(400_000, 3))
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    counts = np.bincount(cell_of(v, side=8), minlength=12 * 64)
    assert len(counts) == 12 * 64
    assert abs(counts / counts.mean() - 1).max() < 0.25


def test_no_cell_of_the_shipped_list_is_much_fuller_than_the_index_allows():
    catalogue = open_catalogue()
    rows = np.arange(len(catalogue))
    alone = rows[catalogue.flags(rows) == catalogue_file.V_FROM_VT]
    counts = np.bincount(cell_of(catalogue.vectors(alone)), minlength=12 * SIDE**2)
    assert counts.max() == KEPT
