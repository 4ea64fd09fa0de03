"""The .deb: ``python packaging/debian/build.py [amd64|arm64] [FOLDER]`` (dist/debian).

One package for Debian 12 and everything newer. It carries its own Python and Qt under /usr/lib/kochab, because no
release has all that Kochab needs: Debian 12 has no PySide6 and a NumPy from 2022. What Debian keeps alike in all
releases (C library, X11, Wayland, OpenGL, TLS) is a dependency. Needs what ``linux/tree.py`` needs. QUICK=1 packs
larger and faster.
"""

import gzip
import hashlib
import os
import re
import subprocess
import sys
import time
from email.parser import HeaderParser
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parents[2]
LINUX = CHECKOUT / "packaging" / "linux"
sys.path[:0] = [str(LINUX), str(CHECKOUT / "packaging"), str(CHECKOUT / "app")]

import manual  # noqa: E402
import tree  # noqa: E402
from left_out import table  # noqa: E402

from kochab.core import __version__  # noqa: E402
from kochab.gear.mounts.probe import ADAPTERS  # noqa: E402

MAINTAINER = "Kochab contributors <kochab@localhost>"
# Libraries of the system that Python and the wheels ask for, beside those of Qt in .ci/system.sh.
LIBRARIES = {
    **dict.fromkeys(
        ("libc.so.6", "libm.so.6", "libdl.so.2", "libpthread.so.0", "librt.so.1", "ld-linux"), "libc6 (>= 2.36)"
    ),
    "libICE.so.6": "libice6",
    "libSM.so.6": "libsm6",
    "libbz2.so.1.0": "libbz2-1.0",
    "libcrypt.so.1": "libcrypt1",
    "libcrypto.so.3": "libssl3",
    "libexpat.so.1": "libexpat1",
    "libffi.so.8": "libffi8",
    "libgcc_s.so.1": "libgcc-s1",
    "libgomp.so.1": "libgomp1",
    "libgthread-2.0.so.0": "libglib2.0-0",
    "liblzma.so.5": "liblzma5",
    "libsqlite3.so.0": "libsqlite3-0",
    "libssl.so.3": "libssl3",
    "libuuid.so.1": "libuuid1",
    "libwayland-client.so.0": "libwayland-client0",
    "libwayland-cursor.so.0": "libwayland-cursor0",
    "libzstd.so.1": "libzstd1",
}
OVERRIDES = """\
# The package carries its own Python and Qt on purpose (see README.Debian): one file for every release since Debian 12.
kochab: embedded-library *
kochab: custom-library-search-path *
# Bundled libraries of wheels are renamed by auditwheel; strip would misplace their segments.
kochab: unstripped-binary-or-object *
kochab: shared-library-lacks-stack-section *
# Compiled modules of NumPy and SciPy that need nothing of libc.
kochab: library-not-linked-against-libc *
# Compiled for the Python in the package, which no helper of Debian's knows of.
kochab: package-installs-python-bytecode *
kochab: package-installs-python-pycache-dir *
# The project has no address of mail.
kochab: bogus-mail-host *
kochab: bogus-mail-host-in-debian-changelog *
"""
README = """\
Kochab for Debian
=================

Everything lies in /usr/lib/kochab: Python 3.11 as Debian 12 has it, Qt, and the packages of the Python index that
Kochab needs, compiled. Nothing is shared with the system's Python, so that one package serves Debian 12, Debian 13 and
Ubuntu since 24.04, and it is removed without a trace. Security updates of these parts come with Kochab's.

What was left out to keep it small
----------------------------------

Webcams (FFmpeg, 104 MB) are not in it; cameras are reached over INDI, ASCOM Alpaca or a folder. Game controllers need
libsdl2-2.0-0, which is recommended.

{table}
"""


def build(arch: str, folder: Path) -> Path:
    """Make the package; its file."""
    root = folder / f"root-{arch}"
    left = tree.build(arch, root / "usr" / "lib" / "kochab")
    program = root / "usr" / "lib" / "kochab"
    put(root / "usr/bin/kochab", LAUNCHER, 0o755)
    files(root)
    documents(root, table(left))
    control(root, arch, dependencies(program))
    deb = folder / f"kochab_{__version__}_{arch}.deb"
    tree.run(
        ["dpkg-deb", "--root-owner-group", "-Zxz", "-z1" if os.environ.get("QUICK") else "-z6", "--build", root, deb],
        folder,
    )
    return deb


