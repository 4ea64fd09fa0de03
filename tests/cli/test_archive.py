"""``kochab archive``: every input becomes one row, what is done is not done again, and storages are all alike."""

import csv
import hashlib
import json
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from datetime import UTC, datetime
from html import escape
from types import SimpleNamespace

import fsspec
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from astropy.io import fits
from fsspec.implementations.local import LocalFileSystem
from fsspec.implementations.memory import MemoryFileSystem

from kochab.cli import archive as command
from kochab.cli.main import main
from kochab.solver import SolveOptions
from kochab.workflows.archive import run as run_module
from kochab.workflows.archive.dataset import Dataset
from kochab.workflows.archive.inputs import SCHEMA as INPUTS
from kochab.workflows.archive.row import Recipe, Session
from kochab.workflows.archive.run import SESSIONS, Outcome, Run
from tests.cli.archive_inputs import CENTRES, SIZE, archive, rows_of, stars_of, write_lists
from tests.cli.test_night import CENTRE, DRIFT, MINUTES, planted

FRAMES = 5


@pytest.fixture(scope="module")
def frames(tmp_path_factory):
    """A planted night in two folders, with a file that is cut short and one that is no frame."""
    folder = tmp_path_factory.mktemp("frames")
    (folder / "deep").mkdir()
    planted(folder, frames=FRAMES)
    (folder / "light_04.fits").rename(folder / "deep" / "light_04.fits")
    (folder / "notes.txt").write_text("not a frame")
    (folder / "spoilt.fits").write_bytes((folder / "light_00.fits").read_bytes()[:4000])
    return folder


@pytest.fixture(scope="module")
def _done(frames, tmp_path_factory):
    out = tmp_path_factory.mktemp("out") / "archive"
    assert main(["archive", str(frames), "--out", str(out), "--workers", "1", "--json"]) == 0
    return out


@pytest.fixture
def done(_done, tmp_path):
    """The dataset of the frames, a copy for each test."""
    return shutil.copytree(_done, tmp_path / "archive")


def test_a_row_has_what_the_frame_is_and_where_it_points(frames, done) -> None:
    rows = rows_of(done)
    assert sorted(rows) == [*(f"light_{k:02d}.fits" for k in range(FRAMES)), "spoilt.fits"]
    for k in range(FRAMES):
        row = rows[f"light_{k:02d}.fits"]
        file = next(frames.rglob(f"light_{k:02d}.fits"))
        assert row["content"] == hashlib.sha256(file.read_bytes()).hexdigest()
        assert (row["solved"], row["kind"], row["copy"], row["setup"]) == (True, "frame", False, "FILTER=L")
        assert row["time_utc"].minute == (MINUTES * k) % 60
        assert (row["width"], row["height"], row["exposure_s"]) == (900, 600, 60.0)
        hours = k * MINUTES / 60
        east = (row["ra_deg"] - CENTRE[0]) * 3600 * np.cos(np.radians(CENTRE[1])) - DRIFT[0] * hours
        north = (row["dec_deg"] - CENTRE[1]) * 3600 - DRIFT[1] * hours
        assert np.hypot(east, north) < 4.0  # it wanders by 0.8 arcsec
        assert 0 < row["sigma_x_arcsec"] < 0.5
        assert row["log10_false_alarm"] < -15
        assert row["fwhm_px"] == pytest.approx(3.2, abs=0.4)
        assert row["fwhm_px_sigma"] > 0
        assert row["cpu_s"] > 0
    spoilt = rows["spoilt.fits"]
    assert (spoilt["solved"], spoilt["quarantined"], spoilt["ra_deg"]) == (False, True, None)
    assert "cut short" in spoilt["error"]
    assert spoilt["content"] == hashlib.sha256((frames / "spoilt.fits").read_bytes()).hexdigest()


def test_a_row_agrees_with_kochab_solve(frames, done, capsys) -> None:
    assert main(["solve", str(frames / "light_02.fits"), "--json"]) == 0
    alone = json.loads(capsys.readouterr().out)
    row = rows_of(done)["light_02.fits"]
    assert row["hinted"]  # of its session: the answer is the same
    for name in ("ra_deg", "dec_deg", "roll_deg", "scale_arcsec_px"):
        assert row[name] == pytest.approx(alone[name], abs=2e-5)
    assert [row[f"q{axis}"] for axis in "wxyz"] == pytest.approx(alone["quaternion"], abs=1e-6)
    assert row["focal_px"] == pytest.approx(alone["camera"]["focal_px"], rel=1e-5)


