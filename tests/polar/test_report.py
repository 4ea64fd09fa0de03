"""The report stands alone, is well formed, tells the numbers, and cannot be tricked by a name."""

import json
import re
from datetime import timedelta
from xml.etree import ElementTree

import numpy as np
import pytest

from kochab.core.errors import KochabError
from kochab.polar.measure import MeasureSettings, measure_local
from kochab.polar.pole import Pole
from kochab.polar.report import Entry, History, ellipses, error_over_time, report_html, write_report
from kochab.sky.horizon import Refraction
from tests.polar.mounts import WHEN, Mount


def measured(d_alt, d_az, turns=(0, 30, 60, 90)):
    mount = Mount(48.0, d_alt, d_az)
    settings = MeasureSettings(mount.site, Pole.TRUE, Refraction(pressure_hpa=0.0))
    return measure_local(mount.see(turns, np.random.default_rng(1)), settings)


@pytest.fixture
def night():
    history = History()
    history.measured(measured(2000.0, -1500.0, (0, 10, 20)))
    for k in range(5):
        error = measured(1500.0 - 300 * k, -900.0 + 200 * k).error
        history.live(WHEN + timedelta(minutes=10, seconds=k), error)
    history.instruction(WHEN + timedelta(minutes=10), error, "Altitude <b>bolt</b>: a quarter turn.")
    history.measured(measured(15.0, -10.0))
    return history


def test_the_page_needs_nothing_else_and_tells_the_end(night):
    page = report_html(night)
    last, error = night.entries[-1], measured(15.0, -10.0).error
    assert last.sigma_total_arcsec == pytest.approx(error.with_systematics.sigma_total_arcsec)
    assert np.hypot(last.noise_arcsec, last.flexure_arcsec) == pytest.approx(last.sigma_total_arcsec)
    assert f"&plusmn; {last.sigma_total_arcsec:.0f}″" in page
    assert f"{last.flexure_arcsec:.0f}″ possible flexure" in page
    assert "http" not in page
    assert "src=" not in page
    assert page.count("<svg viewBox") == 2
    total = re.search(r"class='big'>(\d+)″", page)
    assert abs(int(total[1]) - night.entries[-1].total_arcsec) < 1.0
    assert "At first" in page
    assert "&lt;b&gt;bolt" in page
    assert "<b>" not in page


def test_the_drawings_are_well_formed_and_show_every_measurement(night):
    for draw in (error_over_time, ellipses):
        tree = ElementTree.fromstring(draw(night.entries))
        assert tree.tag == "svg"
    drawn = ElementTree.fromstring(ellipses(night.entries)).findall(".//ellipse")
    assert len(drawn) == 3  # both, and the last one again close by
    assert float(drawn[0].get("rx")) >= float(drawn[1].get("rx"))  # it shrank
    assert float(drawn[2].get("rx")) > 3 * float(drawn[1].get("rx"))
    assert ellipses([]) == error_over_time([]) == ""


def test_live_errors_are_kept_sparsely_and_all_goes_to_json(night, tmp_path):
    assert sum(entry.kind == "live" for entry in night.entries) == 3  # of five within four seconds
    write_report(tmp_path / "night.html", night)
    assert (tmp_path / "night.html").read_text(encoding="utf-8") == report_html(night)
    told = json.loads((tmp_path / "night.json").read_text())
    assert told["pole"] == "true"
    assert [e["kind"] for e in told["entries"]].count("measured") == 2
    assert told["entries"][0]["time_utc"].endswith("+00:00")


def test_a_report_that_cannot_be_written_is_one_sentence(night, tmp_path):
    with pytest.raises(KochabError, match="Can't write"):
        write_report(tmp_path / "nowhere" / "night.html", night)


def test_an_empty_history_is_no_fault():
    assert "No measurement" in report_html(History())


# -- The drawings' geometry: what stands where, in units of the drawing -------------------------


def entry(kind="measured", altitude=0.0, azimuth=0.0, minute=0.0, ellipse=(60.0, 20.0, 0.3), sigma=0.0):
    """One entry whose numbers are given; azimuth on the sky."""
    when, total = WHEN + timedelta(minutes=minute), float(np.hypot(altitude, azimuth))
    return Entry(when, kind, altitude, azimuth, azimuth, total, (1.0, 1.0), ellipse, sigma_total_arcsec=sigma)


def shape(element):
    return {name: float(value) for name, value in element.items() if name not in ("class", "transform")}


def test_the_axes_stand_around_the_pole_as_seen_from_behind_the_mount():
    """Too high is up, too far clockwise to the right; rings and ellipses have one scale."""
    tree = ElementTree.fromstring(ellipses([entry(altitude=400.0, azimuth=-300.0)]))
    (panel,) = tree.findall("g")
    assert panel.get("transform") == "translate(160,160)"
    (ellipse,) = panel.findall("ellipse")
    x, y, turned = map(float, re.findall(r"-?[\d.]+", ellipse.get("transform")))
    rings = [float(ring.get("r")) for ring in panel.findall("circle")]
    names = [text.text for text in panel.findall("text")]
    scale = rings[0] / 60.0
    assert names == ["1′", "5′", "1"]
    assert rings[1] / rings[0] == pytest.approx(5.0, rel=1e-3)
    assert (x, y) == pytest.approx((-300.0 * scale, -400.0 * scale), rel=1e-3)
    assert (float(ellipse.get("rx")), float(ellipse.get("ry"))) == pytest.approx((60.0 * scale, 20.0 * scale), rel=2e-3)
    assert turned == pytest.approx(-np.degrees(0.3), abs=0.01)  # y runs down in a drawing
    assert np.hypot(x, y) + 60.0 * scale <= 160.0 < 1.2 * (np.hypot(x, y) + 60.0 * scale)