LAUNCHER = """\
#!/bin/sh
# A person's own Python settings are not meant for the Python that Kochab carries.
unset PYTHONHOME PYTHONPATH
exec /usr/lib/kochab/bin/python3 -P -m kochab "$@"
"""


def put(path: Path, text: str | bytes, mode: int = 0o644) -> None:
    """Write a file with its folders."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    path.chmod(mode)


def files(root: Path) -> None:
    """What a desktop, the device manager and shells look for."""
    share = root / "usr/share"
    put(share / "applications/kochab.desktop", (LINUX / "kochab.desktop").read_bytes())
    put(share / "mime/packages/kochab.xml", (LINUX / "kochab.xml").read_bytes())
    put(share / "metainfo/org.kochab_astro.Kochab.metainfo.xml", metainfo())
    put(share / "icons/hicolor/scalable/apps/kochab.svg", (CHECKOUT / "resources/icon.svg").read_bytes())
    put(root / "usr/lib/udev/rules.d/60-kochab.rules", udev_rules())
    program = manual.the_program()
    for name, text in manual.man_pages(program).items():
        put(share / "man/man1" / f"{name}.gz", gzip.compress(text.encode(), 9, mtime=0))
    put(share / "bash-completion/completions/kochab", manual.bash(program))
    put(share / "zsh/vendor-completions/_kochab", manual.zsh(program))
    put(share / "fish/vendor_completions.d/kochab.fish", manual.fish(program))


def metainfo() -> str:
    """AppStream's description with the version of this checkout; a date alone makes it a release."""
    said = re.search(rf"^## {re.escape(__version__)} \(([\d-]+)\)", (CHECKOUT / "CHANGELOG.md").read_text(), re.M)
    day = said[1] if said else time.strftime("%Y-%m-%d", time.gmtime(epoch()))
    text = (LINUX / "kochab.metainfo.xml").read_text()
    for place, value in (("VERSION", __version__), ("DATE", day), ("TYPE", "stable" if said else "development")):
        text = text.replace(f"@{place}@", value)
    return text


def udev_rules() -> str:
    """Who sits at the computer may open a mount's serial adapter, and no modem manager talks to it first."""
    rows = [f'ATTRS{{idVendor}}=="{vendor:04x}", GOTO="kochab_serial"  # {what}' for vendor, what in ADAPTERS.items()]
    return "\n".join(
        [
            "# Serial adapters of telescope mounts, as `kochab mount list` names them.",
            'ACTION=="remove", GOTO="kochab_end"',
            'SUBSYSTEM!="tty", GOTO="kochab_end"',
            *(row.partition("  # ")[0] for row in rows),
            'GOTO="kochab_end"',
            'LABEL="kochab_serial"',
            'TAG+="uaccess", ENV{ID_MM_DEVICE_IGNORE}="1"',
            'LABEL="kochab_end"\n',
        ]
    )


def documents(root: Path, left_out: str) -> None:
    """Licences, changes, and what the package is made of."""
    doc = root / "usr/share/doc/kochab"
    day = time.strftime("%a, %d %b %Y %H:%M:%S +0000", time.gmtime(epoch()))
    changes = (
        f"kochab ({__version__}) unstable; urgency=medium\n\n  * See CHANGELOG.md.gz.\n\n -- {MAINTAINER}  {day}\n"
    )
    put(doc / "changelog.gz", gzip.compress(changes.encode(), 9, mtime=0))
    put(doc / "CHANGELOG.md.gz", gzip.compress((CHECKOUT / "CHANGELOG.md").read_bytes(), 9, mtime=0))
    put(doc / "README.Debian", README.format(table=left_out))
    put(doc / "copyright", copyright_of(root / "usr/lib/kochab"))
    put(root / "usr/share/lintian/overrides/kochab", OVERRIDES)


