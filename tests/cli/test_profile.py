"""An equipment profile is made, shown and used by name; what is typed as well goes before it."""

import argparse
import json

import pytest

from kochab.cli.main import build_parser, main
from kochab.cli.profile import use_profile

NEWTON = [
    *("--source", "indi", "--address", "pi:7624/CCD", "--exposure", "3", "--binning", "2"),
    *("--focal-length", "800", "--pixel-size", "3.76", "--port", "/dev/ttyUSB7", "--driver", "onstep"),
    *("--baud", "57600", "--epoch", "date", "--site", "48.14,11.58,520", "--meridian", "flips"),
    *("--lowest-altitude", "20"),
]


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("KOCHAB_CONFIG", str(tmp_path))
    return tmp_path / "equipment"


@pytest.fixture
def newton(capsys) -> str:
    assert main(["profile", "save", "Newton 8", *NEWTON]) == 0
    capsys.readouterr()
    return "Newton 8"


def read(*arguments: str) -> argparse.Namespace:
    args = build_parser(arguments).parse_args(arguments)
    if args.profile:
        use_profile(args)
    return args


def test_it_is_saved_shown_listed_changed_and_removed(newton, capsys) -> None:
    assert main(["profile", "show", newton, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["site"] == [48.14, 11.58, 520.0]
    assert (told["driver"], told["baud"], told["meridian"]) == ("onstep", 57600, "flips")
    assert main(["profile", "save", newton, "--focal-length", "1000"]) == 0
    assert main(["profile", "save", "Aaa", "--source", "folder"]) == 0
    capsys.readouterr()
    assert main(["profile", "list", "--json"]) == 0
    rows = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [row["name"] for row in rows] == ["Aaa", newton]
    assert (rows[1]["focal_length_mm"], rows[1]["pixel_size_um"]) == (1000.0, 3.76)
    assert main(["profile", "remove", newton]) == 0
    assert main(["profile", "show", newton]) == 1
    err = capsys.readouterr().err
    assert "there are: Aaa" in err


def test_solve_and_polar_take_the_pixel_scale_as_a_hint(newton) -> None:
    scale = pytest.approx(206.264806 * 2 * 3.76 / 800.0, rel=1e-6)
    assert read("solve", "a.fits", "--profile", newton).scale == scale
    assert read("polar", "a.fits", "b.fits", "--profile", newton).scale == scale
    assert read("solve", "a.fits", "--profile", newton, "--fov", "3").scale is None
    assert read("solve", "a.fits", "--scale", "9", "--profile", newton).scale == 9.0
    assert read("polar", "a.fits", "b.fits", "--profile", newton).site.height_m == 520.0


def test_a_mount_and_its_camera_come_from_it_and_what_is_typed_goes_before_it(newton) -> None:
    args = read("mount", "centre", "Vega", "--profile", newton)
    assert (args.port, args.driver, args.baud, args.epoch) == ("/dev/ttyUSB7", "onstep", 57600, "date")
    assert (args.source, args.address, args.exposure, args.binning) == ("indi", "pi:7624/CCD", 3.0, 2)
    assert (args.limits.lowest_altitude_deg, args.limits.allow_flip) == (20.0, True)
    args = read("mount", "centre", "Vega", "--profile", newton, "--port", "COM3", "--folder", "x")
    assert (args.port, args.driver, args.source, args.address) == ("COM3", "onstep", None, "")
    args = read("live", "--profile", newton, "--source", "alpaca")
    assert (args.source, args.address, args.exposure) == ("alpaca", "", 3.0)
    assert args.profile == newton, "one name selects what is learned of camera and lens, too"


def test_the_guard_goes_by_its_limits(newton, monkeypatch) -> None:
    from kochab.cli.mount import _opened
    from kochab.gear import session

    opened = []
    monkeypatch.setattr(session, "open_mount", lambda *told, **more: opened.append((*told, more["epoch"])) or object())
    monkeypatch.setattr(session, "Guard", lambda mount, site, limits, now, **more: limits)
    limits = _opened(read("mount", "goto", "Vega", "--profile", newton, "--no-site"), stop_first=False)
    assert opened[0] == ("onstep", "/dev/ttyUSB7", 57600, session.EPOCH_NAMES["date"])
    assert (limits.lowest_altitude_deg, limits.allow_flip, limits.allow_without_site) == (20.0, True, True)


def test_the_meridian_limit_and_the_horizon_are_kept_in_it(newton, capsys, tmp_path) -> None:
    file = tmp_path / "horizon.txt"
    file.write_text("# house\n350 12\n10, 30  tree\n\n90 0 # open\n")
    limits = ["--past-meridian", "7.5", "--hour-angles", "-75,60.5"]
    assert main(["profile", "save", newton, "--horizon", str(file), *limits]) == 0
    file.unlink()
    capsys.readouterr()
    assert main(["profile", "show", newton]) == 0
    assert "3 points" in capsys.readouterr().out
    limits = read("mount", "goto", "Vega", "--profile", newton).limits
    assert (limits.past_meridian_deg, limits.hour_angle_deg) == (7.5, (-75.0, 60.5))
    for pair in ("60,-75", "1", "-200,0", "a,b", "1,2,3"):
        assert main(["profile", "save", newton, f"--hour-angles={pair}"]) == 2
        assert "Hour angles are two" in capsys.readouterr().err
    assert limits.horizon_deg == ((10.0, 30.0), (90.0, 0.0), (350.0, 12.0))
    assert limits.floors_deg([0.0, 350.0, 50.0, 200.0]) == pytest.approx([21.0, 20.0, 20.0, 20.0])
    for text in ("", "north 3", "10", "10 95"):
        file.write_text(text)
        assert main(["profile", "save", newton, "--horizon", str(file)]) == 2
        assert "azimuth and altitude" in capsys.readouterr().err.replace("(from north over east) ", "")
    assert main(["profile", "save", newton, "--horizon", str(tmp_path / "none")]) == 2


def test_live_still_learns_under_any_name() -> None:
    assert read("live", "--profile", "new lens").profile == "new lens"


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["solve", "a.fits", "--profile", "none"], "There is no profile"),
        (["profile", "save", " "], "needs a name"),
        (["profile", "save", "a", "--driver", "frob"], "frob"),
        (["profile", "save", "a", "--lowest-altitude", "95"], "lowest altitude must be between"),
        (["profile", "save", "a", "--site", "95,8"], "not LAT,LON"),
        (["camera", "take", "-o", "a.fits"], "Choose a camera"),
    ],
)
def test_what_cannot_be_is_one_sentence_and_exit_2(arguments, sentence, capsys) -> None:
    assert main(arguments) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert sentence in err


@pytest.mark.parametrize("content", ["", "[]", "null", '{"name": 3}', '{"name": "a", "site": [99, 0]}', '{"baud": 1}'])
def test_a_damaged_file_is_one_sentence(newton, folder, content, capsys) -> None:
    (path,) = folder.glob("*.json")
    path.write_text(content)
    assert main(["solve", "a.fits", "--profile", newton]) == 2
    err = capsys.readouterr().err
    assert "is damaged" in err
    assert str(path) in err
    assert main(["profile", "list"]) == 1
    assert main(["profile", "save", newton, "--site", "50,8"]) == 2, "nothing else is lost by a guess"


@pytest.mark.parametrize("words", [("--source", "telegraph"), ("--driver", "telegraph")])
def test_a_kind_that_nobody_offers_is_not_saved(words, folder, capsys) -> None:
    assert main(["profile", "save", "Newton 8", *words]) == 2
    assert "telegraph" in capsys.readouterr().err
    assert not [*folder.glob("*")]
