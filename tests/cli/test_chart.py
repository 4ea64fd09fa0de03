"""``kochab chart``: what it writes, and what it says where there is nothing to draw."""

import json

import pytest

from kochab.cli.main import main
from kochab.folders import data_folder

ORION = data_folder("resources") / "samples" / "orion.png"


@pytest.mark.parametrize("what", ["M 42", "5h35m -5d23m", str(ORION)])
def test_a_chart_is_written_and_not_written_over(what, tmp_path, capsys):
    path = tmp_path / "chart.pdf"
    assert main(["chart", what, str(path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["pdf"] == str(path)
    assert path.read_bytes().startswith(b"%PDF-")
    assert main(["chart", what, str(path)]) == 2
    assert "--overwrite" in capsys.readouterr().err
    assert main(["chart", what, str(path), "--overwrite", "--paper", "letter"]) == 0


def test_what_is_not_found_or_no_pdf_is_said(tmp_path, capsys):
    assert main(["chart", "Androgenda", str(tmp_path / "a.pdf")]) == 1
    assert "Nothing" in capsys.readouterr().out
    assert not list(tmp_path.iterdir())
    assert main(["chart", "M 42", str(tmp_path / "a.png")]) == 2
    assert main(["chart", "M 42", str(tmp_path / "a.pdf"), "--field", "200"]) == 2
    assert "shows" in capsys.readouterr().err
