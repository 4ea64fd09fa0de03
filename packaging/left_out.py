"""What installed programs leave out of the packages that Kochab is built with, and why.

The .deb (``linux/tree.py``) and the Windows installer (``windows/kochab.spec``) ask :func:`reason` about each file.
Patterns are for paths below ``site-packages``, written with ``/``.
"""

from collections.abc import Iterable, Mapping
from fnmatch import fnmatchcase

CODECS = (
    *("imcd", "jpeg8", "jpeg2k", "ljpeg", "png", "webp"),
    *("deflate", "lz4", "lzma", "zlib", "zstd", "shared", "shared_cython"),
)
QT = ("Core", "Gui", "OpenGL", "OpenGLWidgets", "Svg", "Widgets")  # pyqtgraph asks for OpenGL
_QT_PLUGINS = (
    *(
        "platforms/libqxcb",
        "platforms/libqwayland.",
        "platforms/libqwayland-generic",
        "platforms/libqoffscreen",
        "platforms/qwindows",
        "platforms/qoffscreen",
    ),
    *(
        "imageformats/*qsvg",
        "imageformats/*qjpeg",
        "iconengines/",
        "styles/",
        "platformthemes/libqxdg",
        "xcbglintegrations/",
    ),
    *("platforminputcontexts/libcompose", "platforminputcontexts/libibus"),
    *("wayland-decoration-client/", "wayland-shell-integration/libxdg"),
)
_SCIPY = (
    *("_lib", "constants", "fft", "integrate", "interpolate", "linalg", "ndimage", "optimize", "sparse", "spatial"),
    "special",
)

KEPT: Mapping[str, tuple[str, tuple[str, ...]]] = {
    "PySide6": (
        "Qt's modules that the window does not import (QML, Quick, Designer, Network, ...), tools",
        (
            *(
                "__init__.py",
                "_config.py",
                "_git_pyside_version.py",
                "support/*",
                "libpyside6.abi3*",
                "pyside6.abi3.dll",
            ),
            *("*140*.dll", "Qt/lib/libicu*"),
            *(f"{place}{name}{end}" for name in QT for place, end in (("Qt", ".*so"), ("Qt", ".pyd"), ("Qt6", ".dll"))),
            *(f"Qt/lib/libQt6{name}.so*" for name in (*QT, "DBus", "XcbQpa", "WaylandClient")),
            *(f"{place}plugins/{name}*" for name in _QT_PLUGINS for place in ("Qt/", "")),
        ),
    ),
    "imagecodecs": ("codecs that neither pictures, TIFF nor XISF use", ("*.py", *(f"_{name}.*" for name in CODECS))),
    "scipy": (
        "SciPy's stats, signal, io, cluster, fftpack, odr, datasets",
        (
            "__init__.py",
            "__config__.py",
            "version.py",
            "_distributor_init.py",
            "_cyutility.*",
            "_external/*",  # from 1.18 on scipy itself imports it
            *(f"{name}/*" for name in _SCIPY),
        ),
    ),
}
"""Packages of which only some files are needed: why others are not, and what is kept, below the package's folder."""

