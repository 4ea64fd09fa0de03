"""The program as a folder that needs no Python of the system: ``python packaging/linux/tree.py ARCH FOLDER``.

ARCH is amd64 or arm64, whatever this machine is: Python comes from Debian 12's packages, everything else as wheels, and
nothing of it is run. FOLDER becomes /usr/lib/kochab: a virtual environment whose Python lies in it. Needs Python 3.11,
apt, dpkg-deb, ARCH's binutils and the network; prints what was left out.
"""

import os
import py_compile
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections import Counter
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(CHECKOUT / "packaging"))

import left_out  # noqa: E402
from left_out import ABSENT, table  # noqa: E402

PYTHON = "3.11"
SUITE = "bookworm"  # glibc 2.36: what runs there runs on everything newer
PLATFORMS = {"amd64": "x86_64-manylinux_2_36", "arm64": "aarch64-manylinux_2_36"}
TRIPLETS = {"amd64": "x86_64-linux-gnu", "arm64": "aarch64-linux-gnu"}
EXTRAS = ("indi", "gamepad")  # webcams bring 104 MB of FFmpeg
DEBIANS_OWN = ("pysdl2-dll",)  # SDL comes from Debian's package, when it is installed
# Libraries of one ABI for many years, which the wheels carry under names of their own.
SYSTEMS = {"libgomp-": "libgomp.so.1", "liblzma-": "liblzma.so.5", "libzstd-": "libzstd.so.1"}
# Nothing here reads their docstrings (python -OO). Others read their own: astropy's units are a grammar.
WITHOUT_DOCSTRINGS = ("numpy", "scipy", "erfa", "PIL", "pyqtgraph", "sdl2", "tifffile")
STDLIB_LEFT_OUT = (
    *("test", "tests", "idlelib", "lib2to3", "turtledemo", "turtle.py", "ensurepip", "pydoc_data", "__pycache__"),
    *("_test*", "_xx*", "xx*", "_ctypes_test*", "nis.*", "ossaudiodev.*", "_dbm.*", "readline.*", "_curses*"),
)


def build(arch: str, folder: Path) -> Counter[str]:
    """Make the folder; what was left out, in bytes by reason."""
    shutil.rmtree(folder, ignore_errors=True)
    site = folder / "lib" / f"python{PYTHON}" / "site-packages"
    with tempfile.TemporaryDirectory() as scratch:
        python(arch, folder, Path(scratch))
        wheels(arch, site, Path(scratch))
        left = prune(site) + never_called(site) + stub(site, arch, Path(scratch))
        left += prune_libraries(site) + strip(folder, arch, Path(scratch))
    left += take_systems(site, arch)
    join_fortran(site)
    join_equal_files(site)
    left += compile_all(folder) + zip_library(folder)
    # A virtual environment looks for no packages of the system or the user.
    (folder / "bin").mkdir()
    (folder / "bin" / "python3").symlink_to("../python/bin/python3")
    (folder / "pyvenv.cfg").write_text(
        "home = /usr/lib/kochab/python/bin\ninclude-system-site-packages = false\nversion = 3.11\n"
    )
    return left


def python(arch: str, folder: Path, scratch: Path) -> None:
    """Debian's Python for ``arch``, unpacked: its program and the standard library."""
    for name in ("state/lists/partial", "cache/archives/partial", "unpacked"):
        (scratch / name).mkdir(parents=True)
    keyring = "/usr/share/keyrings/debian-archive-keyring.gpg"
    rows = [f"deb [signed-by={keyring}] {mirror()} {SUITE}{part} main\n" for part in ("", "-updates")]
    (scratch / "sources.list").write_text("".join(rows))
    settings = {
        "Dir::Etc::sourcelist": scratch / "sources.list",
        "Dir::Etc::sourceparts": "-",
        "Dir::State": scratch / "state",
        "Dir::State::status": "/dev/null",
        "Dir::Cache": scratch / "cache",
        "APT::Architecture": arch,
        "APT::Architectures": arch,
        "APT::Sandbox::User": "root",
    }
    apt = ["apt-get", "-qq", *(word for key, value in settings.items() for word in ("-o", f"{key}={value}"))]
    packages = [f"python{PYTHON}-minimal", f"libpython{PYTHON}-minimal", f"libpython{PYTHON}-stdlib"]
    run([*apt, "update"], scratch)
    run([*apt, "download", *packages], scratch)
    for deb in scratch.glob("*.deb"):
        run(["dpkg-deb", "-x", deb, scratch / "unpacked"], scratch)
    (folder / "python" / "bin").mkdir(parents=True)
    shutil.copy(scratch / "unpacked" / "usr" / "bin" / f"python{PYTHON}", folder / "python" / "bin" / "python3")
    library = folder / "python" / "lib" / f"python{PYTHON}"
    shutil.copytree(
        scratch / "unpacked" / "usr" / "lib" / f"python{PYTHON}",
        library,
        ignore=shutil.ignore_patterns(*STDLIB_LEFT_OUT, "config-*"),
        symlinks=True,
    )
    for link in [path for path in library.rglob("*") if path.is_symlink()]:
        link.unlink()  # into /etc: a person's settings of the system's Python


