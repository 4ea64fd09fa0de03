import contextlib
import gzip
import io
import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kochab.cli.main import main
from kochab.core.attitude import radec_deg, unit_vectors
from kochab.core.errors import CatalogueError
from kochab.core.progress import run
from kochab.sky import catalogue_file, open_catalogue
from kochab.sky.catalogue_import import read_foreign, user_folder
from kochab.sky.user_catalogues.astap_database import MARK, decode
from kochab.sky.user_catalogues.gaia_table import v_of_gaia
from tests.sky.packages import index_file


def astap_bytes(sections, size):
    """A file of ``sections`` {mag: [(ra, dec, bp_rp)]}, each with Decs of one upper byte."""
    data = bytearray(b"made for a test".ljust(109)) + bytes([size])
    for mag, stars in sections.items():
        decs = [round(dec / 90.0 * (2**23 - 1)) for _, dec, _ in stars]
        high = decs[0] >> 16
        data += MARK.to_bytes(3, "little") + bytes([high + 128, round(mag * 10) + 16])
        data += bytes(size - 5)
        for (ra, _, colour), dec in zip(stars, decs, strict=True):
            assert dec >> 16 == high
            data += round(ra / 360.0 * (2**24 - 1)).to_bytes(3, "little")
            data += (dec & 0xFFFF).to_bytes(2, "little")
            if size == 6:
                data += round(colour * 10).to_bytes(1, "little", signed=True)
    return bytes(data)


SECTIONS = {9.5: [(10.0, -20.1, 0.8), (10.5, -20.2, -0.3)], 12.3: [(11.0, 45.2, 1.5)], -1.0: [(359.9, 0.1, 0.0)]}


@pytest.mark.parametrize("size", [5, 6])
def test_astap_files_are_decoded(size):
    ra, dec, mag, colour = decode(astap_bytes(SECTIONS, size), "x_0101.290")
    assert ra == pytest.approx([10.0, 10.5, 11.0, 359.9], abs=2e-5)
    assert dec == pytest.approx([-20.1, -20.2, 45.2, 0.1], abs=1e-5)
    assert mag == pytest.approx([9.5, 9.5, 12.3, -1.0])
    if size == 6:
        assert colour == pytest.approx([0.8, -0.3, 1.5, 0.0])
    else:
        assert np.isnan(colour).all()


@given(cut=st.integers(0, 139))
def test_an_astap_file_cut_short_is_said_or_whole(cut):
    whole = astap_bytes(SECTIONS, 5)
    assert len(whole) > 139
    if cut >= 110 and (cut - 110) % 5 == 0:
        assert decode(whole[:cut], "x").shape[0] == 4
    else:
        with pytest.raises(CatalogueError, match="ASTAP"):
            decode(whole[:cut], "x")


def test_an_astap_file_of_wide_records_is_refused():
    data = astap_bytes(SECTIONS, 5)
    with pytest.raises(CatalogueError, match="5 or 6"):
        decode(data[:109] + b" " + data[110:], "x")


GAIA = """source_id,ra,dec,pmra,pmdec,phot_g_mean_mag,bp_rp,ref_epoch
1,10.0,20.0,100.0,-50.0,14.0,0.82,2016.0
2,11.0,21.0,,,15.5,null,2016.0
3,,,1,1,15.5,1.0,2016.0
"""


@pytest.mark.parametrize("begin", ["# a comment of ECSV\n", "\ufeff"])
@pytest.mark.parametrize("name", ["g.csv", "g.csv.gz"])
def test_gaia_tables_are_read(tmp_path, name, begin):
    """Spreadsheets write a byte order mark."""
    rows = GAIA.replace("source_id,", "", 1).replace("\n1,", "\n").replace("\n2,", "\n").replace("\n3,", "\n")
    data = (begin + rows).encode()
    (tmp_path / name).write_bytes(gzip.compress(data) if name.endswith("gz") else data)
    foreign = run(read_foreign(tmp_path / name))
    stars = foreign.stars
    assert len(stars) == 2
    assert foreign.epoch == 2016.0
    assert stars.flag.tolist() == [catalogue_file.MOVING, 0]
    assert stars.mag == pytest.approx([14.15, 15.7], abs=0.01)
    assert stars.bv[0] == pytest.approx(0.62, abs=0.05)
    assert np.isnan(stars.bv[1])
    assert stars.pm.tolist() == [[100.0, -50.0], [0.0, 0.0]]


def test_the_sun_has_its_colour():
    v, bv = v_of_gaia(np.array([4.67]), np.array([0.818]))
    assert v == pytest.approx(4.81, abs=0.03)
    assert bv == pytest.approx(0.63, abs=0.04)