DROPPED: Mapping[str, tuple[str, ...]] = {
    "packages' own tests": (
        *("*/tests/*", "*/test/*", "*/conftest.py", "*/.gitignore"),
        *("numpy/_core/_*_tests.*", "scipy/ndimage/_ctest*", "scipy/ndimage/_cytest*", "scipy/*/_test_*"),
    ),
    "headers, stubs and sources for compilers": tuple(
        f"*.{ending}"
        for ending in "pyi pyx pxd pxi h hpp c cpp f90 inc lib a pyc".split()  # noqa: SIM905
    ),
    "examples": ("pyqtgraph/examples/*", "sdl2/examples/*", "pyqtgraph/opengl/*"),
    "PyQtGraph's icons and colour maps": ("pyqtgraph/icons/*.svg", "pyqtgraph/icons/*.png", "pyqtgraph/colors/maps/*"),
    "astropy's cosmology, time series and plots": tuple(
        f"astropy/{name}/*" for name in ("cosmology", "timeseries", "visualization", "samp")
    ),
    "tables of the Earth's rotation since 1962, which Kochab does not read": (
        *("astropy_iers_data/data/eopc*", "astropy_iers_data/data/finals*"),
    ),
    "photutils' galaxies and data sets, PyQtGraph's flow charts": (
        *(f"photutils/{name}/*" for name in ("datasets", "isophote", "morphology", "psf_matching")),
        "pyqtgraph/flowchart/*",
    ),
    "lists of the packages' files": ("*.dist-info/RECORD", "*.dist-info/sboms/*"),
    "SDL's sound, fonts and pictures": ("sdl2dll/dll/SDL2_*", "sdl2dll/dll/lib*"),
    "Qt's software OpenGL": ("*opengl32sw.dll",),
    "NumPy's tools for Fortran and for its tests": (
        *("numpy/distutils/*", "numpy/_core/_simd.*", "numpy/linalg/lapack_lite.*"),
    ),
    "SciPy's functions for Cython and zstandard for PyPy": (
        *(
            "scipy/special/cython_special.*",
            "scipy/optimize/cython_optimize/*",
            "zstandard/_cffi.*",
            "zstandard/backend_cffi.*",
        ),
    ),
    "AVIF and WebP pictures, which Kochab does not read": ("PIL/_avif.*", "PIL/_webp.*"),
    "pictures for the README": ("kochab/resources/screenshots/*",),
    "commands of other packages": ("bin/*", "share/*"),
}
"""Why -> what of any package is left out."""

NEVER_CALLED_ON_WINDOWS: Mapping[str, tuple[str, ...]] = {
    "Qt's OpenGL, which PyQtGraph imports and Kochab does not switch on": (
        *("PySide6/QtOpenGL.pyd", "PySide6/QtOpenGLWidgets.pyd"),
        *("PySide6/Qt6OpenGL.dll", "PySide6/Qt6OpenGLWidgets.dll"),
    ),
    "SciPy's linear programs": ("scipy/optimize/_highs/*.pyd", "scipy/optimize/_highspy/*.pyd"),
    "photutils' fitted profiles": ("photutils/psf/*",),
}
"""Reason -> modules that are imported but never called, so that only their names are installed; and their libraries."""

# What is installed in place of such a module: it has every name, and nothing behind it.
ABSENT = """
class _Names(type):
    def __getattr__(cls, name):
        if name.startswith("__"):
            raise AttributeError(name)
        return cls

class Absent(metaclass=_Names):
    def __init__(self, *_, **__):
        raise NotImplementedError(__name__ + " was left out of this installation")

def __getattr__(name):
    if name.startswith("__"):
        raise AttributeError(name)
    return Absent
"""

# astropy reads its test runner when it is imported.
_NEEDED = ("astropy/tests/*.py",)
_NEEDED_NOT = ("astropy/tests/tests/*", "astropy/tests/figures/*")


def reason(path: str) -> str | None:
    """Why the file ``path`` of ``site-packages`` is left out; None for one that is needed."""
    path = path.replace("\\", "/")
    for why, patterns in DROPPED.items():
        if _fits(path, patterns) and (_fits(path, _NEEDED_NOT) or not _fits(path, _NEEDED)):
            return why
    package, _, below = path.partition("/")
    if below and package in KEPT:
        why, patterns = KEPT[package]
        return None if _fits(below, patterns) else why
    return None


def _fits(path: str, patterns: Iterable[str]) -> bool:
    return any(fnmatchcase(path, pattern) for pattern in patterns)


def table(sizes: Mapping[str, int]) -> str:
    """A row for each reason of ``sizes``, in bytes: megabytes and what was left out, the largest first."""
    rows = sorted(sizes.items(), key=lambda row: -row[1])
    return "\n".join(["| MB | left out |", "| ---: | --- |", *(f"| {size / 1e6:.1f} | {why} |" for why, size in rows)])