def mirror() -> str:
    """Where this machine gets Debian's packages from."""
    for place in (Path("/etc/apt/sources.list.d/debian.sources"), Path("/etc/apt/sources.list")):
        if place.exists() and (found := re.search(r"https?://\S*debian\b/?(?=\s)", place.read_text())):
            return found[0]
    return "http://deb.debian.org/debian"


def wheels(arch: str, site: Path, scratch: Path) -> None:
    """Kochab and all it depends on, as wheels for ``arch``."""
    uv = shutil.which("uv")
    if uv is None:
        run([sys.executable, "-m", "venv", scratch / "tools"], scratch)
        run([scratch / "tools" / "bin" / "python", "-m", "pip", "install", "-q", "uv"], scratch)
        uv = str(scratch / "tools" / "bin" / "uv")
    run([uv, "build", "-q", "--wheel", "-o", scratch, CHECKOUT], scratch)
    (wheel,) = scratch.glob("kochab_astro-*.whl")
    wanted = scratch / "wanted.txt"
    wanted.write_text(f"kochab-astro[{','.join(EXTRAS)}] @ {wheel.as_uri()}\n")
    target = ["--python-platform", PLATFORMS[arch], "--python-version", PYTHON, "--only-binary", ":all:"]
    pinned = scratch / "pinned.txt"
    run([uv, "pip", "compile", "-q", wanted, *target, "--no-annotate", "--no-header", "-o", pinned], scratch)
    rows = [row for row in pinned.read_text().splitlines() if not row.startswith(DEBIANS_OWN)]
    pinned.write_text("\n".join(rows) + "\n")
    run([uv, "pip", "install", "-q", "--target", site, *target, "--no-deps", "-r", pinned], scratch)
    for path in (*site.glob("*.dist-info/direct_url.json"), *site.glob("*.dist-info/uv_*"), site / ".lock"):
        path.unlink(missing_ok=True)


# Older versions, of which the Windows installer is made, import them; the newest do not.
NEWEST_LEAVE_OUT = {"SciPy's graphs": "scipy/sparse/csgraph/", "photutils' fitted profiles": "photutils/psf/"}


def reason(path: str) -> str | None:
    """Why a file is left out: for every installed program's reasons, or one of the newest versions here."""
    newest = (why for why, folder in NEWEST_LEAVE_OUT.items() if path.startswith(folder))
    return left_out.reason(path) or next(newest, None)


def prune(site: Path) -> Counter[str]:
    """Remove what ``left_out`` names."""
    left: Counter[str] = Counter()
    for path in [path for path in site.rglob("*") if path.is_file() or path.is_symlink()]:
        if why := reason(str(path.relative_to(site))):
            left[why] += path.lstat().st_size
            path.unlink()
    for path in sorted(site.rglob("*"), reverse=True):
        if path.is_dir() and not any(path.iterdir()):
            path.rmdir()
    return left


