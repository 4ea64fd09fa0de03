"""The published tables: rows, verdicts, and what each paper's module measures."""

import json

import numpy as np
import pytest

from kochab.lab.bench import papers
from kochab.lab.bench.papers import Published, robotic, robotic_stages, share_error, verdict, wins
from kochab.lab.bench.papers import spherical_fields as fields
from kochab.lab.bench.papers import spherical_triangles as triangles
from kochab.lab.bench.papers import stellar_images as stellar
from kochab.lab.bench.papers.stellar_images import DENEB, SADR, VEGA
from kochab.lab.methods.angles import Angles, angle_table
from kochab.lab.methods.voting import Voting


@pytest.mark.parametrize(
    ("paper", "ours", "error", "better", "said"),
    [
        (55.0, 56.0, 3.0, "more", "within its error"),
        (55.0, 60.0, 3.0, "more", "better"),
        (55.0, 50.0, 3.0, "more", "not reproduced"),
        (1.0, 0.1, 0.0, "less", "better"),
        (4.86, 6.0, 0.3, "", "not reproduced"),
        (None, 6.0, 0.3, "", "no figure"),
        (1.0, float("nan"), 0.0, "less", "no figure"),
        (0.0, 0.0, 0.0, "less", "within its error"),
    ],
)
def test_verdicts(paper, ours, error, better, said) -> None:
    assert verdict(paper, ours, error, better) == said


@pytest.mark.parametrize(
    ("ours", "default", "better", "best", "said"),
    [
        (1.0, 0.5, "less", None, "better"),
        (1.0, 2.0, "less", None, "worse"),
        (1.0, 2.0, "more", None, "better"),
        (1.0, 1.0, "more", None, "equal"),
        (0.0, 0.0, "less", 0.0, "both perfect"),
        (1.0, None, "more", None, ""),
        (1.0, 2.0, "", None, ""),
        (float("nan"), 2.0, "more", None, ""),
    ],
)
def test_the_default_against_a_method(ours, default, better, best, said) -> None:
    assert wins(ours, default, better, best) == said


def test_the_error_of_a_share_is_that_of_both_samples() -> None:
    assert share_error(50.0, 1000, 1000) == pytest.approx(2 * 50 * np.sqrt(2 / 1000))
    assert share_error(0.0, 100, 100) > 0


def row(table, what, ours, default=None, **given):
    return Published({"a row": {"table": table, "what": what}}).row("a row", ours, default, **given)


def test_everything_is_one_markdown_and_one_json(monkeypatch) -> None:
    made = [
        row("1", "a", 1.0, 2.0, paper=1.0, better="more"),
        row("2", "b", 3.0, 2.0, paper=1.0, better="less", unit="s"),
        row("3", "c", 3.0),
    ]

    class Module:
        @staticmethod
        def rows(quick, seed):
            assert (quick, seed) == (True, papers.SEED)
            return made

    monkeypatch.setattr(papers, "PAPERS", {"One": "json", "Two": "json"})
    monkeypatch.setattr(papers, "import_module", lambda name: Module)
    result = papers.run(True, lambda line: None)
    text = result.as_text()
    assert f"seed {papers.SEED}" in text
    assert "## One" in text
    assert text.count("| 1 | a |") == 2
    out = json.loads(json.dumps(result.as_json()))
    assert out["rows"][1]["verdict"] == "not reproduced"
    assert {goal["name"]: goal["value"] for goal in out["goals"]} == {
        **{f"{p}: rows not reproduced, of 2": 1 for p in ("One", "Two")},
        **{f"{p}: rows on which the default is worse, of 2": 0 for p in ("One", "Two")},
        **{f"{p}: rows on which the default is only equal, of 2": 0 for p in ("One", "Two")},
        "processor seconds for all": out["goals"][-1]["value"],
    }


def test_every_paper_has_a_module() -> None:
    for module in papers.PAPERS.values():
        assert callable(__import__(module, fromlist=["rows"]).rows)


def by_what(made) -> dict:
    return {r["what"]: r for r in made}


def test_vega_deneb_and_sadr() -> None:
    made = by_what(stellar.rows(True, 1))
    for name in ("Vega", "Deneb", "Sadr"):
        for what in (
            "largest difference from the printed separations",
            "stars named right",
            "stars named wrong",
            "stars named right in fixed point",
            "centroids, fixed against floating",
            "separations, fixed against floating",
            "printed fixed separations met to the last bit",
        ):
            verdict_ = made[f"{name}: {what}"]["verdict"]
            assert verdict_ in ("within its error", "better"), (name, what)
    assert made["Sadr: stars named right"]["ours"] == 0
    assert made["Vega: right ascension of the centre"]["ours"] == pytest.approx(278.457, abs=0.02)
    assert made["Deneb: declination of the centre"]["ours"] == pytest.approx(46.432, abs=0.02)


def test_what_was_printed_is_whole() -> None:
    for printed in (VEGA, DENEB, SADR):
        n = len(printed.centroids)
        assert len(printed.stars) == n
        assert len(printed.separations_deg) == len(printed.fixed_deg) == n * (n - 1) // 2


