"""A solution written into a person's own file: nothing but the header's WCS changes."""

import bz2
import gzip
import os
import stat
import sys

import numpy as np
import pytest
from astropy.io import fits

from kochab.core.attitude import Attitude
from kochab.core.camera import Camera
from kochab.core.errors import FrameError
from kochab.core.frame import Frame
from kochab.core.solution import Solution
from kochab.frames.atomic_file import write_atomically
from kochab.frames.wcs import write_solved_copy, write_with_solution
from tests.frames.files import sky

BEHIND = b"what another program keeps behind the end\0" * 9


def solution():
    camera = Camera(64, 48, 1000.0, 31.5, 23.5)
    return Solution(camera, Attitude(np.eye(3), np.zeros((3, 3))), (), 0.5, -30.0, "made up")


@pytest.fixture
def night(tmp_path):
    """A file with an odd card, a table, and bytes behind its last part."""
    image = fits.PrimaryHDU(sky())
    image.header["CRVAL1"] = 99.0
    image.header["OBSERVER"] = "Ann"
    table = fits.BinTableHDU.from_columns([fits.Column("n", "J", array=np.arange(9))])
    path = tmp_path / "night.fits"
    fits.HDUList([image, table]).writeto(path)
    odd = b"lower  =  what the standard forbids".ljust(80)
    whole = path.read_bytes()
    at = whole.index(b"OBSERVER")
    path.write_bytes(whole[: at + 80] + odd + whole[at + 80 : at + 160] + whole[at + 240 :] + BEHIND)
    return path


