"""``kochab mount centre``, ``recover`` and ``disagree``, over a simulated line with real frames."""

import json
import time
from contextlib import contextmanager
from types import SimpleNamespace

import numpy as np
import pytest

from kochab.cli.main import main
from kochab.core.attitude import unit_vectors
from kochab.core.mount import Epoch, Pointing
from kochab.frames.fits_write import write_fits
from kochab.gear.mounts.coordinates import from_mount_epoch
from kochab.gear.mounts.drivers import lx200
from kochab.simulate.practice import PracticeNight
from kochab.simulate.rig import tonight


@pytest.fixture(autouse=True)
def _impatient(monkeypatch):
    from kochab.workflows import goto_target

    monkeypatch.setattr(lx200, "PRODUCT_S", 0.15)
    monkeypatch.setattr(goto_target, "SETTLE_S", 0.2)


@contextmanager
def practising(driver="nexstar", lost_deg=1.5, start=(-30.0, 35.0)):
    """A good mount that points wrong, answering on a pty by the computer's own clock."""
    from dataclasses import replace

    night = replace(tonight(4), lost_deg=lost_deg, start_deg=start)
    practice = PracticeNight(night, driver, exposure_s=0.5)
    try:
        yield practice
    finally:
        practice.stop()


def line(practice):
    site = practice.rig.config.site
    return [
        "--port",
        practice.port,
        "--driver",
        practice.driver,
        f"--site={site.latitude_deg},{site.longitude_deg},{site.height_m}",
    ]


def frames(practice, folder, count=1):
    paths = []
    for k in range(count):
        paths.append(str(folder / f"frame{k}.fits"))
        write_fits(practice.rig.frame(1.0), paths[-1])
    return paths


def off_arcsec(practice, ra_deg, dec_deg):
    truth = practice.rig.truth().ra_dec_deg
    away = unit_vectors(*truth) - unit_vectors(ra_deg, dec_deg)
    return np.degrees(np.linalg.norm(away)) * 3600.0


def run(capsys, *arguments):
    code = main(["mount", *arguments, "--json"])
    return code, json.loads(capsys.readouterr().out)


@pytest.mark.parametrize("driver", ["nexstar", "lx200", "ioptron"])
def test_recover_from_one_frame_that_somebody_vouches_for(driver, tmp_path, capsys) -> None:
    with practising(driver) as practice:
        files = frames(practice, tmp_path)
        code, told = run(capsys, "recover", *line(practice), "--frames", *files, "--yes")
        assert code == 0
        assert told["recovered"] is True
        assert told["offset_deg"] == pytest.approx(1.5, abs=0.02)
        assert off_arcsec(practice, told["solved_ra_deg"], told["solved_dec_deg"]) < 15.0
        assert off_arcsec(practice, told["after_ra_deg"], told["after_dec_deg"]) < 60.0
        assert told["frames"] == files
        assert max(told["evidence"]["log10_false_alarm"]) < -5.0
        assert practice.score().pointing_arcsec < 60.0


def test_recover_with_nobody_there_takes_the_camera_s_word_only(tmp_path, capsys) -> None:
    with practising() as practice:
        files = frames(practice, tmp_path)
        time.sleep(2.0)
        code, told = run(capsys, "recover", *line(practice), "--frames", *files)
        assert code == 1
        assert "before recover began" in told["error"]
        assert practice.score().pointing_arcsec > 5000.0
        camera = ["--source", "simulated", "--address", practice.camera, "--exposure", "0.5"]
        code, told = run(capsys, "recover", *line(practice), *camera)
        assert (code, told["recovered"]) == (0, True)
        assert practice.score().pointing_arcsec < 60.0


def test_recover_looks_only_when_told_so(tmp_path, capsys) -> None:
    with practising() as practice:
        files = frames(practice, tmp_path, 2)
        code, told = run(capsys, "recover", *line(practice), "--frames", *files, "--dry-run")
        assert (code, told["recovered"]) == (0, False)
        assert practice.score().pointing_arcsec > 5000.0
        assert main(["mount", "recover", *line(practice), "--frames", *files, "--yes"]) == 0
        out = capsys.readouterr().out
        assert "1.50" in out or "1.49" in out
        assert "Synced, and read back" in out