@pytest.mark.timeout(900)  # it may have to wait for the patterns of small fields
def test_table_62_counts_fields_as_the_thesis_does() -> None:
    table = angle_table(6.94, 8118, None)
    none = fields.score_method(Angles(pivots=1), table, 1e-6, 1e-6, 10, 3)
    tally = fields.score_method(Angles(), table, fields.PROGRAMS, fields.PROGRAMS, 40, 3)
    assert tally["correct"] + tally["inconclusive"] + tally["incorrect"] == pytest.approx(100.0)
    assert 30 <= tally["correct"] <= 80
    assert tally["of_four"] >= tally["correct"]
    assert tally["pivots"] <= 9
    assert none["all_pivots"] <= 1
    default = triangles.by_default(table.pairs.vectors, fields.PROGRAMS, 15, 3)
    assert default["correct"] >= 70
    assert default["incorrect"] == 0


def test_voting_and_the_default_see_the_same_fields() -> None:
    made = robotic.fields(4, 20260101)
    fewer = robotic.fields(4, 20260101, brightest=6)
    for field, same in zip(made, fewer, strict=True):
        np.testing.assert_array_equal(field.detections.xy[:6], same.detections.xy)
    outcomes = [robotic.by_voting(field) for field in made]
    assert max(outcome.right for outcome in outcomes) > 50
    assert np.mean([robotic.by_default(field).right for field in made]) > 80
    assert pytest.approx(Voting().margin_px) == robotic.MARGIN_PX


def test_detectors_are_judged_on_visible_stars() -> None:
    pictures = robotic_stages.frames(1)
    assert len(pictures) == 3
    measures, seconds = robotic_stages.measured("auto", pictures[:1])
    assert measures[:2] == (1.0, 1.0)
    assert seconds > 0


def test_the_camera_comes_out_of_its_own_star_frames() -> None:
    made = by_what(robotic_stages.camera_rows(True, 5))
    for what in ("focal length", "principal point in x", "principal point in y"):
        assert made[f"calibration: error of {what}"]["verdict"] == "better"
    assert made["calibration: error of k1"]["ours"] < 0.01


def test_the_quad_tree_is_that_of_the_thesis() -> None:
    from kochab.lab.bench.papers.spherical_fields import HEIGHTS, quad_tree

    for level, height in HEIGHTS.items():
        assert quad_tree(level).height_deg == pytest.approx(height, abs=0.06)
    tree = quad_tree(5)
    assert len(tree.corners) == 1024
    assert int(tree.numbers.max()) + 1 == 514
    middle = tree.corners.sum(axis=1)
    middle /= np.linalg.norm(middle, axis=1, keepdims=True)
    assert tree.node_of(middle).tolist() == list(range(1024))
    assert tree.shared(np.array([0, 0]), np.array([0, 3])).tolist() == [3, 2]


def test_a_difference_within_its_paired_error_is_no_win() -> None:
    def one(paired):  # type: ignore[no-untyped-def]
        return row("1", "x", 14.2, 14.1, paper=14.6, better="less", paired=paired)

    assert one(None)["default_wins"] == "better"
    assert one((-0.1, 0.08))["default_wins"] == "equal within the error, paired"
    assert one((-0.1, 0.02))["default_wins"] == "better"
    assert "-0.10 +- 0.02" in one((-0.1, 0.02))["note"]


def test_the_programs_tree_leaves_out_triangles_between_nodes_that_do_not_touch() -> None:
    from kochab.lab.bench.papers.spherical_fields import quad_tree
    from kochab.lab.methods.pairs import make_pairs
    from kochab.lab.methods.spherical_triangles import make_triangles, triangles_of

    rng = np.random.default_rng(4)
    stars = rng.normal(size=(1500, 3))
    stars /= np.linalg.norm(stars, axis=1, keepdims=True)
    pairs = make_pairs(np.arange(1500), stars, np.radians(6.94))
    whole = triangles_of(pairs, make_triangles(pairs, 6.94))
    deep = triangles.by_tree(whole, quad_tree(5))
    shallow = triangles.by_tree(whole, quad_tree(4))
    assert len(shallow.stars) == len(whole.stars)
    assert 0.9 * len(whole.stars) < len(deep.stars) < len(whole.stars)
    assert set(map(tuple, deep.stars)) <= set(map(tuple, whole.stars))


def test_directions_even_in_altitude_crowd_at_the_poles() -> None:
    from kochab.lab.bench.papers.spherical_fields import random_pointing

    rng = np.random.default_rng(1)
    height = np.array([[abs(random_pointing(rng, poles)[2]) for _ in range(2000)] for poles in (0, 1)])
    near = (height > np.sin(np.radians(60.0))).mean(axis=1)
    assert near[0] == pytest.approx(1.0 - np.sin(np.radians(60.0)), abs=0.03)
    assert near[1] == pytest.approx(1.0 / 3.0, abs=0.03)


@pytest.mark.parametrize("poles", [False, True])
def test_random_pointings_are_even_on_the_sky_or_in_altitude(poles):
    """On a sphere half of all directions lie within 30 deg of the equator; of even altitudes a third does."""
    rng = np.random.default_rng(2)
    pointings = np.array([fields.random_pointing(rng, poles) for _ in range(4000)])
    np.testing.assert_allclose(np.linalg.norm(pointings, axis=1), 1.0)
    assert np.abs(pointings.mean(axis=0)).max() < 0.04
    assert (np.abs(pointings[:, 2]) < 0.5).mean() == pytest.approx(1.0 / 3.0 if poles else 0.5, abs=0.03)