@pytest.fixture
def solved(monkeypatch):
    """The names of the inputs that are solved or read in vain, in their order."""
    names = []
    chunk_rows = command.chunk_rows

    def counted(chunk):
        outcome = chunk_rows(chunk)
        names.extend(row["url"].rpartition("/")[2] for row in outcome.rows if not row.get("unchanged"))
        return outcome

    monkeypatch.setattr(command, "chunk_rows", counted)
    return names


def test_what_is_done_is_not_done_again(frames, done, capsys, solved, tmp_path) -> None:
    shutil.copytree(frames, tmp_path / "f")
    here = (tmp_path / "f", "--out", tmp_path / "new", "--workers", "1")
    assert archive(capsys, *here)["done"] == FRAMES + 1
    solved.clear()
    assert archive(capsys, *here)["before"] == FRAMES + 1
    assert solved == []
    # A file whose date alone changed is read, not solved; one that changed is solved; one that went keeps its row.
    shutil.copyfile(frames / "light_01.fits", tmp_path / "f" / "light_01.fits")
    shutil.copyfile(frames / "light_03.fits", tmp_path / "f" / "spoilt.fits")
    (tmp_path / "f" / "light_00.fits").unlink()
    assert archive(capsys, *here)["done"] == 2
    assert solved == ["spoilt.fits"]
    rows = rows_of(tmp_path / "new")
    assert len(rows) == FRAMES + 1
    assert rows["spoilt.fits"]["solved"]
    assert rows["spoilt.fits"]["copy"]  # of light_03
    assert rows["light_01.fits"]["solved"]
    solved.clear()
    assert archive(capsys, *here)["done"] == 0
    assert solved == []


def test_frames_that_were_moved_are_not_solved_again(frames, capsys, solved, tmp_path) -> None:
    shutil.copytree(frames, tmp_path / "f" / "new")
    here = (tmp_path / "f", "--out", tmp_path / "out", "--workers", "1")
    archive(capsys, *here)
    before = rows_of(tmp_path / "out")
    (tmp_path / "f" / "new").rename(tmp_path / "f" / "old")
    # Another of the same name and size is no copy of it.
    shutil.copyfile(frames / "light_01.fits", tmp_path / "f" / "old" / "light_00.fits")
    solved.clear()
    assert archive(capsys, *here)["done"] == FRAMES + 1
    assert sorted(solved) == ["light_00.fits", "spoilt.fits"]  # what is no frame is looked at where it is now
    rows = {row["url"]: row for row in pq.read_table(str(tmp_path / "out")).to_pylist()}
    moved = next(row for url, row in rows.items() if url.endswith("/f/old/light_02.fits"))
    assert {name for name in moved if moved[name] != before["light_02.fits"][name]} == {"url", "done_utc", "copy"}
    assert sum(not row["copy"] for row in rows.values() if row["solved"]) == FRAMES
    solved.clear()
    assert archive(capsys, *here)["done"] == 0


def test_a_worker_with_another_catalogue_ends_the_run(frames, capsys, tmp_path, monkeypatch) -> None:
    chunk_rows = command.chunk_rows

    def elsewhere(chunk):
        outcome = chunk_rows(chunk)
        return replace(outcome, rows=[row | {"recipe": "another"} for row in outcome.rows])

    monkeypatch.setattr(command, "chunk_rows", elsewhere)
    assert main(["archive", str(frames), "--out", str(tmp_path / "out"), "--workers", "1"]) == 2
    assert "A worker has another version or star catalogue" in capsys.readouterr().err
    assert json.loads((tmp_path / "out" / "_kochab" / "run-all.json").read_text())["state"] == "stopped"


