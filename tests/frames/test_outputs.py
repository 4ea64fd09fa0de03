"""No output costs a person a file: never an input, another only when it was asked for."""

import ntpath
import os
from pathlib import Path

import pytest

from kochab.cli.main import main
from kochab.core.errors import UsageError
from kochab.frames.outputs import is_solution_file, refuse_input, refuse_overwriting, spelling


@pytest.fixture
def night(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "night.jpg"
    path.write_bytes(b"a person's only copy")
    return path


def linked(link: Path, to: str | Path) -> Path:
    """A symbolic link, where the system makes one."""
    link.symlink_to(to, target_is_directory=Path(to).is_dir())
    if not link.is_symlink():  # Wine 10: CreateSymbolicLinkW does nothing and says it is done
        pytest.skip("this system says that it made a symbolic link, and made none")
    return link


def other_name(night: Path, kind: str) -> str:
    """The same file called otherwise."""
    folder = night.parent
    if kind == "symlink":
        return str(linked(folder / "link.jpg", night))
    if kind == "hard link":
        os.link(night, folder / "hard.jpg")
        return str(folder / "hard.jpg")
    if kind == "through a folder":
        (folder / "there").mkdir()
        return str(folder / "there" / ".." / "night.jpg")
    if kind == "link to a link":
        linked(folder / "first.jpg", "night.jpg")
        return linked(folder / "second.jpg", "first.jpg").name
    if kind == "linked folder":
        return str(linked(folder / "there", folder) / "NIGHT.jpg")
    return {
        "itself": str(night),
        "relative": "./night.jpg",
        "case": str(folder / "Night.JPG"),
        "dots": f"{night}. .",  # to Windows the same file
    }[kind]


KINDS = [
    "itself",
    "relative",
    "through a folder",
    "symlink",
    "link to a link",
    "linked folder",
    "hard link",
    "case",
    "dots",
]


@pytest.mark.parametrize("overwrite", [False, True])
@pytest.mark.parametrize("kind", KINDS)
def test_an_input_is_never_overwritten(night, kind, overwrite) -> None:
    with pytest.raises(UsageError, match="is an input file and is never overwritten"):
        refuse_overwriting([other_name(night, kind)], ["absent.fits", night], overwrite)


@pytest.mark.parametrize("more", [[], ["--overwrite"], ["--json", "--workers", "2"]])
@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "dots"])  # which is no picture's name
def test_solve_refuses_to_annotate_over_its_frame(night, kind, more, capsys, monkeypatch) -> None:
    monkeypatch.setattr("kochab.workflows.solve_frame.solve_file", None)  # nothing is solved before that
    assert main(["solve", str(night), "--annotate", other_name(night, kind), *more]) == 2
    err = capsys.readouterr().err
    assert "never overwritten" in err
    assert err.count("\n") == 1
    assert night.read_bytes() == b"a person's only copy"


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (r"C:\Astro\night.jpg", "c:/ASTRO/Night.JPG"),
        (r"C:\Astro\night.jpg", r"C:\Astro\there\..\night.jpg"),
        (r"C:\Astro\night.jpg", r"C:\Astro\night.jpg."),
        (r"\\NAS\share\night.jpg", "//nas/Share/NIGHT.jpg"),
        ("C:\\Astro\\n\u00e4chte.jpg", "C:\\Astro\\na\u0308chte.jpg"),
    ],
)
def test_windows_and_macos_have_many_names_for_one_file(one, other) -> None:
    """By Python's own rules of Windows' names, which it carries on every system."""
    assert spelling(one, ntpath) == spelling(other, ntpath)
    assert spelling(one, ntpath) != spelling(r"C:\Astro\night2.jpg", ntpath)


def test_a_name_that_leads_nowhere_is_no_input(night) -> None:
    (night.parent / "round.jpg").symlink_to("round.jpg")
    for name in ("round.jpg", "a\0b"):
        refuse_input(name, [night])


def test_another_file_is_replaced_only_when_asked(night, capsys) -> None:
    mine = night.with_name("mine.png")
    mine.write_bytes(b"drawn by hand")
    assert main(["solve", str(night), "--annotate", str(mine)]) == 2
    err = capsys.readouterr().err
    assert err == f"kochab: {mine} exists already: name another file, or add --overwrite to replace it.\n"
    assert mine.read_bytes() == b"drawn by hand"
    assert main(["solve", str(night), "--annotate", str(mine), "--overwrite"]) == 2
    assert "mine.png" not in capsys.readouterr().err  # the frame is damaged, and that is all


