"""``import kochab``: a library without a window, whose examples are true."""

import doctest
import re
import subprocess
import sys
from html.parser import HTMLParser

import numpy as np
import pytest

import kochab
from kochab.core.attitude import unit_vectors

ELLIPSIS = doctest.ELLIPSIS


@pytest.fixture
def samples(repository, monkeypatch):
    """Examples name the samples as if they lay in the current folder."""
    folder = repository / "resources" / "samples"
    monkeypatch.chdir(folder)
    return folder


@pytest.fixture(scope="module")
def orion(repository):
    return kochab.solve(repository / "resources" / "samples" / "orion.png")


def test_the_examples_of_the_docstrings_are_true(samples):
    found = doctest.testmod(kochab, optionflags=ELLIPSIS, raise_on_error=False)
    assert found.attempted > 10
    assert found.failed == 0


def test_the_examples_of_the_api_page_are_true(samples, repository):
    text = (repository / "app" / "API.md").read_text(encoding="utf-8")
    plain = "\n".join("" if line.startswith("```") else line for line in text.splitlines())
    page = doctest.DocTestParser().get_doctest(plain, {}, "API.md", "API.md", 0)
    assert doctest.DocTestRunner(optionflags=ELLIPSIS).run(page).failed == 0
    assert len(page.examples) > 25


def test_every_public_name_is_there_and_told_on_the_page(repository):
    page = (repository / "app" / "API.md").read_text(encoding="utf-8")
    for name in kochab.__all__:
        assert getattr(kochab, name) is not None
        assert name in dir(kochab)
    for name in ("solve", "identify", "detect", "read_frame", "open_catalogue"):
        assert f"kochab.{name}(" in page
    with pytest.raises(AttributeError, match="no attribute 'telescope'"):
        kochab.telescope  # noqa: B018


@pytest.mark.parametrize("block", [False, True])
def test_it_needs_no_qt(repository, block):
    code = (
        "import sys\n"
        + "sys.modules.update(dict.fromkeys(('PySide6', 'shiboken6', 'pyqtgraph')))\n" * block
        + "import kochab\n"
        "assert 'numpy' not in sys.modules\n"
        "for _ in range(2):\n"  # importing the rooms must not hide the functions
        "    solution = kochab.solve('resources/samples/pleiades.fits', timeout=60)\n"
        "    stars = kochab.detect('resources/samples/orion.png')\n"
        "    again = kochab.identify(stars.xy, stars.width, stars.height, flux=stars.flux)\n"
        "    assert isinstance(solution, kochab.Solution) and isinstance(again, kochab.Solution)\n"
        "solution.wcs\n"
        "print('QT', [n for n in sys.modules if n.startswith(('PySide6', 'shiboken6', 'pyqtgraph'))"
        " and sys.modules[n]])"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=repository, capture_output=True, text=True, timeout=200)
    assert done.stdout.strip() == "QT []", done.stdout + done.stderr


def test_a_solve_imports_nothing_that_it_does_not_use(repository):
    """Ten milliseconds of a cold process are numpy.ma's, four zipfile's, nine the tracker's, a mount's and hashlib's."""
    code = (
        "import sys\n"
        "from kochab.cli.main import main\n"
        "main(['solve', 'resources/samples/pleiades.fits', '--no-worker', '--json'])\n"
        "unused = {'numpy.ma', 'zipfile', 'scipy', 'astropy', '_hashlib', 'kochab.core.mount', 'kochab.sky.elements'}\n"
        "print(sorted(unused & {*sys.modules}))"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=repository, capture_output=True, text=True, timeout=200)
    assert done.stdout.splitlines()[-1] == "[]", done.stdout[-200:] + done.stderr


def test_the_package_says_that_it_is_typed(repository):
    assert (repository / "app" / "kochab" / "py.typed").exists()


def test_an_array_is_solved_as_its_file_is(orion, samples):
    pixels = kochab.read_frame("orion.png").pixels
    for array in (pixels, pixels.astype(">f8"), np.dstack([pixels] * 3), pixels.tolist()):
        found = kochab.solve(array)
        assert found.ra_dec_deg == pytest.approx(orion.ra_dec_deg, abs=1e-4)