def test_other_options_make_a_row_anew_and_where_chooses_rows(frames, done, capsys, solved) -> None:
    here = (frames, "--out", done, "--workers", "1")
    assert archive(capsys, *here, "--where", "solved=false", code=1)["done"] == 1
    assert solved == ["spoilt.fits"]
    solved.clear()
    before = rows_of(done)
    assert archive(capsys, *here, "--scale", "14")["done"] == FRAMES + 1
    after = rows_of(done)
    assert before.keys() == after.keys()
    assert {row["recipe"] for row in before.values()}.isdisjoint(row["recipe"] for row in after.values())
    solved.clear()
    archive(capsys, *here, "--scale", "14", "--where", "dec_deg<21.997", "--where", "error=null")
    expected = [name for name, row in after.items() if row["dec_deg"] is not None and row["dec_deg"] < 21.997]
    assert 0 < len(expected) < FRAMES
    assert sorted(solved) == sorted(expected)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["{frames}"], "Name the dataset with --out"),
        (["{frames}/no", "--out", "{out}"], "no does not exist."),
        (["{out}", "--out", "{out}"], "has no frames."),
        (["{frames}", "--out", "{frames}/notes.txt"], "name a folder for the dataset."),
        (["{frames}", "--out", "{out}", "--where", "bright=2"], "--where bright=2 is not COLUMN=VALUE"),
        (["{frames}", "--out", "{out}", "--where", "fwhm_px=soft"], "soft is no value of fwhm_px."),
        (["{frames}", "--out", "{out}", "--width", "100"], "--width and --height come together."),
        (["{frames}", "--out", "{out}", "--shard", "9/8"], "9/8 is not I/N, as 3/8"),
        (["nowhere://x", "--out", "{out}"], "nowhere://x"),
        (["{frames}", "--out", "{out}", "--dask", "tcp://127.0.0.1:9", "--workers", "2"], "No Dask scheduler at"),
        (["status", "{out}"], "is no archive."),
    ],
)
def test_bad_arguments_get_one_sentence(frames, tmp_path, capsys, arguments, said, monkeypatch) -> None:
    monkeypatch.setattr("kochab.cli.cluster.PATIENCE_S", 1)
    (tmp_path / "out").mkdir()
    filled = [text.format(frames=frames, out=tmp_path / "out") for text in arguments]
    assert main(["archive", *filled]) == 2
    error = capsys.readouterr().err.strip()
    assert said in error
    assert len(error.splitlines()) == 1


def test_without_its_packages_it_says_what_to_install(monkeypatch, capsys) -> None:
    monkeypatch.setattr(command, "find_spec", lambda name: None if name == "distributed" else object())
    assert main(["archive", "x", "--out", "y"]) == 2
    assert "pip install 'kochab-astro[archive]'" in capsys.readouterr().err


