"""What installed programs leave out, against what Kochab imports."""

import ast
import importlib
import os
import re
import subprocess
import sys
from fnmatch import fnmatchcase

import pytest

from tests import house

THEIRS = ("PySide6", "scipy", "astropy", "PIL")


@pytest.fixture(scope="module")
def left_out(packaged):
    return packaged("left_out.py")


@pytest.fixture(scope="module")
def imported():
    """Every module of theirs that a line of Kochab imports, with the names taken from it."""
    found = set()
    for text in house.sources().values():
        for node in ast.walk(house.parsed(text)) if any(name in text for name in THEIRS) else ():
            if isinstance(node, ast.Import):
                found |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
                found |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
    return found


def test_every_module_of_qt_that_is_imported_is_kept(left_out, imported):
    modules = {name.split(".")[1] for name in imported if name.startswith("PySide6.")}
    assert len(modules) >= 4
    for name in modules:
        for path in (
            f"PySide6/{name}.abi3.so",
            f"PySide6/{name}.pyd",
            f"PySide6/Qt/lib/lib{name.replace('Qt', 'Qt6')}.so.6",
        ):
            assert left_out.reason(path) is None, path


def test_every_part_of_scipy_that_is_imported_is_kept(left_out, imported):
    parts = {name.split(".")[1] for name in imported if re.match(r"scipy\.[a-z]", name)}
    assert {"spatial", "special"} <= parts
    for part in parts:
        assert left_out.reason(f"scipy/{part}/__init__.py") is None, part
        assert left_out.reason(f"scipy/{part}/_some.cpython-311-x86_64-linux-gnu.so") is None, part


def test_every_part_of_astropy_that_is_imported_is_kept(left_out, imported):
    for part in {name.split(".")[1] for name in imported if name.startswith("astropy.")}:
        assert left_out.reason(f"astropy/{part}/__init__.py") is None, part
    # astropy reads its test runner when it is imported.
    assert left_out.reason("astropy/tests/runner.py") is None


AS_INSTALLED = """
import sys
from fnmatch import fnmatchcase
from importlib.machinery import ModuleSpec, PathFinder
from left_out import ABSENT
if sys.platform == "win32":
    from left_out import NEVER_CALLED_ON_WINDOWS as NEVER_CALLED, reason
else:
    from tree import NEVER_CALLED, reason

class Absent:
    def create_module(self, spec):
        return None

    def exec_module(self, module):
        exec(ABSENT, module.__dict__)

class AsInstalled:
    def find_spec(self, name, path=None, target=None):
        spec = PathFinder.find_spec(name, path)
        place = (spec and spec.origin or "").replace("\\\\", "/").partition("site-packages/")[2]
        if place and reason(place) and not place.startswith("PySide6/QtTest."):  # for pytest-qt
            raise ModuleNotFoundError(f"{name} was left out: {reason(place)}", name=name)
        if place and any(fnmatchcase(place, pattern) for patterns in NEVER_CALLED.values() for pattern in patterns):
            absent = ModuleSpec(name, Absent(), is_package=place.endswith("__init__.py"))
            if absent.submodule_search_locations is not None:
                absent.submodule_search_locations += spec.submodule_search_locations
            return absent
        return None

sys.meta_path.insert(0, AsInstalled())
"""
ALL_OF_KOCHAB = """
import as_installed, importlib, pkgutil, sys
import kochab
for module in pkgutil.walk_packages(kochab.__path__, "kochab."):
    if not module.name.endswith("__main__"):
        importlib.import_module(module.name)
import photutils.detection, scipy.integrate, scipy.interpolate, scipy.ndimage, scipy.optimize, scipy.spatial, scipy.special
if sys.platform == "win32":
    assert sys.modules["photutils.psf"].Absent, "nothing stands in the place of photutils' fitted profiles"
if sys.platform == "linux":
    assert sys.modules["scipy.linalg"].Absent, "nothing stands in the place of SciPy's linear algebra"
"""
CALLS_SCIPY = (
    "pointing/test_encoders.py::test_a_slip_is_told_with_its_size_and_what_was_learned_stays",
    "sky/test_small_bodies.py::test_vesta_and_ceres_are_in_the_field_and_as_bright_as_told",
    "sky/test_coverage.py::test_counts_agree_with_a_camera",
    "lab/detectors/test_published.py::test_a_plain_field_is_found",  # by each detector
    "lab/detectors/test_published.py::test_the_thesis_takes_peaks_where_fewer_than_five_gaussians_are_found",
)


@pytest.fixture
def as_installed(tmp_path, repository):
    """Runs Python with arguments in a process that has what an installed program has."""
    (tmp_path / "as_installed.py").write_text(AS_INSTALLED)
    folders = [*map(str, (tmp_path, repository / "packaging", repository / "packaging" / "linux"))]
    folders += filter(None, [os.environ.get("PYTHONPATH")])

    def run(*arguments):
        done = subprocess.run(
            [sys.executable, *arguments],
            cwd=repository / "app",
            env=os.environ | {"QT_QPA_PLATFORM": "offscreen", "PYTHONPATH": os.pathsep.join(folders)},
            capture_output=True,
            text=True,
            timeout=200,
        )
        assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]

    return run