def test_recover_previews_where_somebody_is_there_to_say_yes(tmp_path, capsys, monkeypatch) -> None:
    monkeypatch.setattr("sys.stdin", SimpleNamespace(isatty=lambda: True))
    with practising() as practice:
        files = frames(practice, tmp_path)
        assert main(["mount", "recover", *line(practice), "--frames", *files]) == 0
        out = capsys.readouterr().out
        assert "Nothing was changed." in out
        assert "add --yes" in out
        assert practice.score().pointing_arcsec > 5000.0
        code, told = run(capsys, "recover", *line(practice), "--frames", *files, "--yes")
        assert (code, told["recovered"]) == (0, True)
        assert practice.score().pointing_arcsec < 60.0


def test_recover_refuses_large_steps_until_armed(tmp_path, capsys) -> None:
    with practising(lost_deg=24.0) as practice:
        files = frames(practice, tmp_path)
        code, told = run(capsys, "recover", *line(practice), "--frames", *files, "--yes")
        assert code == 1
        assert set(told) == {"error"}
        assert "--arm" in told["error"]
        code, told = run(capsys, "recover", *line(practice), "--frames", *files, "--arm")
        assert (code, told["recovered"]) == (0, True)


def test_recover_takes_the_site_from_the_mount_when_nobody_says(tmp_path, capsys) -> None:
    with practising() as practice:
        files = frames(practice, tmp_path)
        where = line(practice)[:4]
        code, told = run(capsys, "recover", *where, "--frames", *files, "--yes")
        assert code == 0
        assert any("site" in warning for warning in told["warnings"])


def test_recover_without_an_answer_is_an_error_and_exit_1(tmp_path, capsys) -> None:
    from kochab.core.frame import Frame

    dark = tmp_path / "dark.fits"
    write_fits(Frame(np.random.default_rng(1).normal(500, 5, (200, 300)).astype(np.uint16)), dark)
    with practising() as practice:
        code, told = run(capsys, "recover", *line(practice), "--frames", str(dark))
        assert code == 1
        assert "No two frames agree" in told["error"]
        assert main(["mount", "recover", *line(practice), "--frames", str(tmp_path / "no")]) == 1
        err = capsys.readouterr().err.strip().splitlines()[-1]
        assert err.startswith("kochab: ")


def test_centre_from_the_simulated_camera(capsys) -> None:
    with practising() as practice:
        ra, dec = practice.rig.mount.believed_deg()
        now = practice.rig.clock.now_utc()
        ra, dec = from_mount_epoch(Pointing(ra - 1.0, dec + 1.0, Epoch.DATE), now)
        place = ["--ra-deg", f"{ra}", "--dec-deg", f"{dec}"]
        camera = ["--source", "simulated", "--address", practice.camera, "--exposure", "0.5"]
        code, told = run(capsys, "centre", *place, *line(practice), *camera)
        assert (code, told["done"]) == (0, False)
        assert told["preview"]["allowed"] is True
        assert off_arcsec(practice, ra, dec) > 3600.0
        code, told = run(capsys, "centre", *place, *line(practice), *camera, "--tolerance", "20", "--yes")
        assert code == 0
        assert told["centred"] is True
        assert told["corrections"][0] == "sync and goto"
        assert off_arcsec(practice, ra, dec) < 25.0


def test_a_fork_says_so_and_goes_across_the_meridian(capsys) -> None:
    with practising(start=(-10.0, 35.0), lost_deg=0.0) as practice:
        ra, dec = practice.rig.mount.believed_deg()
        goto = ["goto", "--ra-deg", str((ra - 20.0) % 360.0), "--dec-deg", str(dec)]
        code, told = run(capsys, *goto, *line(practice), "--yes")
        assert code == 1
        assert "--fork" in told["error"]
        assert "--allow-flip" in told["error"]
        code, told = run(capsys, *goto, *line(practice), "--fork")
        assert (code, told["preview"]["allowed"]) == (0, True)
        assert not told["preview"]["warnings"]


def test_centre_below_the_horizon_is_an_error_and_exit_1(capsys) -> None:
    with practising() as practice:
        camera = ["--source", "simulated", "--address", practice.camera]
        place = ["--ra-deg", f"{practice.rig.truth().ra_dec_deg[0]}", "--dec-deg", "-60"]
        code, told = run(capsys, "centre", *place, *line(practice), *camera, "--yes")
        assert code == 1
        assert told["end"] == "refused"
        assert "limit is 5°" in told["error"]
        assert main(["mount", "centre", *place, *line(practice), *camera]) == 0
        assert "limit is 5°" in capsys.readouterr().out


