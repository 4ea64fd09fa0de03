"""``--set`` and ``--methods``: every option of every method, detector and attitude."""

import json

import numpy as np
import pytest

from kochab.cli.main import main
from kochab.cli.options import everything, settings_of
from kochab.core.errors import UsageError
from kochab.core.frame import Detections
from kochab.core.progress import run
from kochab.core.registry import options_of
from kochab.detection import DETECTORS
from kochab.identification import IDENTIFIERS
from kochab.lab.detectors.regions import ClusterDetector
from tests.cli.test_paper_tables import VEGA, apart_deg, write_list


def test_settings_go_where_they_belong() -> None:
    said = ["separation_deg=0.08", "detector.tau_px=6", "attitude.partner=next", "planar=on"]
    assert settings_of(said, "triads", "clusters", "triad") == (
        {"separation_deg": 0.08, "planar": True},
        {"tau_px": 6.0},
        {"partner": "next"},
    )


@pytest.mark.parametrize(
    ("setting", "says"),
    [
        ("stars=40", "Method triads: stars cannot be 40; allowed: whole number from 3 to 15 stars"),
        ("speed=4", "There is no option speed; there are stars, separation_deg"),
        ("stars", "--set stars is not NAME=VALUE"),
        ("=4", "is not NAME=VALUE"),
        ("detector.=4", "is not NAME=VALUE"),
        ("attitude.partner=next", "needs --attitude"),
        ("detector.tau_px=6", "Detector auto: There is no option tau_px; there are none"),
    ],
)
def test_what_cannot_be_set_is_one_sentence(setting, says) -> None:
    with pytest.raises(UsageError, match=says):
        settings_of([setting], "triads", "auto", None)


def test_the_list_holds_everything(capsys) -> None:
    assert main(["identify", "--methods"]) == 0
    text = capsys.readouterr().out
    assert text.strip() == everything()
    for name in ("--method triads", "--detector clusters", "--attitude plate_constants"):
        assert name in text
    assert "separation_deg=0.15" in text
    assert "number from 0.001 to 1 deg" in text
    assert "Attitude from stellar images" in text
    assert len(options_of(ClusterDetector)) == 7
    assert len(DETECTORS) == text.count("--detector ")


def test_the_list_tells_what_none_means_and_what_the_default_is() -> None:
    text = everything()
    assert "--method patterns   (the default)" in text
    assert "--detector auto   (the default)" in text
    assert "grey levels, or none: by the noise]" in text


@pytest.mark.parametrize("name", [name for name in IDENTIFIERS if name != "patterns"])
def test_every_method_but_the_default_needs_the_scale_as_the_list_says(name) -> None:
    assert "Every method but patterns needs the scale" in everything()
    stars = Detections.from_list(np.random.default_rng(0).uniform(0, 500, (30, 2)), 500, 500)
    assert not run(IDENTIFIERS.make(name).identify(stars, None)).searched


def test_a_detectors_own_options(repository, capsys) -> None:
    sample = str(sorted((repository / "resources" / "samples").glob("*.*"))[0])
    detect = ["detect", sample, "--json", "--detector", "peaks"]
    counts = []
    for said in ((), ("--set", "max_stars=5"), ("--set", "detector.max_stars=6")):
        assert main([*detect, *said]) == 0
        counts.append(json.loads(capsys.readouterr().out)["detections"])
    assert counts[0] > 6
    assert counts[1:] == [5, 6]
    assert main([*detect, "--set", "box_px=2"]) == 2
    assert "box_px cannot be 2; allowed: whole number from 3 to 99 px" in capsys.readouterr().err


@pytest.mark.parametrize("fov", ["9.013", "9.2", "9.6"])
def test_triads_absorb_a_width_that_is_a_few_per_cent_off(fov, tmp_path, capsys) -> None:
    """The scan's true width is 9.36 deg, the thesis says 9.013."""
    size = ["--width", "427", "--height", "319", "--fov", fov]
    code = main(["identify", write_list(tmp_path, VEGA), *size, "--json", "--method", "triads"])
    out = json.loads(capsys.readouterr().out)
    assert code == 0, out
    assert out["matches"] == 5
    assert apart_deg(out, VEGA["centre"]) < 0.02


def test_the_fixed_point_path_from_the_command_line(tmp_path, capsys) -> None:
    size = ["--width", "427", "--height", "319", "--json", "--method", "triads"]
    said = ["arithmetic=fixed", "field_deg=9.0130,6.9049", "dec_deg=30,90"]
    settings = [part for text in said for part in ("--set", text)]
    assert main(["identify", write_list(tmp_path, VEGA), *size, *settings]) == 0
    out = json.loads(capsys.readouterr().out)
    assert out["method"] == "triads"
    assert out["matches"] == 5
