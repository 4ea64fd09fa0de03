"""The report's drawings to the tenth of a unit: rings, numbers, bars and what is left out."""

import re
from datetime import timedelta
from xml.etree import ElementTree

import numpy as np
import pytest

from kochab.core.frame import Site
from kochab.polar.report import Entry, History, ellipses, error_over_time, report_html
from tests.polar.mounts import WHEN


def entry(kind="measured", altitude=0.0, azimuth=0.0, minute=0.0, ellipse=(60.0, 20.0, 0.3), sigma=0.0, text=""):
    when, total = WHEN + timedelta(minutes=minute), float(np.hypot(altitude, azimuth))
    return Entry(when, kind, altitude, 2.0 * azimuth, azimuth, total, (3.0, 4.0), ellipse, text, sigma, 5.0, 6.0)


def panel_of(*entries):
    return ElementTree.fromstring(ellipses(entries)).findall("g")


def numbers(text):
    return [float(n) for n in re.findall(r"-?[\d.]+", text)]


@pytest.mark.parametrize("total", [20.0, 100.0, 700.0, 5000.0, 40000.0])
def test_rings_stand_at_their_distances_with_their_names_above(total):
    """The panel reaches 15 % beyond the end of the ellipse; rings nearer than 14 units to the pole are left out."""
    (panel,) = panel_of(entry(altitude=total, ellipse=(50.0, 20.0, 0.0)))
    scale = 160.0 / (max(total + 50.0, 30.0) * 1.15)
    names = {30.0: "30″", 60.0: "1′", 300.0: "5′", 1800.0: "30′", 7200.0: "2°", 36000.0: "10°"}
    shown = [ring for ring in names if 14.0 < ring * scale < 160.0]
    rings = panel.findall("circle")
    texts = panel.findall("text")
    assert [float(ring.get("r")) for ring in rings] == pytest.approx([r * scale for r in shown], abs=0.006)
    assert [text.text for text in texts] == [*(names[r] for r in shown), "1"]
    assert [float(t.get("x")) for t in texts[:-1]] == [3.0] * len(shown)
    assert [float(t.get("y")) for t in texts[:-1]] == pytest.approx([-r * scale - 3.0 for r in shown], abs=0.06)
    assert panel.find("path").get("d") == "M-6,0H6M0,-6V6"


def test_an_ellipse_has_its_number_beside_it_and_is_never_thinner_than_it_can_be_seen():
    (panel,) = panel_of(entry(altitude=400.0, azimuth=-300.0, ellipse=(60.0, 0.1, 0.3)))
    scale = 160.0 / (560.0 * 1.15)
    (ellipse,) = panel.findall("ellipse")
    assert float(ellipse.get("rx")) == pytest.approx(60.0 * scale, abs=0.006)
    assert ellipse.get("ry") == "1.50"
    x, y, turned = numbers(ellipse.get("transform"))
    assert (x, y, turned) == pytest.approx((-300.0 * scale, -400.0 * scale, -np.degrees(0.3)), abs=0.006)
    number = panel.findall("text")[-1]
    assert (float(number.get("x")), float(number.get("y"))) == pytest.approx((x + 6.0, y - 6.0), abs=0.06)


@pytest.mark.parametrize(
    ("altitude", "azimuth"), [(1000.0, 0.0), (-1000.0, 0.0), (0.0, 1000.0), (0.0, -1000.0), (1000.0, 1000.0)]
)
def test_close_by_only_what_stands_in_the_panel_is_drawn(altitude, azimuth):
    """Both panels count alike: the second measurement is number 2 in each."""
    whole, close = panel_of(entry(altitude=altitude, azimuth=azimuth), entry(altitude=100.0, ellipse=(20.0, 20.0, 0.0)))
    assert len(whole.findall("ellipse")) == 2
    assert len(close.findall("ellipse")) == 1
    assert close.findall("text")[-1].text == "2"
    rest = 160.0 / (120.0 * 1.15)
    assert numbers(close.find("ellipse").get("transform"))[1] == pytest.approx(-100.0 * rest, abs=0.006)
    wide = 160.0 / ((np.hypot(altitude, azimuth) + 60.0) * 1.1)
    assert numbers(whole.findall("ellipse")[1].get("transform"))[1] == pytest.approx(-100.0 * wide, abs=0.006)


@pytest.mark.parametrize(("widest", "panels"), [(2.29, 1), (2.31, 2)])
def test_the_last_axis_is_drawn_close_by_when_the_panel_is_twice_as_wide_as_it_needs(widest, panels):
    last = entry(altitude=80.0, ellipse=(20.0, 20.0, 0.0))
    first = entry(altitude=widest * 100.0 - 20.0, ellipse=(20.0, 20.0, 0.0))
    assert len(panel_of(first, last)) == panels