def test_disagree_names_no_cause_for_a_mount_that_is_only_lost(tmp_path, capsys) -> None:
    with practising() as practice:
        files = frames(practice, tmp_path)
        code, told = run(capsys, "disagree", *line(practice), "--frames", *files)
        assert code == 0
        assert told["cause"] is None
        assert "not told by one sighting" in told["sentence"]
        assert told["offset_arcsec"] == pytest.approx(5400.0, rel=0.02)
        ra, dec = practice.rig.truth().of_date_deg
        practice.rig.mount.sync((ra + 15.041) % 360.0, dec)
        assert main(["mount", "disagree", *line(practice), "--frames", *files]) == 0
        out = capsys.readouterr().out
        assert "arcmin" in out or "deg" in out
        code, told = run(capsys, "disagree", *line(practice)[:4], "--frames", *files, "--epoch", "date")
        assert told["suspects"][0]["name"] == "summer time"


def test_disagree_judges_the_sightings_of_tonight_that_a_file_keeps(tmp_path, capsys) -> None:
    """Off in both axes by the same angles everywhere, which one sighting cannot tell; last year's counts no more."""
    kept = tmp_path / "tonight.json"
    with practising(lost_deg=0.0) as practice:
        ra, dec = practice.rig.truth().of_date_deg
        practice.rig.mount.sync((ra + 2.0) % 360.0, dec - 1.5)
        told = []
        for number in range(2):
            (tmp_path / str(number)).mkdir()
            files = frames(practice, tmp_path / str(number))
            told.append(run(capsys, "disagree", *line(practice), "--frames", *files, "--sightings", str(kept))[1])
            here = practice.rig.mount.believed_deg()
            practice.rig.mount.goto(here[0] - 30.0, here[1] + 5.0)
            while practice.rig.mount.slewing:
                time.sleep(0.05)
        assert [one["sightings"] for one in told] == [1, 2]
        assert [one["cause"] for one in told] == [None, "not aligned"]
        old = json.loads(kept.read_text())
        for row in old["sightings"]:
            row["time_utc"] = "2020-01-01T00:00:00+00:00"
        kept.write_text(json.dumps(old))
        files = frames(practice, tmp_path)
        assert (
            run(capsys, "disagree", *line(practice), "--frames", *files, "--sightings", str(kept))[1]["sightings"] == 1
        )
        assert len(json.loads(kept.read_text())["sightings"]) == 3


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["recover"], "source of the frames"),
        (["recover", "--frames", "a.fits", "--folder", "b"], "source of the frames"),
        (["recover", "--source", "frob"], "no camera source"),
        (["centre", "Vega"], "source of the frames"),
        (["centre", "--folder", "."], "Give a target"),
        (["centre", "no such star", "--folder", "."], "is called"),
        (["centre", "Vega", "--tolerance", "0"], "not between 1 and 36000 arcsec"),
        (["centre", "Vega", "--tries", "x"], "not a count"),
        (["disagree", "--frames"], "expected at least one"),
    ],
)
def test_unusable_arguments_are_one_sentence_and_exit_2(arguments, sentence, capsys) -> None:
    assert main(["mount", *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert sentence in err
    assert err.count("\n") == 1


def test_an_absent_folder_is_exit_1(tmp_path, capsys) -> None:
    code, told = run(capsys, "centre", "Vega", "--folder", str(tmp_path / "none"))
    assert code == 1
    assert "does not exist" in told["error"]


def test_a_stop_that_finds_the_port_in_use_says_who_can_stop_it(monkeypatch, capsys) -> None:
    from kochab.core.errors import PortError

    def in_use(*_args, **_more):
        raise PortError("COM3 is in use: close the other program that talks to this mount.")

    monkeypatch.setattr("kochab.gear.session.open_mount", in_use)
    assert main(["mount", "stop", "--port", "COM3", "--driver", "nexstar"]) == 1
    err = capsys.readouterr().err
    assert "in use" in err
    assert "Ctrl-C" in err
    assert "power" in err