def test_pictures_into_a_folder_spare_what_is_there(night, capsys) -> None:
    out = night.with_name("out")
    out.mkdir()
    (out / "night.jpg.png").write_bytes(b"mine")
    assert main(["solve", str(night), "--annotate", str(out)]) == 2
    assert "exists already" in capsys.readouterr().err
    (out / "night.jpg.png").unlink()
    (night.parent / "b").mkdir()
    second = night.parent / "b" / "night.jpg"
    second.write_bytes(b"another night")
    assert main(["solve", str(night), str(second), "--annotate", str(out)]) == 2
    assert "would be the image of both" in capsys.readouterr().err


@pytest.mark.parametrize("command", [["solve"], ["identify", "--width", "900", "--height", "600"]])
def test_a_sidecar_spares_what_no_solver_wrote(night, command, capsys) -> None:
    sidecar = Path(f"{night}.wcs")
    sidecar.write_text("notes of mine")
    assert main([*command, str(night), "--wcs"]) == 2
    assert "night.jpg.wcs exists already" in capsys.readouterr().err
    assert sidecar.read_text() == "notes of mine"
    assert main([*command, str(night), str(sidecar), "--wcs", "--overwrite"]) == 2
    assert "never overwritten" in capsys.readouterr().err


def test_what_a_solver_wrote_may_be_renewed(tmp_path) -> None:
    def card(name: str, value: str) -> str:
        return f"{name:8}= {value:>20}".ljust(80)

    head = card("SIMPLE", "T") + card("BITPIX", "8")
    answer = tmp_path / "a.wcs"
    answer.write_text(head + card("NAXIS", "0") + card("PLTSOLVD", "T"))
    assert is_solution_file(answer)
    assert not is_solution_file(answer, own=True)  # as ASTAP writes it
    answer.write_text("PLTSOLVD=F\nERROR=no stars\n")
    assert is_solution_file(answer)
    solved_frame = tmp_path / "b.wcs"  # pixels and all
    solved_frame.write_text(head + card("NAXIS", "2") + card("PLTSOLVD", "T"))
    assert not is_solution_file(solved_frame)
    assert not is_solution_file(tmp_path)
    assert not is_solution_file(tmp_path / "absent")


def test_devices_and_folders_are_no_files_to_lose(night) -> None:
    refuse_overwriting([os.devnull, night.parent, night.with_name("new.png")], [night])
    refuse_input("new.fits", ["", night])


@pytest.mark.parametrize("ending", ["html", "json"])
def test_a_polar_report_spares_what_is_there(night, ending, capsys, monkeypatch) -> None:
    monkeypatch.setattr("kochab.cli.polar.solutions_of", None)
    mine = night.with_name(f"report.{ending}")
    mine.write_text("mine")
    files = [str(night), str(night)]
    assert main(["polar", *files, "--report", str(night.with_name("report.html"))]) == 2
    assert f"report.{ending} exists already" in capsys.readouterr().err
    assert main(["polar", *files, "--report", str(night), "--overwrite"]) == 2
    assert "never overwritten" in capsys.readouterr().err


def test_astap_spares_the_frame_and_what_no_solver_wrote(night, capsys, monkeypatch) -> None:
    monkeypatch.setattr("kochab.frames.reading", None)
    notes = night.with_suffix(".ini")
    notes.write_text("[mine]\n")
    assert main(["-f", str(night)]) == 1
    assert "no solver wrote it" in capsys.readouterr().err
    assert notes.read_text() == "[mine]\n"
    frame = night.rename(night.with_suffix(".wcs"))
    asked = ["-f", str(frame), "-o", str(night.with_suffix(""))]
    assert main(asked) == 1
    assert frame.read_bytes() == b"a person's only copy"
    notes.write_text("PLTSOLVD=T\n")  # of an earlier frame: a program that reads it would go there
    assert main(asked) == 1
    assert notes.read_text().startswith("PLTSOLVD=F")
    assert frame.read_bytes() == b"a person's only copy"
    picture = frame.rename(night.with_name(f"{night.stem}_annotated.jpg"))
    asked = ["-annotate", "-f", str(picture), "-o", str(night.with_suffix(""))]
    assert main(asked) == 1
    assert "is an input file" in notes.read_text()
    assert picture.read_bytes() == b"a person's only copy"


def test_catalogues_spare_what_is_there(night, capsys, monkeypatch) -> None:
    (night.parent / "names.tsv").write_text("mine")
    build = ["catalog", "build", "--sources", str(night.parent), "--out", str(night.parent)]
    assert main(build) == 2
    assert "names.tsv exists already" in capsys.readouterr().err
    monkeypatch.setattr("platformdirs.user_data_path", lambda *_, **__: night.parent)
    (night.parent / "catalogs" / "deep").mkdir(parents=True)
    assert main(["catalog", "import", str(night), "--name", "deep"]) == 2
    assert "choose another --name, or add --overwrite" in capsys.readouterr().err