SIMPLE = b"SIMPLE  =                    T".ljust(80)
END = b"END".ljust(80)
TABLE = (SIMPLE + b"NAXIS   =                    0".ljust(80) + END).ljust(2880) + b"XTENSION= 'BINTABLE'".ljust(80)
SIZE = b"".join(card.ljust(80) for card in (b"NAXIS   = 2", b"NAXIS1  = 0", b"NAXIS2  = 0"))


@pytest.mark.parametrize(
    ("name", "data", "says"),
    [
        ("g.csv", b"ra,dec\n1,2\n", "lacks the column phot_g_mean_mag"),
        ("g.csv", b"", "lacks the column ra"),
        ("g.csv", b"ra,dec,phot_g_mean_mag\n", "holds no stars"),
        ("g.csv.gz", b"not gzip", "cannot be read"),
        ("g.csv.gz", gzip.compress(GAIA.encode(), mtime=0)[:10] + b"\x07" + 20 * b"\0", "cannot be read"),
        ("g.csv", b"\xff\xfe\x00", "cannot be read"),
        ("g.csv", GAIA.replace("2016.0\n2", "2015.5\n2").encode(), "mixes epochs"),
        ("x.fits", b"SIMPLE", "not a FITS file"),
        ("x.fits", SIMPLE + b"NAXIS   =           99999999".ljust(80) + END, "more axes or columns than FITS allows"),
        (
            "x.fits",
            (TABLE + SIZE + b"TFIELDS =               1000".ljust(80) + END).ljust(5760),
            "more axes or columns than FITS allows",
        ),
        ("x.txt", b"hello", "no catalogue that can be imported"),
    ],
)
def test_what_cannot_be_imported_is_said(tmp_path, name, data, says):
    (tmp_path / name).write_bytes(data)
    with pytest.raises(CatalogueError, match=says):
        run(read_foreign(tmp_path / name))


def test_empty_folders_and_absent_paths_are_said(tmp_path):
    for path in (tmp_path, tmp_path / "nothing"):
        with pytest.raises(CatalogueError, match=r"\.$"):
            run(read_foreign(path))


def test_stars_in_several_index_files_count_once(tmp_path):
    for i in range(2):
        index_file(tmp_path / f"index-{i}.fits", [(10.0, 20.0, 12.0), (30.0 + i, 40.0, 13.0)])
    stars = run(read_foreign(tmp_path)).stars
    assert len(stars) == 3
    assert sorted(stars.mag) == pytest.approx([11.9, 12.9, 12.9])


@pytest.fixture(scope="module")
def imported(tmp_path_factory, catalogue):
    """A table with a new star, one of the shipped list and a ghost that is too bright, and what the import reports.

    Writing 1.9 million stars along with them takes three seconds of processor time.
    """
    table = tmp_path_factory.mktemp("imported") / "g.csv"
    ra, dec = radec_deg(catalogue.vectors([1_500_000], 2016.0)[0])
    table.write_text(
        "ra,dec,pmra,pmdec,phot_g_mean_mag,bp_rp,ref_epoch\n"
        "83.0,60.0,0.0,1000.0,14.35,0.82,2016.0\n"
        f"{float(ra)!r},{float(dec)!r},,,11.75,0.82,2016.0\n"
        "84.0,61.0,0.0,0.0,5.85,0.82,2016.0\n"
    )
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        assert main(["catalog", "import", str(table), "--name", "mine", "--json"]) == 0
    return table, json.loads(out.getvalue())


def test_an_imported_catalogue_holds_both(imported, catalogue):
    """The new star is stored at its J2000 position."""
    _, told = imported
    assert told["counts"] == {"stars read": 2, "stars added to the shipped ones": 1}
    both = open_catalogue(user_folder("mine") / "deep.kcat")
    assert len(both) == len(catalogue) + 1
    row = both.cone(unit_vectors(83.0, 60.0 - 16.0 / 3600), np.radians(1.0 / 3600))
    assert len(row) == 1
    assert both.mag(row) == pytest.approx([14.5], abs=0.01)
    assert both.flags(row)[0] == catalogue_file.MOVING
    now = both.vectors(row, 2026.0)[0]
    assert np.degrees(np.linalg.norm(now - unit_vectors(83.0, 60.0 + 10.0 / 3600))) * 3600 < 0.1
    assert both.label(both.find("Vega")) == ("HIP 91262", "Vega")
    some = catalogue.cone(unit_vectors(200.0, -40.0), np.radians(1.0), year=2026.0)
    same = both.cone(unit_vectors(200.0, -40.0), np.radians(1.0), year=2026.0)
    gap = both.vectors(same, 2026.0) - catalogue.vectors(some, 2026.0)
    assert np.abs(gap).max() < 3e-9


def test_import_keeps_it_with_the_persons_data(imported, capsys):
    table, told = imported
    assert told["folder"] == str(user_folder("mine"))
    assert main(["catalog", "info", "--catalog", "mine", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["ok"]
    assert main(["catalog", "import", str(table), "--name", "../mine"]) == 2