def copyright_of(program: Path) -> str:
    """Every part with its licence, as its own metadata gives it; the texts lie beside it in its ``.dist-info``."""
    rows = []
    for told in sorted(program.glob("lib/python*/site-packages/*.dist-info/METADATA")):
        of = HeaderParser().parsestr(told.read_text(errors="replace"))
        licence = of["License-Expression"] or next(
            (c.rpartition(" :: ")[2] for c in of.get_all("Classifier", []) if c.startswith("License ::")),
            (of["License"] or "see its files").splitlines()[0],
        )
        rows.append(f" {of['Name']} {of['Version']}: {licence}")
    return (
        "Format: https://www.debian.org/doc/packaging-manuals/copyright-format/1.0/\n"
        "Upstream-Name: Kochab\n\nFiles: *\nCopyright: Kochab contributors\nLicense: GPL-3+\n\n"
        "Files: usr/lib/kochab/*\nCopyright: the authors of each package\nLicense: various\n\n"
        "License: GPL-3+\n On Debian systems the text is in /usr/share/common-licenses/GPL-3.\n\n"
        "License: various\n Python 3.11 (PSF-2.0), and in its site-packages, with their texts beside them:\n"
        + "\n".join(rows)
        + "\n"
    )


def dependencies(program: Path) -> list[str]:
    """Debian's packages for the libraries that are asked for and not in the tree; one without a package is an error."""
    of_qt = re.search(r'^libraries="(.*?)"', (CHECKOUT / ".ci/system.sh").read_text(), re.M | re.S)
    assert of_qt is not None
    known = dict(pair.split("=") for pair in of_qt[1].split()) | LIBRARIES
    every = list(program.rglob("*.so*"))
    of_the_system = [path for path in every if path.is_symlink() and path.readlink().is_absolute()]
    programs = [*(path for path in every if path not in of_the_system), program / "python/bin/python3"]
    here = {path.name for path in every}
    asked = {re.sub(r"^ld-linux.*", "ld-linux", name) for path in programs for name in tree.needs(path)} - here
    asked |= {path.readlink().name for path in of_the_system}
    if unknown := asked - set(known):
        sys.exit(f"No package is known for {', '.join(sorted(unknown))}.")
    return sorted({known[name] for name in asked})


def control(root: Path, arch: str, depends: list[str]) -> None:
    """Debian's own files about the package."""
    paths = sorted(path for path in root.rglob("*") if path.is_file() and not path.is_symlink())
    size = sum((path.lstat().st_size + 1023) // 1024 for path in root.rglob("*"))
    sums = [
        f"{hashlib.md5(path.read_bytes(), usedforsecurity=False).hexdigest()}  {path.relative_to(root)}"
        for path in paths
    ]
    text = f"""\
Package: kochab
Version: {__version__}
Architecture: {arch}
Maintainer: {MAINTAINER}
Installed-Size: {size}
Depends: {", ".join(depends)}
Recommends: libsdl2-2.0-0, fonts-dejavu-core
Suggests: indi-bin
Section: science
Priority: optional
Description: plate solving, polar alignment and telescope mounts
 Drop any picture of the night sky on it. Kochab says where the camera
 pointed, what is in the frame and how well a mount is aligned, each with its
 uncertainty. It works offline, with nothing to download.
"""
    put(root / "DEBIAN/control", text)
    put(root / "DEBIAN/md5sums", "\n".join(sums) + "\n")


def epoch() -> int:
    """The time of the last commit, or ``SOURCE_DATE_EPOCH``: the same source makes the same package."""
    if asked := os.environ.get("SOURCE_DATE_EPOCH"):
        return int(asked)
    done = subprocess.run(
        ["git", "log", "-1", "--format=%ct"], cwd=CHECKOUT, capture_output=True, text=True, check=True
    )
    return int(done.stdout)


if __name__ == "__main__":
    if sys.version_info[:2] != (3, 11):
        sys.exit("Run this with Python 3.11, whose compiled modules the program needs.")
    os.umask(0o022)
    os.environ["SOURCE_DATE_EPOCH"] = str(epoch())
    architecture = sys.argv[1] if len(sys.argv) > 1 else "amd64"
    to = Path(sys.argv[2] if len(sys.argv) > 2 else CHECKOUT / "dist" / "debian").absolute()
    to.mkdir(parents=True, exist_ok=True)
    print(build(architecture, to))