# -- The error over time ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("total", "names"),
    [
        (5.0, ["1″", "10″", "30″", "1′"]),
        (400.0, ["1″", "10″", "30″", "1′", "5′"]),
        (8000.0, ["1″", "10″", "30″", "1′", "5′", "30′", "2°"]),
        (40000.0, ["1″", "10″", "30″", "1′", "5′", "30′", "2°", "10°"]),
    ],
)
def test_the_grid_has_the_round_angles_up_to_the_largest_error(total, names):
    """A tenth of a decade above it, and a hundred arcseconds at least; five pixels from the left."""
    tree = ElementTree.fromstring(error_over_time([entry(altitude=total), entry(altitude=total, minute=30.0)]))
    assert tree.get("viewBox") == "0 0 640 280"
    high = max(np.log10(total) + 0.1, 2.0)
    arcsec = np.array([1.0, 10.0, 30.0, 60.0, 300.0, 1800.0, 7200.0, 36000.0])[: len(names)]
    ys = 232.0 - 184.0 * np.log10(arcsec) / high
    lines = [line for line in tree.findall("line") if line.get("class") == "ring"]
    texts = tree.findall("text")
    assert [t.text for t in texts] == [*names, "30 min"]
    assert [float(line.get("y1")) for line in lines] == pytest.approx(ys, abs=0.06)
    assert [float(line.get("y2")) for line in lines] == pytest.approx(ys, abs=0.06)
    assert {(line.get("x1"), line.get("x2")) for line in lines} == {("48", "592")}
    assert [float(t.get("y")) for t in texts[:-1]] == pytest.approx(ys + 4.0, abs=0.06)
    assert {t.get("x") for t in texts[:-1]} == {"4"}
    assert (texts[-1].get("x"), texts[-1].get("y")) == ("562", "266")


@pytest.mark.parametrize(("minutes", "across"), [([0.0, 0.5], 1.0), ([0.0, 4.0, 2.0], 4.0)])
def test_the_time_goes_from_the_first_reading_to_the_last_a_minute_at_least(minutes, across):
    shown = [entry("live", 100.0, minute=m) for m in minutes]
    tree = ElementTree.fromstring(error_over_time([entry("instruction", 9.0, minute=-7.0), *shown]))
    line = [tuple(map(float, point.split(","))) for point in tree.find("polyline").get("points").split()]
    assert [x for x, _ in line] == pytest.approx([48.0 + 544.0 * m / across for m in minutes], abs=0.06)
    assert not tree.findall("circle")  # only what was measured has a dot and a bar


# -- The page -----------------------------------------------------------------------------------------


def test_every_number_of_the_page_stands_where_it_belongs():
    history = History(site=Site(-33.4567, 151.2, 100.0))
    history.entries += [
        entry(altitude=300.0, azimuth=400.0, sigma=25.0, text="It sags."),
        entry("live", 50.0, minute=1.0, text="not told"),
        entry("instruction", 30.0, 40.0, 2.0, text="Turn it."),
        entry(altitude=-3.0, azimuth=4.0, minute=3.0, sigma=2.0),
    ]
    page = report_html(history)
    assert "<p class='big'>5″ &plusmn; 2″</p>" in page
    assert "<p>From the refracted pole, 2026-03-14 20:03 UTC. At first 8.3′. Latitude -33.457°, longitude" in page
    assert "longitude 151.200°.</p>" in page
    assert "<p>Uncertainty: 5″ measurement, 6″ possible flexure.</p>" in page
    rows = re.findall(r"<tr>(.*?)</tr>", page)
    assert re.findall(r"<th>(.*?)</th>", rows[0]) == ["UTC", "Total", "Altitude", "Azimuth on the sky", ""]
    cells = [re.findall(r"<td>(.*?)</td>", row) for row in rows[1:]]
    assert cells == [
        ["20:00:00", "8.3′", "+300&Prime; &plusmn; 3", "+400&Prime; &plusmn; 4", "Measured. It sags."],
        ["20:02:00", "50″", "+30&Prime; &plusmn; 3", "+40&Prime; &plusmn; 4", "Turn it."],
        ["20:03:00", "5″", "-3&Prime; &plusmn; 3", "+4&Prime; &plusmn; 4", "Measured. "],
    ]
    alone = History(entries=[entry(altitude=7.0, sigma=1.0)])
    assert "At first" not in report_html(alone)
    assert "Latitude" not in report_html(alone)
