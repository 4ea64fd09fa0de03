"""A decimal number means the same with a point and with a comma, in every country."""

import errno
import locale
import os
import sys

import pytest
from PySide6.QtCore import QLocale, Qt
from PySide6.QtTest import QTest

from kochab.window.panels.method_options import MethodGroup
from kochab.window.widgets import number_field, use_plain_numerals


@pytest.fixture(params=["de_DE", "fr_FR", "ar_EG", "en_US"])
def abroad(request):
    before = QLocale()
    QLocale.setDefault(QLocale(request.param))
    use_plain_numerals()
    yield
    QLocale.setDefault(before)


@pytest.mark.parametrize("text", ["0.5", "0,5"])
def test_point_and_comma_are_the_same_number(qtbot, abroad, text):
    box = number_field("Share", 0.0, 99.0, 1.0, 2)
    qtbot.addWidget(box)
    box.show()
    box.selectAll()
    QTest.keyClicks(box, text)
    QTest.keyClick(box, Qt.Key.Key_Return)
    assert (box.value(), box.text()) == (0.5, "0.50")


def test_an_option_of_a_method_takes_a_comma(qtbot):
    group = MethodGroup(["patterns", "triads"], ["auto"])
    qtbot.addWidget(group)
    group.method.setCurrentText("triads")
    fields = group.options.fields
    fields["separation_deg"].setText("0,05")
    fields["dec_deg"].setText("-10,5;60")
    assert group.choices()["method_options"] == {"separation_deg": 0.05, "dec_deg": (-10.5, 60.0)}
    fields["dec_deg"].setText("-10,60")
    assert group.choices()["method_options"]["dec_deg"] == (-10.0, 60.0)


@pytest.mark.skipif(sys.platform == "win32", reason="Windows translates no strerror")
def test_the_system_reports_its_errors_in_english_in_every_country(qapp):
    """Qt takes the system's language over for C, and so do the errors of a file."""
    before = locale.setlocale(locale.LC_ALL)
    try:
        locale.setlocale(locale.LC_ALL, "de_DE.UTF-8")
    except locale.Error:
        pytest.skip("the locale de_DE.UTF-8 is not installed (package locales)")
    try:
        assert os.strerror(errno.ENOENT) == "Datei oder Verzeichnis nicht gefunden"
        use_plain_numerals()
        assert os.strerror(errno.ENOENT) == "No such file or directory"
        assert locale.localeconv()["decimal_point"] == "."
    finally:
        locale.setlocale(locale.LC_ALL, before)