NEVER_CALLED = {
    "Qt's OpenGL, which PyQtGraph imports and Kochab does not switch on": (
        *("PySide6/QtOpenGL.abi3.so", "PySide6/QtOpenGLWidgets.abi3.so"),
        *("PySide6/Qt/lib/libQt6OpenGL.so*", "PySide6/Qt/lib/libQt6OpenGLWidgets.so*"),
    ),
    "SciPy's linear programs": ("scipy/optimize/_highspy/_core.*.so", "scipy/optimize/_highspy/_highs_options.*.so"),
    # On arm64 each module fills pages of 64 kB, so that small ones count.
    "SciPy's eigenvalues of sparse matrices, hulls, distances, old integrators and other minimizers": (
        *(f"scipy/sparse/linalg/{name}.*.so" for name in ("_eigen/arpack/_arpacklib", "_propack")),
        *(
            f"scipy/spatial/{name}.*.so"
            for name in ("_qhull", "_distance_pybind", "_distance_wrap", "_hausdorff", "_voronoi")
        ),
        *(
            f"scipy/optimize/{name}.*.so"
            for name in ("_slsqplib", "_lbfgsb", "_trlib/_trlib", "_moduleTNC", "_bglu_dense")
        ),
        *(f"scipy/optimize/{name}.*.so" for name in ("_pava_pybind", "_group_columns", "_direct")),
        *(f"scipy/integrate/{name}.*.so" for name in ("_vode", "_odepack", "_lsoda", "_quadpack", "_dop")),
        *(f"scipy/interpolate/{name}.*.so" for name in ("_interpnd", "_rbfinterp_pythran", "_rgi_cython")),
        *("scipy/spatial/transform/_rigid_transform_cy.*.so", "scipy/interpolate/_fitpack.*.so"),
    ),
    # What Kochab calls of SciPy asks NumPy's BLAS and LAPACK, so that SciPy's OpenBLAS can go (`stub`). The tables of
    # pointers that Cython links, cython_blas and cython_lapack, stay.
    "SciPy's linear algebra, sparse matrices' arithmetic, some splines and Fourier transforms": (
        *("scipy/linalg/*.py", "scipy/linalg/[!c]*.so", "scipy/interpolate/_dierckx.*.so"),
        *("scipy/optimize/_hessian_update_strategy.py", "scipy/optimize/_lsq/givens_elimination.*.so"),
        *("scipy/sparse/_sparsetools.*.so", "scipy/sparse/_csparsetools.*.so", "scipy/fft/_pocketfft/pypocketfft.*.so"),
    ),
    "Pillow's colour profiles, morphology and Tk": (
        "PIL/_imagingcms.*.so",
        "PIL/_imagingmorph.*.so",
        "PIL/_imagingtk.*.so",
    ),
}


def never_called(site: Path) -> Counter[str]:
    """Put a module that has every name, and nothing behind it, in the place of those that are imported only."""
    left: Counter[str] = Counter()
    for why, patterns in NEVER_CALLED.items():
        for path in [path for pattern in patterns for path in site.glob(pattern)]:
            left[why] += path.lstat().st_size
            path.unlink()
            if not path.name.startswith("lib"):
                path.with_name(path.name.partition(".")[0] + ".py").write_text(ABSENT)
    return left


def prune_libraries(site: Path) -> Counter[str]:
    """Remove bundled libraries (``NAME.libs``) that no extension which was kept needs."""
    left: Counter[str] = Counter()
    for folder in site.glob("*.libs"):
        package = next(p for p in (folder.with_suffix(""), *site.glob("*.so")) if p.exists())
        asking = list(package.rglob("*.so*")) if package.is_dir() else [package]
        if folder.name == "pillow_heif.libs":
            asking = list(site.glob("_pillow_heif*.so"))
        if folder.name == "pillow.libs":
            asking = list((site / "PIL").glob("*.so"))
        needed: set[str] = set()
        while asking:
            new = {name for path in asking for name in needs(path)} - needed
            needed |= new
            asking = [folder / name for name in new if (folder / name).exists()]
        for path in folder.iterdir():
            if path.name not in needed:
                left["libraries of codecs that were left out"] += path.stat().st_size
                path.unlink()
    return left