def parts(whole):
    """The first header's cards without blanks, and everything after it."""
    end = whole.index(b"END".ljust(80))
    data = -(-(end + 80) // 2880) * 2880
    return [whole[i : i + 80] for i in range(0, end, 80)], whole[data:]


def test_only_the_wcs_of_the_header_changes(night):
    before, rest = parts(night.read_bytes())
    write_solved_copy(solution(), night, night)
    after, same = parts(night.read_bytes())
    assert same == rest
    assert same.endswith(BEHIND)
    kept = [card for card in before if not card.startswith(b"CRVAL1")]
    assert after[: len(kept)] == kept
    assert fits.getheader(night)["PLTSOLVD"] is True
    first = night.read_bytes()
    write_solved_copy(solution(), night, night)
    assert night.read_bytes() == first  # and once more adds nothing


@pytest.mark.parametrize(("suffix", "module"), [(".gz", gzip), (".bz2", bz2)])
def test_a_packed_file_stays_packed(suffix, module, night):
    packed = night.with_name(f"night.fits{suffix}")
    packed.write_bytes(module.compress(night.read_bytes()))
    write_solved_copy(solution(), packed, packed)
    write_solved_copy(solution(), night, night)
    assert module.decompress(packed.read_bytes()) == night.read_bytes()
    write_solved_copy(solution(), packed, plain := night.with_name("copy.fits"))
    assert plain.read_bytes() == night.read_bytes()
    write_solved_copy(solution(), night, again := night.with_name(f"copy.fits{suffix}"))
    assert module.decompress(again.read_bytes()) == night.read_bytes()
    assert sorted(p.suffix for p in night.parent.iterdir()) == sorted([".fits", ".fits", suffix, suffix])


def test_a_compressed_image_stays_compressed(tmp_path):
    path = tmp_path / "night.fits.fz"
    fits.HDUList([fits.PrimaryHDU(), fits.CompImageHDU(sky())]).writeto(path)
    whole = path.read_bytes()
    table = whole.index(b"XTENSION")
    write_solved_copy(solution(), path, path)
    assert path.read_bytes()[:table] == whole[:table]
    assert parts(path.read_bytes()[table:])[1] == parts(whole[table:])[1]
    with fits.open(path) as hdus:
        assert hdus[1].header["PLTSOLVD"] is True
        np.testing.assert_array_equal(hdus[1].data, sky())


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no modes and owners of this kind")
@pytest.mark.parametrize("mode", [0o640, 0o606])
def test_mode_and_owner_stay(night, mode):
    night.chmod(mode)
    if os.geteuid() == 0:
        os.chown(night, 4321, 1234)
    before = night.stat()
    write_solved_copy(solution(), night, night)
    after = night.stat()
    assert (after.st_mode, after.st_uid, after.st_gid) == (before.st_mode, before.st_uid, before.st_gid)
    assert b"PLTSOLVD" in night.read_bytes()


def test_a_file_whose_owner_cannot_be_given_is_written_into(night, monkeypatch):
    def refuse(*_):
        raise PermissionError

    monkeypatch.setattr("shutil.copystat", refuse)
    inode = night.stat().st_ino
    write_solved_copy(solution(), night, night)
    assert night.stat().st_ino == inode
    assert b"PLTSOLVD" in night.read_bytes()
    assert [p.name for p in night.parent.iterdir()] == ["night.fits"]


def test_both_names_of_a_file_see_the_solution(night):
    other = night.with_name("other name.fits")
    os.link(night, other)
    write_solved_copy(solution(), night, night)
    assert os.path.samefile(night, other)
    assert b"PLTSOLVD" in other.read_bytes()
    assert len(list(night.parent.iterdir())) == 2
    write_atomically(other, "short")
    assert night.read_text() == "short"


def test_a_write_protected_file_is_refused(night):
    night.chmod(0o444)
    before = night.read_bytes()
    with pytest.raises(FrameError, match=r"night.fits cannot be written: it is write-protected\.$"):
        write_solved_copy(solution(), night, night)
    assert night.read_bytes() == before
    assert stat.S_IMODE(night.stat().st_mode) == 0o444
    assert [p.name for p in night.parent.iterdir()] == ["night.fits"]


def test_a_full_disk_while_a_linked_file_is_written_leaves_the_new_one_beside_it(night, monkeypatch):
    os.link(night, night.with_name("other.fits"))

    def full(new, old, *_):
        old.write(new.read(10))
        raise OSError(28, "No space left on device")

    def only_into(target, part, before):
        monkeypatch.setattr("shutil.copyfileobj", full)
        return False

    monkeypatch.setattr("kochab.frames.atomic_file._like", only_into)
    with pytest.raises(FrameError, match="No space left"):
        write_solved_copy(solution(), night, night)
    (left,) = night.parent.glob(".*.part")
    assert fits.getheader(left)["PLTSOLVD"] is True


def test_what_does_not_unzip_is_said(tmp_path, night):
    path = tmp_path / "cut.fits.gz"
    path.write_bytes(gzip.compress(night.read_bytes())[:3000])
    with pytest.raises(FrameError, match=r"cut.fits.gz cannot be written: .*end"):
        write_solved_copy(solution(), path, path)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["cut.fits.gz", "night.fits"]


@pytest.mark.parametrize("ending", ["fits", "FIT", "fts", "fits.gz", "fits.bz2"])
def test_a_frame_from_fits_keeps_its_header_and_another_is_written_anew(night, tmp_path, ending):
    pack = {"gz": gzip.compress, "bz2": bz2.compress}.get(ending.rpartition(".")[2], bytes)
    packed = tmp_path / f"frame.{ending}"
    packed.write_bytes(pack(night.read_bytes()))
    picture = tmp_path / "frame.png"
    picture.write_bytes(b"never read")
    for source, observer in ((packed, "Ann"), (picture, None), (None, None)):
        write_with_solution(lambda: Frame(sky()), solution(), source, tmp_path / "frame.new")
        header = fits.getheader(tmp_path / "frame.new")
        assert (header.get("OBSERVER"), header["PLTSOLVD"]) == (observer, True)
    with pytest.raises(FrameError, match="cannot be written"):
        write_with_solution(lambda: Frame(sky()), solution(), None, tmp_path / "none" / "frame.new")