@pytest.mark.parametrize(("first", "panels"), [(100.0, 1), (700.0, 2)])
def test_an_end_much_nearer_than_the_start_is_drawn_again_close_by(first, panels):
    """From twice as far on: both ends of the last ellipse stay in its panel, the others are left out."""
    tree = ElementTree.fromstring(ellipses([entry(altitude=first), entry(altitude=150.0, ellipse=(30.0, 10.0, 0.0))]))
    assert tree.get("viewBox") == f"0 0 {320 * panels} 320"
    drawn = [[text.text for text in panel.findall("text")][-2:] for panel in tree.findall("g")]
    assert drawn[0] == ["1", "2"]
    if panels == 2:
        close = tree.findall("g")[1]
        assert close.get("transform") == "translate(480,160)"
        (ellipse,) = close.findall("ellipse")
        y, r = float(re.findall(r"-?[\d.]+", ellipse.get("transform"))[1]), float(ellipse.get("rx"))
        assert -160.0 < y - r < -130.0


def test_a_perfect_end_still_shows_the_innermost_ring():
    panel = ElementTree.fromstring(ellipses([entry(ellipse=(0.1, 0.1, 0.0))])).find("g")
    assert [text.text for text in panel.findall("text")] == ["30″", "1"]
    assert shape(panel.find("ellipse")) == {"rx": 1.5, "ry": 1.5}  # small, yet seen


def test_the_error_falls_over_time_on_a_logarithmic_scale():
    """A tenth of the error is as far below everywhere; the bar is one sigma each way."""
    entries = [
        entry(altitude=1000.0, sigma=500.0),
        entry("instruction", altitude=5.0, minute=1.0),
        entry("live", altitude=100.0, minute=10.0),
        entry(altitude=10.0, minute=20.0, sigma=2.0),
    ]
    tree = ElementTree.fromstring(error_over_time(entries))
    line = [tuple(map(float, point.split(","))) for point in tree.find("polyline").get("points").split()]
    assert [x for x, _ in line] == [48.0, 320.0, 592.0]
    steps = np.diff([y for _, y in line])
    assert steps[0] == pytest.approx(steps[1], abs=0.2)
    decade = steps[0]
    assert 48.0 < line[0][1] < line[2][1] < 232.0
    bars = [shape(bar) for bar in tree.findall("line") if bar.get("class") == "bar"]
    dots = [shape(dot) for dot in tree.findall("circle")]
    assert [(dot["cx"], dot["cy"]) for dot in dots] == [line[0], line[2]]
    assert dots[0]["cy"] - bars[0]["y1"] == pytest.approx(decade * np.log10(1.5), abs=0.2)
    assert bars[0]["y2"] - dots[0]["cy"] == pytest.approx(decade * np.log10(2.0), abs=0.2)
    assert (bars[0]["x1"], bars[0]["x2"]) == (48.0, 48.0)
    rings = {ring: shape(grid)["y1"] for ring, grid in zip([1, 10, 30, 60, 300], tree.findall("line"), strict=False)}
    assert rings[1] == pytest.approx(232.0)
    assert rings[1] - rings[10] == pytest.approx(decade, abs=0.2)
    assert rings[10] == pytest.approx(line[2][1], abs=0.1)
    assert tree.findall("text")[-1].text == "20 min"


def test_a_single_reading_and_one_below_an_arcsecond_are_drawn():
    tree = ElementTree.fromstring(error_over_time([entry(altitude=0.2, sigma=0.1)]))
    dot = shape(tree.find("circle"))
    assert (dot["cx"], dot["cy"]) == (48.0, 232.0)
    assert tree.findall("text")[-1].text == "1 min"


def test_live_errors_two_seconds_apart_are_kept_whichever_way_the_clock_goes():
    history, error = History(), measured(100.0, 0.0).error
    for seconds in (0.0, 1.9, 2.0, 3.9, 0.0):
        history.live(WHEN + timedelta(seconds=seconds), error)
    assert [(e.time_utc - WHEN).total_seconds() for e in history.entries] == [0.0, 2.0, 0.0]


def test_the_page_says_where_when_and_how_it_began(night):
    page = report_html(night)
    first, last = night.entries[0], night.entries[-1]
    assert "Latitude 48.000°, longitude 10.000°." in page
    assert f"At first {first.total_arcsec / 60.0:.1f}′." in page
    assert f"{last.time_utc:%Y-%m-%d %H:%M} UTC" in page
    assert page.count("<tr>") == 1 + 3  # two measurements and an instruction
    assert f"{first.altitude_arcsec:+.0f}&Prime; &plusmn; {first.sigma_arcsec[0]:.0f}" in page
    assert f"{last.azimuth_on_sky_arcsec:+.0f}&Prime; &plusmn; {last.sigma_arcsec[1]:.0f}" in page