def stub(site: Path, arch: str, scratch: Path) -> Counter[str]:
    """Replace libraries that are linked but never used with empty ones."""
    left: Counter[str] = Counter()
    returns = {"amd64": "xor %eax, %eax; ret", "arm64": "mov x0, #0; ret"}[arch]
    stops = {"amd64": "ud2", "arm64": "brk #0"}[arch]  # rather than leave an answer unwritten
    (icu,) = site.glob("PySide6/Qt/lib/libicudata.so.*")
    (entry,) = (name for name in symbols(icu, "OBJECT") if name.startswith("icudt"))
    # A data file of ICU without any item: header of 32 bytes, then a table of contents that counts none.
    empty = bytes.fromhex("2000da271400000000000200 436d6e44 01000000 03000000") + bytes(8)
    (scratch / "empty.dat").write_bytes(empty)
    data = f".section .rodata\n.balign 16\n.globl {entry}\n.type {entry}, %object\n"
    data += f'{entry}: .incbin "empty.dat"\n.zero 16\n'
    left["ICU's rules for sorting and old encodings (an empty library in their place)"] += replace(
        icu, data, arch, scratch
    )
    for what, library, asking, prefix, does in (
        ("x265, for writing HEIC, which Kochab only reads", "*.libs/libx265*", "*.libs/libheif*", "x265_", returns),
        ("X11's library for Pillow's picture of the screen", "pillow.libs/libxcb*", "PIL/_imaging.*", "xcb_", returns),
        ("SciPy's OpenBLAS; NumPy's stays", "scipy.libs/libscipy_openblas*", "scipy/**/*.so", "scipy_", stops),
    ):
        for path in site.glob(library):
            asked = {name for one in site.glob(asking) for name in symbols(one, "UND") if name.startswith(prefix)}
            code = "".join(f".text\n.globl {name}\n.type {name}, %function\n{name}: {does}\n" for name in sorted(asked))
            left[f"{what} (an empty library in its place)"] += replace(path, code, arch, scratch)
    return left


def replace(library: Path, assembly: str, arch: str, scratch: Path) -> int:
    """Assemble a library in the place of another, with its name; the bytes saved."""
    tools = scratch / "stub.s", scratch / "stub.o"
    tools[0].write_text(assembly + '.section .note.GNU-stack,"",%progbits\n')
    before = library.stat().st_size
    (name,) = re.findall(r"\(SONAME\).*\[(.*)\]", told(["readelf", "-d", library]))
    run([f"{TRIPLETS[arch]}-as", "-o", tools[1], tools[0]], scratch)
    run([f"{TRIPLETS[arch]}-ld", "-shared", "-soname", name, "-o", scratch / "stub.so", tools[1]], scratch)
    library.unlink()
    shutil.copy(scratch / "stub.so", library)
    return before - library.stat().st_size


def symbols(library: Path, kind: str) -> list[str]:
    """Dynamic symbols of a library, without versions: those of a type, or UND for what it asks of others."""
    rows = (row.split() for row in told(["readelf", "-W", "--dyn-syms", library]).splitlines())
    return [row[7].partition("@")[0] for row in rows if len(row) > 7 and (row[6] if kind == "UND" else row[3]) == kind]


def strip(folder: Path, arch: str, scratch: Path) -> Counter[str]:
    """Remove symbols that only a debugger reads, where the library can be loaded afterwards; the bytes saved."""
    saved = 0
    for path in folder.rglob("*.so*"):
        smaller = scratch / "smaller.so"
        run([f"{TRIPLETS[arch]}-strip", "--strip-unneeded", "-o", smaller, path], folder)
        path.chmod(0o644)
        if loads(smaller):
            saved += path.stat().st_size - smaller.stat().st_size
            shutil.copyfile(smaller, path)
    return Counter({"symbols for debuggers": saved})


def loads(library: Path) -> bool:
    """Whether the loader would take a library: strip misplaces segments of those that auditwheel has renamed."""
    rows = [row.split() for row in told(["readelf", "-lW", library]).splitlines() if row.split()[:1] == ["LOAD"]]
    return all((int(row[1], 16) - int(row[2], 16)) % int(row[-1], 16) == 0 for row in rows)


def take_systems(site: Path, arch: str) -> Counter[str]:
    """Links to Debian's libraries in the place of those that wheels bring too; the bytes saved."""
    saved = 0
    for path in [path for path in site.glob("*.libs/*") if path.is_file()]:
        for prefix, name in SYSTEMS.items():
            if path.name.startswith(prefix):
                saved += path.stat().st_size
                path.unlink()
                path.symlink_to(f"/usr/lib/{TRIPLETS[arch]}/{name}")
    return Counter({"libraries that Debian has as well": saved})


