"""The report stands alone, is well formed, tells the numbers, and cannot be tricked by a name."""

import json
import re
from datetime import timedelta
from xml.etree import ElementTree

import numpy as np
import pytest

from kochab.core.errors import KochabError
from kochab.polar.horizon import Pole, Refraction
from kochab.polar.measure import MeasureSettings, measure_local
from kochab.polar.report import History, ellipses, error_over_time, report_html, write_report
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
    assert last.sigma_total_arcsec == pytest.approx(error.with_flexure.sigma_total_arcsec)
    assert np.hypot(last.noise_arcsec, last.flexure_arcsec) == pytest.approx(last.sigma_total_arcsec)
    assert f"&plusmn; {last.sigma_total_arcsec:.0f}″" in page
    assert f"{last.flexure_arcsec:.0f}″ possible flexure" in page
    assert "http" not in page
    assert "src=" not in page
    assert page.count("<svg viewBox") == 2
    total = re.search(r"class='big'>(\d+)″", page)
    assert abs(int(total[1]) - night.entries[-1].total_arcsec) < 1.0
    assert "at first" in page
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
    assert len(night.of_kind("live")) == 3  # of five within four seconds
    write_report(tmp_path / "night.html", night)
    told = json.loads((tmp_path / "night.json").read_text())
    assert told["pole"] == "true"
    assert [e["kind"] for e in told["entries"]].count("measured") == 2
    assert told["entries"][0]["time_utc"].endswith("+00:00")


def test_a_report_that_cannot_be_written_is_one_sentence(night, tmp_path):
    with pytest.raises(KochabError, match="Can't write"):
        write_report(tmp_path / "nowhere" / "night.html", night)


def test_an_empty_history_is_no_fault():
    assert "No measurement" in report_html(History())
