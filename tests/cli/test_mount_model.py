"""``kochab mount model``, ``goto --model`` and ``spiral``, on simulated mounts behind a line."""

from datetime import UTC, datetime, timedelta

import pytest

from kochab.cli.main import main
from kochab.core.attitude import apart_deg
from kochab.core.frame import Site
from kochab.core.mount import Epoch, Pointing
from kochab.gear.mounts.coordinates import from_mount_epoch
from kochab.pointing.disagreement import MountSighting
from kochab.sky.horizon import sidereal_deg
from kochab.workflows.pointing_model import load_sightings, save_sightings
from tests.cli.test_mount import SITE, run, simulated

LINE = ("--driver", "onstep", "--site", "50,8", "--fork")


def leaning_night(path):
    """Sightings of a mount whose declination says 1 deg too much everywhere."""
    now = datetime.now(UTC) - timedelta(minutes=10)
    rows = []
    for hour_angle, dec in ((-40.0, 20.0), (-20.0, 60.0), (30.0, 10.0), (50.0, 45.0), (10.0, 70.0)):
        ra = (sidereal_deg(SITE, now) - hour_angle) % 360.0
        sky = from_mount_epoch(Pointing(ra, dec, Epoch.DATE), now)
        rows.append(MountSighting(sky, Pointing(ra, dec + 1.0, Epoch.DATE), now, Site(50.0, 8.0)))
    save_sightings(path, rows)


def test_a_goto_with_a_model_aims_by_it(capsys, tmp_path) -> None:
    file = tmp_path / "night.json"
    leaning_night(file)
    with simulated("onstep") as (telescope, port):
        telescope.sync((sidereal_deg(SITE, datetime.now(UTC)) + 20.0) % 360.0, 45.0)
        ra, dec = from_mount_epoch(
            Pointing((sidereal_deg(SITE, datetime.now(UTC)) + 30.0) % 360.0, 50.0, Epoch.DATE), datetime.now(UTC)
        )
        there = ("--ra-deg", str(ra), "--dec-deg", str(dec), "--port", port, *LINE)
        code, plain = run(capsys, "goto", *there)
        code, aimed = run(capsys, "goto", *there, "--model", str(file))
        assert code == 0
        apart = apart_deg(plain["preview"]["to_deg"], aimed["preview"]["to_deg"])
        assert apart == pytest.approx(1.0, abs=0.02)
        code, told = run(capsys, "goto", *there, "--model", str(tmp_path / "none.json"))
        assert (code, "needs 4 sightings" in told["error"]) == (1, True)


def test_a_frame_is_solved_and_added_to_the_file(capsys, tmp_path, repository) -> None:
    file = tmp_path / "night.json"
    leaning_night(file)
    with simulated("onstep") as (_, port):
        frame = str(repository / "resources" / "samples" / "orion.png")
        code, told = run(capsys, "model", str(file), "--port", port, *LINE, "--frames", frame)
        assert (code, told["sightings"]) == (0, 6)
        assert len(told["model"]["terms_deg"]) == len(told["model"]["sigmas_deg"]) == 5
        assert told["model"]["helps"] is False, "the new frame shows quite another place"
        added = load_sightings(file)[-1]
        assert apart_deg(added.sky_deg, (83.8, -2.0)) < 10.0
        fresh = tmp_path / "fresh.json"
        assert main(["mount", "model", str(fresh), "--port", port, *LINE, "--frames", frame]) == 0
        assert "needs 4 sightings far from each other, not 1" in capsys.readouterr().out


def test_a_spiral_is_previewed_then_searched(capsys) -> None:
    with simulated("onstep") as (telescope, port):
        telescope.sync((sidereal_deg(SITE, datetime.now(UTC)) + 20.0) % 360.0, 45.0)
        telescope.log.clear()
        words = ("spiral", "--port", port, *LINE, "--step", "20", "--turns", "1", "--pause", "0")
        code, told = run(capsys, *words)
        assert (code, told["done"], told["places"], told["reach_arcmin"]) == (0, False, 8, 20.0)
        assert not [entry for entry in telescope.log if entry[0] == "goto"]


def test_nonsense_is_no_file_of_sightings(capsys, tmp_path) -> None:
    file = tmp_path / "night.json"
    file.write_text("nonsense")
    code = main(["mount", "goto", "Vega", "--driver", "onstep", "--port", "/dev/no", "--model", str(file), "--json"])
    assert code == 2
    assert "holds no sightings" in capsys.readouterr().err


@pytest.mark.parametrize("words", [("--turns", "6"), ("--turns", "0"), ("--pause", "601"), ("--step", "0.4")])
def test_a_spiral_has_one_to_five_rings_and_steps_that_a_field_has(words, capsys) -> None:
    assert main(["mount", "spiral", "--port", "nowhere", "--step", "20", *words]) == 2
    assert words[1] in capsys.readouterr().err