def test_its_help_needs_none_of_its_packages() -> None:
    code = (
        "import sys\nfrom kochab.cli.main import main\nassert main(['archive', '--help']) == 0\n"
        "print('LOADED', sorted({'pyarrow', 'dask', 'distributed', 'fsspec', 'numpy'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=100)
    assert done.stdout.strip().endswith("LOADED []"), done.stderr


def test_streaks_and_unlisted_sources_are_listed_where_they_are_asked_for(frames, tmp_path, capsys) -> None:
    with fits.open(frames / "light_00.fits") as hdus:
        header, pixels = hdus[0].header, hdus[0].data.astype(float)
    y, x = np.mgrid[0:600, 0:900]  # no star of magnitude 11.5 within 40 px of that place
    star, ends = (450.3, 120.6), np.array([(150.0, 500.0), (800.0, 420.0)])
    pixels += 3e4 * np.exp(-((x - star[0]) ** 2 + (y - star[1]) ** 2) / 2 / 1.36**2)
    along = (ends[1] - ends[0]) / np.hypot(*(ends[1] - ends[0]))
    away, far = (
        (x - ends[0, 0]) * -along[1] + (y - ends[0, 1]) * along[0],
        (x - ends[0, 0]) * along[0] + (y - ends[0, 1]) * along[1],
    )
    pixels += 400 * np.exp(-(away**2) / 2 / 1.36**2) * ((far > 0) & (far < np.hypot(*(ends[1] - ends[0]))))
    fits.writeto(tmp_path / "a.fits", np.clip(pixels, 0, 65535).astype(np.uint16), header)

    # By hand: 14 arcsec a pixel, north up, east left.
    def sky(place):
        north = CENTRE[1] + (299.5 - place[1]) * 14 / 3600
        return CENTRE[0] - (place[0] - 449.5) * 14 / 3600 / np.cos(np.radians(north)), north

    archive(capsys, tmp_path / "a.fits", "--out", tmp_path / "plain", "--workers", "1")
    assert rows_of(tmp_path / "plain")["a.fits"]["streaks"] is None
    archive(capsys, tmp_path / "a.fits", "--out", tmp_path / "out", "--workers", "1", "--objects")
    row = rows_of(tmp_path / "out")["a.fits"]
    (unlisted,) = row["unlisted"]
    assert (unlisted["ra_deg"], unlisted["dec_deg"]) == pytest.approx(sky(star), abs=2e-3)
    assert (unlisted["x"], unlisted["y"]) == pytest.approx(star, abs=0.1)
    (streak,) = row["streaks"]
    found = sorted([(streak["ra1_deg"], streak["dec1_deg"]), (streak["ra2_deg"], streak["dec2_deg"])], reverse=True)
    assert np.abs(np.array(found) - [sky(end) for end in ends]).max() < 0.03
    assert streak["whole"]
    assert streak["length_deg"] == pytest.approx(np.hypot(*(ends[1] - ends[0])) * 14 / 3600, rel=0.03)


# -- Tables and star lists ---------------------------------------------------------------------


def near(row, centre) -> bool:
    return abs(row["ra_deg"] - centre[0]) < 0.01 and abs(row["dec_deg"] - centre[1]) < 0.01


def test_star_lists_of_a_table_are_rows_and_shards_part_them(tmp_path, capsys) -> None:
    write_lists(tmp_path / "lists.parquet")
    sums = [
        archive(capsys, tmp_path / "lists.parquet", "--out", tmp_path / "out", "--workers", "1", "--shard", f"{k}/2")
        for k in (1, 2)
    ]
    assert sum(one["inputs"] for one in sums) == len(CENTRES)
    assert all(one["inputs"] for one in sums)
    first = Dataset.at(str(tmp_path / "out"), (0, 2))
    assert len(first.parts()) == 2
    assert len(first.index()) == sums[0]["inputs"]  # a shard looks at no part of its fellows
    assert len(Dataset.at(str(tmp_path / "out"), (0, 3)).index()) == len(CENTRES)  # whose parts another sharding made
    rows = rows_of(tmp_path / "out")
    for k, centre in enumerate(CENTRES):
        row = rows[f"lists.parquet#{k:09d}"]
        assert near(row, centre)
        assert (row["kind"], row["table_row"], row["width"], row["height"]) == ("star list", k, *SIZE)
        assert row["scale_arcsec_px"] == pytest.approx(40.0, rel=1e-3)
    assert main(["archive", "status", str(tmp_path / "out")]) == 0
    assert f"{len(CENTRES)} rows, {len(CENTRES)} solved" in capsys.readouterr().out


def test_tables_of_urls_name_frames_and_star_lists(frames, tmp_path, capsys, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    np.savetxt("stars.csv", stars_of(CENTRES[0]), delimiter=",")
    with open("urls.csv", "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerows([("url", "width", "height"), (frames / "light_00.fits", "", ""), ("stars.csv", *SIZE)])
        writer.writerow(("gone.fits", "", ""))
    (tmp_path / "plain.txt").write_text(f"# one a line\n{frames / 'light_01.fits'}\n")
    pq.write_table(pa.table({"url": [f"file://{frames}/deep/light_04.fits"]}), "urls.parquet")
    tables = ("urls.csv", "plain.txt", "urls.parquet")
    told = archive(capsys, *tables, "--out", "out", "--workers", "1")
    assert (told["inputs"], told["solved"], told["failed"]) == (5, 4, 1)
    rows = rows_of("out")
    assert near(rows["stars.csv"], CENTRES[0])
    assert rows["gone.fits"]["error"].endswith("gone.fits does not exist.")
    assert archive(capsys, *tables, "--out", "out", "--workers", "1")["done"] == 0
    # With a size every CSV is a list.
    size = ("--width", SIZE[0], "--height", SIZE[1])
    assert archive(capsys, tmp_path / "*.csv", *size, "--out", "lists", "--workers", "1")["inputs"] == 2


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("a.csv", b"url,width\n,3\n", "row 1 has no URL"),
        ("a.csv", b"url,width\nx.csv,wide\n", "row 1 has a size that is no number"),
        ("a.csv", b"\xff\xfe\x00\xd8", "is not a text file"),
        ("a.parquet", b"PAR1 nonsense", "is a damaged table"),
    ],
)
def test_a_table_that_is_none_is_told(tmp_path, capsys, name, content, said) -> None:
    (tmp_path / name).write_bytes(content)
    assert main(["archive", str(tmp_path / name), "--out", str(tmp_path / "out")]) == 2
    assert said in capsys.readouterr().err


def test_a_list_that_is_none_does_not_cost_the_others(tmp_path, capsys) -> None:
    good = stars_of(CENTRES[0])
    columns = {"x": [good[:, 0].tolist(), [1.0]], "y": [good[:, 1].tolist(), [1.0, 2.0]]}
    pq.write_table(pa.table(columns | {"width": [1000, 1000], "height": [800, 800]}), tmp_path / "l.parquet")
    told = archive(capsys, tmp_path / "l.parquet", "--out", tmp_path / "out", "--workers", "1")
    assert (told["solved"], told["failed"]) == (1, 1)
    assert rows_of(tmp_path / "out")["l.parquet#000000001"]["quarantined"]


# -- Storages ----------------------------------------------------------------------------------


class Flaky(MemoryFileSystem):
    """A storage in memory that fails at the first times."""

    protocol = "flaky"
    failures = 0

    def _open(self, path, mode="rb", **more):
        if mode == "rb" and path.endswith(".fits") and Flaky.failures > 0:
            Flaky.failures -= 1
            raise ConnectionError("the line broke")
        return super()._open(path, mode, **more)

    def unstrip_protocol(self, name):
        return f"flaky://{self._strip_protocol(name)}"

    @classmethod
    def _strip_protocol(cls, path):
        return super()._strip_protocol(path.replace("flaky://", "memory://"))


@pytest.fixture
def memory(frames):
    """Two frames in memory."""
    fs = fsspec.filesystem("memory")
    for name in ("light_00.fits", "light_01.fits"):
        fs.pipe_file(f"/night/{name}", (frames / name).read_bytes())
    yield fs
    fs.rm("/", recursive=True)


def test_memory_is_a_storage(memory, capsys) -> None:
    told = archive(capsys, "memory://night", "--out", "memory://out")
    assert (told["inputs"], told["solved"]) == (2, 2)
    rows = rows_of("/out", filesystem=memory)
    assert rows["light_00.fits"]["url"] == "memory:///night/light_00.fits"
    assert archive(capsys, "memory://night/*.fits", "--out", "memory://out")["before"] == 2
    assert not memory.glob("/out/_kochab/*.draft")


def test_a_storage_that_fails_is_asked_again_and_the_next_run_tries_once_more(memory, capsys, monkeypatch) -> None:
    fsspec.register_implementation("flaky", Flaky, clobber=True)
    monkeypatch.setattr(time, "sleep", lambda seconds: None)
    monkeypatch.setattr(Flaky, "failures", 1)
    told = archive(capsys, "flaky://night", "--out", "memory://out", "--retries", "1", "--workers", "1")
    assert told["solved"] == 2
    assert sorted(row["tries"] for row in rows_of("/out", filesystem=memory).values()) == [1, 2]
    monkeypatch.setattr(Flaky, "failures", 2)
    told = archive(capsys, "flaky://night", "--out", "memory://new", "--retries", "1", "--workers", "1")
    assert (told["solved"], told["failed"]) == (1, 1)
    (row,) = (row for row in rows_of("/new", filesystem=memory).values() if row["error"])
    assert row["error"].endswith("cannot be read now: the line broke.")
    assert not row["quarantined"]
    told = archive(capsys, "flaky://night", "--out", "memory://new", "--retries", "1", "--workers", "1")
    assert (told["before"], told["solved"]) == (1, 1)
    assert all(row["solved"] for row in rows_of("/new", filesystem=memory).values())


# -- The dataset -------------------------------------------------------------------------------


def test_parts_are_joined_and_a_newer_row_replaces_an_older(frames, done, capsys, monkeypatch) -> None:
    monkeypatch.setattr("kochab.workflows.archive.run.PART_ROWS", 1)
    archive(capsys, frames, "--out", done, "--workers", "1", "--fov", "3.5")
    assert len(rows_of(done)) == FRAMES + 1  # each once, though each was there twice
    monkeypatch.setattr("kochab.workflows.archive.dataset.FEW", 2)
    assert (
        archive(capsys, frames, "--out", done, "--workers", "1", "--fov", "3.5", "--where", "solved=true")["done"]
        == FRAMES
    )
    assert len(rows_of(done)) == FRAMES + 1
    assert len(list(done.glob("part-*"))) <= 2


def test_rows_twice_after_a_run_that_ended_while_joining_count_once(frames, done, capsys) -> None:
    (part,) = done.glob("part-*")
    shutil.copyfile(part, done / "part-all-20200101T000000-twice.parquet")
    (done / "_kochab" / "part-all-x.parquet.draft").write_bytes(b"half")
    assert main(["archive", "status", str(done)]) == 0
    assert f"{FRAMES + 1} rows" in capsys.readouterr().out
    archive(capsys, frames, "--out", done, "--workers", "1", "--where", "solved=false", code=1)
    assert len(rows_of(done)) == FRAMES + 1
    assert not list((done / "_kochab").glob("*.draft"))


def test_a_part_that_is_in_use_waits_for_the_next_run(frames, done, capsys, monkeypatch) -> None:
    """As on Windows, where nobody removes what another has open."""
    (part,) = done.glob("part-*")
    remove, asked = LocalFileSystem.rm_file, []

    def refuse(fs, path):
        asked.append(path)
        if path.endswith(part.name):
            raise PermissionError(13, "Sharing violation")
        remove(fs, path)

    monkeypatch.setattr(LocalFileSystem, "rm_file", refuse)
    monkeypatch.setattr("kochab.workflows.archive.dataset.PAUSE_S", 0.0)
    again = (frames, "--out", done, "--workers", "1", "--where", "solved=true")
    assert archive(capsys, *again)["done"] == FRAMES
    assert sum(path.endswith(part.name) for path in asked) > 1
    assert part.exists()
    assert main(["archive", "status", str(done)]) == 0
    assert f"{FRAMES + 1} rows" in capsys.readouterr().out
    monkeypatch.undo()
    archive(capsys, *again)
    assert not part.exists()
    assert len(rows_of(done)) == FRAMES + 1


SMALL_PARTS = (
    "import sys, kochab.workflows.archive.run as run; run.PART_ROWS = 2\n"
    "from kochab.__main__ import main; sys.exit(main())"
)


def test_a_run_that_is_killed_is_taken_up_by_the_next_and_each_list_is_done_once(tmp_path, capsys) -> None:
    lists, out, count = tmp_path / "lists.parquet", tmp_path / "out", 30 * len(CENTRES)
    write_lists(lists, CENTRES * 30)
    command = [sys.executable, "-c", SMALL_PARTS, "archive", lists, "--out", out, "--workers", "1"]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        until = time.monotonic() + 100
        while not len(list(out.glob("part-*"))) > 2 and process.poll() is None and time.monotonic() < until:
            time.sleep(0.01)
        assert process.poll() is None
    finally:
        process.kill()
        process.wait()
    done = len(rows_of(out))
    assert 0 < done < count
    went_on = archive(capsys, lists, "--out", out, "--workers", "1")
    assert (went_on["before"], went_on["done"]) == (done, count - done)
    assert len(rows_of(out)) == count
    assert not list((out / "_kochab").glob("*.draft"))


def test_a_damaged_part_is_told(frames, done, capsys) -> None:
    (done / "part-all-x.parquet").write_bytes(b"PAR1")
    assert main(["archive", str(frames), "--out", str(done), "--workers", "1"]) == 2
    error = capsys.readouterr().err
    assert "has a part that cannot be read" in error
    assert len(error.splitlines()) == 1


def test_two_runs_do_not_write_at_once(frames, done, capsys) -> None:
    state = json.loads((done / "_kochab" / "run-all.json").read_text())
    sleeper = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(100)"])
    try:
        (done / "_kochab" / "run-all.json").write_text(json.dumps(state | {"state": "running", "pid": sleeper.pid}))
        assert main(["archive", str(frames), "--out", str(done), "--workers", "1"]) == 2
        assert f"process {sleeper.pid}" in capsys.readouterr().err
    finally:
        sleeper.kill()
        sleeper.wait()
    archive(capsys, frames, "--out", done, "--workers", "1")  # whoever wrote it is gone


@pytest.mark.skipif(sys.platform == "win32", reason="Windows sends no Ctrl-C to one process")
def test_ctrl_c_leaves_what_is_done_and_the_next_run_goes_on(frames, tmp_path, capsys) -> None:
    for k in range(40):
        shutil.copyfile(frames / f"light_{k % 4:02d}.fits", tmp_path / f"{k:02d}.fits")
    out = tmp_path / "out"
    asked = ["archive", str(tmp_path / "*.fits"), "--out", str(out), "--workers", "1", "--json"]
    code = (
        "import sys, kochab.workflows.archive.run as run; run.STATE_S = 0\n"
        "from kochab.__main__ import main; sys.exit(main())"
    )
    process = subprocess.Popen([sys.executable, "-c", code, *asked], stdout=subprocess.PIPE, text=True)
    state = out / "_kochab" / "run-all.json"
    until = time.monotonic() + 60
    while time.monotonic() < until and not (state.exists() and json.loads(state.read_text() or "{}").get("done")):
        time.sleep(0.005)
    process.send_signal(signal.SIGINT)
    told = json.loads(process.communicate(timeout=60)[0])
    assert process.returncode == 130
    assert 0 < told["done"] < 40
    assert len(rows_of(out)) == told["done"]
    went_on = archive(capsys, *asked[1:-1])
    assert went_on["before"] == told["done"]
    assert len(rows_of(out)) == 40
    assert sum(not row["copy"] for row in rows_of(out).values()) == 4


# -- How far it is -----------------------------------------------------------------------------


def run_of(folder, urls, **how) -> Run:
    """A run over inputs none of which has been done."""
    one = {"url": "", "stamp": "1", "size_bytes": 9, "table_row": -1, "width": 0, "height": 0}
    left = pa.Table.from_pylist([one | {"url": url} for url in urls], INPUTS).append_column(
        "known", pa.nulls(len(urls))
    )
    index = pa.table({"url": pa.array([], pa.string()), "content": pa.array([], pa.string())})
    return Run(Dataset.at(str(folder)), Recipe(SolveOptions()), len(left), left, index, **how)


def test_a_folder_goes_on_from_its_own_last_frame_and_the_longest_unused_is_forgotten(tmp_path) -> None:
    """One chunk a folder, for as many folders as are known at once and one more; then each folder's second frame."""
    folders = [f"/{k:05d}" for k in range(SESSIONS + 1)]
    run = run_of(tmp_path, [f"{folder}/{k}.fits" for k in range(2) for folder in folders])
    chunks = run.chunks()
    for number, folder in enumerate(folders):
        chunk = next(chunks)
        assert (chunk.items[0].folder, chunk.session) == (folder, None)
        run.take(Outcome(folder, [], Session((90, 60), "", 2.0 + number, (1.0, 2.0), 3.0)))
        if number == SESSIONS - 1:  # the first folder is used again before there is one too many
            run.take(Outcome(folders[0], [], Session((90, 60), "", 1.0, (1.0, 2.0), 3.0)))
    known = [chunk.session and chunk.session.scale_arcsec_px for chunk in chunks]
    assert known == [1.0, None, *(2.0 + number for number in range(2, SESSIONS + 1))]


@pytest.mark.parametrize("workers", [2, 16])
def test_workers_end_together(tmp_path, workers) -> None:
    """Each chunk goes to the least busy worker, and each worker holds two, as Dask hands them out."""
    urls = [f"{k:05d}" for k in range(1250 * workers)]
    run = run_of(tmp_path, urls, hands=workers, _mean_s=0.007)
    chunks, lanes, given = run.chunks(), [[] for _ in range(workers)], []
    ends = [0.0] * workers
    while any(lanes) or not given:
        while len(given) < len(urls) and min(map(len, lanes)) < 2:
            chunk = next(chunks)
            given += [item.url for item in chunk.items]
            min(lanes, key=len).append(0.007 * len(chunk.items))
        busy = [k for k in range(workers) if lanes[k]]
        first = min(busy, key=lambda k: ends[k] + lanes[k][0])
        ends[first] += lanes[first].pop(0)
    assert given == urls
    assert sum(ends) / (workers * max(ends)) > 0.98


def test_the_status_counts_rows_and_names_what_is_quarantined(frames, tmp_path, capsys) -> None:
    shutil.copyfile(frames / "light_00.fits", tmp_path / "a.fits")
    name = "&b.fits" if sys.platform == "win32" else "<b>.fits"  # Windows knows no < in a name
    shutil.copyfile(frames / "spoilt.fits", tmp_path / name)
    fits.writeto(tmp_path / "empty.fits", np.full((400, 600), 300, np.uint16))
    dark = fits.PrimaryHDU(np.zeros((400, 600), np.uint16))
    dark.header["IMAGETYP"] = "DARK"
    dark.writeto(tmp_path / "d.fits")
    out = tmp_path / "out"
    archive(capsys, tmp_path / "*.fits", "--out", out, "--workers", "1")
    told = archive(capsys, "status", out)
    assert (told["rows"], told["solved"], told["calibration"], told["quarantined"]) == (4, 1, 1, 1)
    assert sum(told["unsolved"].values()) == 1
    assert told["quarantine"][0]["url"].endswith(f"/{name}")
    assert told["runs"]["all"]["state"] == "done"
    page = (out / "_kochab" / "status.html").read_text()
    assert escape(name) in page
    assert name not in page
    assert "http-equiv" not in page


def test_the_page_of_a_run_reloads_itself_and_one_that_fell_silent_is_told(done, capsys) -> None:
    state = json.loads((done / "_kochab" / "run-all.json").read_text())
    going = state | {
        "state": "running",
        "updated_utc": datetime.now(UTC).isoformat(),
        "to_do": 100,
        "done": 4,
        "rate_s": 2.0,
    }
    (done / "_kochab" / "run-1of2.json").write_text(json.dumps(going))
    (done / "_kochab" / "run-2of2.json").write_text(json.dumps(going | {"updated_utc": "2020-01-01T00:00:00+00:00"}))
    (done / "_kochab" / "run-3of2.json").write_text('{"state": 7, "done": "many", "updated_utc": []}')
    (done / "_kochab" / "run-4of2.json").write_text("[[[")
    told = archive(capsys, "status", done)
    assert {name: run["state"] for name, run in told["runs"].items()} == {
        "1of2": "running",
        "2of2": "lost",
        "3of2": "7",
        "all": "done",
    }
    assert (told["to_do"], told["rate_s"]) == (96, 2.0)
    page = (done / "_kochab" / "status.html").read_text()
    assert '<meta http-equiv="refresh" content="10">' in page
    assert "2 a second, 48 s left" in page


def test_the_page_takes_a_fiftieth_of_the_time_however_many_rows_it_reads(tmp_path, monkeypatch) -> None:
    """The page reads every row; with ten million, one reading takes about 30 s, the old interval between pages."""
    clock = SimpleNamespace(now_s=time.monotonic())
    monkeypatch.setattr(run_module, "time", SimpleNamespace(monotonic=lambda: clock.now_s))
    written = []

    def summary_of(_):
        written.append(clock.now_s)
        clock.now_s += 30.0
        return {}

    monkeypatch.setattr(run_module, "summary_of", summary_of)
    monkeypatch.setattr(run_module, "page_of", lambda *_: "")
    going = run_of(tmp_path, [])
    going.dataset.make()
    for _ in range(3600):
        clock.now_s += 1.0
        going.tell("running")
    assert np.diff(written).min() >= 30.0 / 0.02
    assert len(written) >= 3