def join_fortran(site: Path) -> None:
    """Keep one Fortran runtime: NumPy and SciPy each bring the same version."""
    kept = next(site.glob("numpy.libs/libgfortran-*.so.5*"))
    for name in needs(kept):
        if (beside := kept.parent / name).exists() and not (there := site / "scipy.libs" / name).exists():
            there.symlink_to(os.path.relpath(beside, there.parent))
    for path in site.glob("scipy.libs/libgfortran-*.so.5*"):
        asked = [name for name in needs(path) if (path.parent / name).exists() and name not in needs(kept)]
        for unused in (path, *(path.parent / name for name in asked)):
            unused.unlink()
        path.symlink_to(os.path.relpath(kept, path.parent))


def join_equal_files(site: Path) -> None:
    """One file for libraries that several packages bring alike."""
    seen: dict[bytes, Path] = {}
    # Links are left alone: those to Debian's libraries lead nowhere on a machine of another kind.
    files = (path for path in site.rglob("*.so*") if path.is_file() and not path.is_symlink())
    for path in sorted(path for path in files if path.stat().st_size > 100_000):
        first = seen.setdefault(path.read_bytes(), path)
        if first != path:
            path.unlink()
            path.symlink_to(os.path.relpath(first, path.parent))


def compile_all(folder: Path) -> Counter[str]:
    """Compiled modules in the place of the sources; bytes of sources left out."""
    saved = 0
    mode = py_compile.PycInvalidationMode.UNCHECKED_HASH
    site = folder / "lib" / f"python{PYTHON}" / "site-packages"
    short = [site / name for name in WITHOUT_DOCSTRINGS]
    for path in list(folder.rglob("*.py")):
        inside = f"/usr/lib/kochab/{path.relative_to(folder)}"
        level = 2 if any(package in path.parents for package in short) else 0
        try:
            py_compile.compile(str(path), f"{path}c", inside, doraise=True, optimize=level, invalidation_mode=mode)
        except py_compile.PyCompileError:
            continue  # a template, not a module
        saved += path.stat().st_size
        path.unlink()
    return Counter({"sources of modules (compiled ones are there)": saved})


def zip_library(folder: Path) -> Counter[str]:
    """The standard library as the archive that Python looks for first, as on Windows; the bytes saved."""
    library = folder / "python" / "lib" / f"python{PYTHON}"
    modules = [path for path in sorted(library.rglob("*.pyc")) if "lib-dynload" not in path.parts]
    archive = library.parent / f"python{PYTHON.replace('.', '')}.zip"
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as file:
        for path in modules:
            file.write(path, path.relative_to(library))
    saved = sum(path.stat().st_size for path in modules) - archive.stat().st_size
    for path in modules:
        if path.name != "os.pyc":  # by which Python knows its own folder
            path.unlink()
    for path in sorted(library.rglob("*"), reverse=True):
        if path.is_dir() and not any(path.iterdir()):
            path.rmdir()
    return Counter({"the standard library, packed": saved})


def needs(path: Path) -> list[str]:
    """The libraries that an ELF file names."""
    return re.findall(r"\(NEEDED\).*\[(.*)\]", told(["readelf", "-d", path]))


def told(command: list[object]) -> str:
    """What a command writes, whether or not it ended well."""
    return subprocess.run([str(word) for word in command], capture_output=True, text=True, check=False).stdout


def run(command: list[object], cwd: Path) -> None:
    """Run to the end, or stop with what it said."""
    environment = os.environ | {"UV_LINK_MODE": "copy"}  # what is changed here must not change uv's cache
    words = [str(word) for word in command]
    if shutil.which(words[0]) is None:
        sys.exit(f"{words[0]} is not installed: apt-get install binutils binutils-aarch64-linux-gnu dpkg")
    done = subprocess.run(words, cwd=cwd, capture_output=True, text=True, env=environment)
    if done.returncode:
        sys.exit(f"{command[0]} failed:\n{done.stdout}{done.stderr}")


if __name__ == "__main__":
    if sys.version_info[:2] != (3, 11):
        sys.exit("Run this with Python 3.11, whose compiled modules the program needs.")
    print(table(build(sys.argv[1], Path(sys.argv[2]).absolute())))