def test_a_mirrored_array_is_solved_and_told(orion, samples):
    pixels = kochab.read_frame("orion.png").pixels[:, ::-1]
    found = kochab.solve(pixels)
    assert found.camera.mirrored
    assert not orion.camera.mirrored
    assert found.ra_dec_deg == pytest.approx(orion.ra_dec_deg, abs=1e-3)


@pytest.mark.parametrize(
    ("array", "complaint"),
    [
        (np.zeros(5), r"shape \(5,\) is not an image"),
        (np.zeros((0, 5)), "is not an image"),
        (np.full((90, 90), np.nan), "The array holds no pixel with a value"),
        (np.zeros((90, 90), dtype=complex), "The array holds samples that are not real"),
    ],
)
def test_what_is_no_image_is_refused(array, complaint):
    with pytest.raises(kochab.FrameError, match=complaint):
        kochab.solve(array)


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        ({"fov": 0}, "fov is 0"),
        ({"fov": float("nan")}, "fov is nan"),
        ({"scale": -1}, "scale is -1"),
        ({"near": (10, 95, 3)}, "near is"),
        ({"near": (10, 5, 0)}, "near is"),
        ({"near": (5040, 5, 9)}, "near is"),
        ({"method": "guess"}, "There is no method 'guess'"),
        ({"detector": "eyes"}, "There is no detector 'eyes'"),
    ],
)
def test_arguments_that_cannot_be_used_are_refused(options, complaint, samples):
    with pytest.raises(kochab.UsageError, match=complaint):
        kochab.solve(np.zeros((90, 90)), **options)


def test_hints_and_methods_reach_the_solver(samples):
    found = kochab.solve("orion.png", fov=15, method="voting", attitude="quest")
    assert isinstance(found, kochab.Solution)
    assert found.method == "voting"
    lost = kochab.solve("orion.png", near=(264, 1, 5), scale=50.3, blind_after_hint=False)
    assert isinstance(lost, kochab.NoSolution)
    wrapped = kochab.solve("orion.png", near=(444, -1.5, 5), scale=50.3, blind_after_hint=False)
    assert wrapped.ra_dec_deg == pytest.approx((84.0, -1.5), abs=0.01)


def test_bare_lists_must_be_pairs():
    for xy, flux in ((np.zeros((4, 3)), None), (np.zeros(4), None), (np.zeros((4, 2)), np.ones(3))):
        with pytest.raises(kochab.UsageError, match="xy must be"):
            kochab.identify(xy, 100, 100, flux=flux)
    with pytest.raises(kochab.UsageError, match="0 x 100 px"):
        kochab.identify(np.ones((4, 2)), 0, 100)


def test_the_wcs_is_the_solution_s_own_projection(samples):
    """Of a lens that distorts, at corners and middles of the sides, against astropy."""
    found = kochab.solve("southern-cross.jpg")
    assert found.camera.distorted
    assert found.wcs.pixel_shape == (found.camera.width, found.camera.height)
    x, y = np.meshgrid([0, 0.5, 1], [0, 0.5, 1])
    size = np.array([found.camera.width - 1, found.camera.height - 1])
    pixels = np.stack([x.ravel(), y.ravel()], axis=1) * size
    theirs = unit_vectors(*found.wcs.all_pix2world(pixels, 0).T)
    off_px = np.linalg.norm(theirs - found.sky_at(pixels), axis=1) * found.camera.focal_px
    assert off_px.max() < 0.02


class Text(HTMLParser):
    """The words of a page, and that its tags are closed in order."""

    def __init__(self):
        super().__init__()
        self.open, self.words = [], []

    def handle_starttag(self, tag, attrs):
        self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words.append(data)


def words(shown):
    page = Text()
    page.feed(shown._repr_html_())
    assert not page.open
    return " | ".join(page.words)


def test_a_notebook_shows_the_solution(orion):
    told = words(orion)
    assert "05h 36m 00" in told
    assert "15.00° × 10.03°" in told
    assert "Uncertainty (1σ)" in told
    assert re.search("1 in 10[⁰¹²³⁴-⁹]{2}", told)
    assert told.index("Alnilam") < told.index("Mintaka")


def test_a_notebook_shows_why_there_is_none():
    told = words(kochab.NoSolution(kochab.Reason.TRAILED, "Track <the sky>.", measured={"fwhm_px": 4.5}))
    assert "trailed" in told
    assert "Track <the sky>." in told
    assert "fwhm px | 4.5" in told