def test_every_module_is_imported_without_what_is_left_out(as_installed):
    """Packages import parts of others that Kochab does not name: SciPy imports numpy.f2py."""
    as_installed("-c", ALL_OF_KOCHAB)


def test_what_calls_scipy_does_without_what_is_left_out(as_installed, repository):
    options = ("-q", "-n", "0", "-p", "as_installed", "-p", "no:cacheprovider")
    as_installed("-m", "pytest", *options, *(str(repository / "tests" / name) for name in CALLS_SCIPY))


@pytest.mark.parametrize(
    "path",
    [
        "PySide6/QtQml.abi3.so",
        "PySide6/Qt/lib/libQt6Quick.so.6",
        "PySide6/translations/qtbase_de.qm",
        "PySide6\\Qt6Network.dll",
        "numpy/linalg/tests/test_linalg.py",
        "scipy/signal/__init__.py",
        "scipy/special/cython_special.cpython-311-x86_64-linux-gnu.so",
        "zstandard/_cffi.cp311-win_amd64.pyd",
        "sdl2dll/dll/SDL2_mixer.dll",
        "astropy_iers_data/data/eopc04.1962-now",
    ],
)
def test_what_nobody_needs_is_left_out_with_a_reason(left_out, path):
    assert left_out.reason(path)


def test_kochab_and_its_data_are_whole(left_out, repository):
    for folder, place in ((repository / "app" / "kochab", "kochab"), (repository / "catalogs", "kochab/catalogs")):
        for path in folder.rglob("*"):
            if path.is_file() and path.suffix != ".pyc":
                assert left_out.reason(f"{place}/{path.relative_to(folder).as_posix()}") is None, path


def test_a_module_that_is_imported_only_keeps_its_names_and_does_nothing(packaged, imported, tmp_path, monkeypatch):
    tree = packaged("linux/tree.py")
    modules = [path.split(".")[0].replace("/", ".") for paths in tree.NEVER_CALLED.values() for path in paths]
    assert {module.partition(".")[0] for module in modules} <= set(THEIRS)
    assert not {name for name in imported for module in modules if fnmatchcase(name, module)}
    # What SciPy does in them, by the names it is asked by.
    hulls = {"ConvexHull", "Delaunay", "Voronoi", "distance", "griddata", "RBFInterpolator", "RegularGridInterpolator"}
    others = {"quad", "dblquad", "odeint", "ode", "LSODA", "minimize", "expm", "sqrtm", "eigsh", "svds", "ImageCms"}
    others |= {"linalg", "sparse", "fft", "csr_matrix", "CubicSpline", "make_interp_spline", "UnivariateSpline"}
    assert not {name.rpartition(".")[2] for name in imported if name.startswith(("scipy.", "PIL."))} & (hulls | others)
    (tmp_path / "PySide6").mkdir()
    for name in ("QtOpenGL.abi3.so", "QtWidgets.abi3.so"):
        (tmp_path / "PySide6" / name).write_bytes(b"ELF")
    assert sum(tree.never_called(tmp_path).values()) == 3
    assert sorted(path.name for path in (tmp_path / "PySide6").iterdir()) == ["QtOpenGL.py", "QtWidgets.abi3.so"]
    monkeypatch.syspath_prepend(tmp_path / "PySide6")
    absent = importlib.import_module("QtOpenGL")
    assert issubclass(type("Curve", (absent.QOpenGLWidget,), {}), absent.QOpenGLWidget.Type.Other)
    with pytest.raises(NotImplementedError, match="QtOpenGL was left out"):
        absent.QOpenGLBuffer(absent.QOpenGLBuffer.Type.VertexBuffer)


def test_a_library_of_the_system_is_a_dependency(packaged):
    assert set(packaged("linux/tree.py").SYSTEMS.values()) <= set(packaged("debian/build.py").LIBRARIES)


@pytest.mark.skipif(sys.platform == "win32", reason="the .deb is built on Linux")
def test_equal_libraries_are_one_file_also_for_a_machine_of_another_kind(packaged, tmp_path):
    for name in ("scipy.libs/libopenblas.so", "numpy.libs/libopenblas.so", "PIL/_imaging.so"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes((b"P" if "PIL" in name else b"O") * 200_000)
    to_debians = tmp_path / "PIL" / "liblzma.so"
    to_debians.symlink_to("/usr/lib/s390x-linux-gnu/liblzma.so.5")  # of a machine that this one is not
    packaged("linux/tree.py").join_equal_files(tmp_path)
    links = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*") if path.is_symlink()}
    assert links == {"scipy.libs/libopenblas.so", "PIL/liblzma.so"}
    assert (tmp_path / "scipy.libs/libopenblas.so").read_bytes() == b"O" * 200_000
