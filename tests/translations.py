"""The texts of the program for translators: ``make translations INTO=de`` begins a language or brings all up to date.

Qt's lupdate collects what stands in ``tr``, ``tr_n`` and ``tr_noop``, and what stands in tables of data; its lrelease
makes ``resources/translations/kochab_de.qm``, which the window loads in a German system.
"""

import ast
import json
import locale
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from tests.patterns import REPOSITORY

FOLDER = REPOSITORY / "resources" / "translations"
SOURCE = REPOSITORY / "app" / "kochab"
ERRORS = re.compile(r"^class (\w+Error)\((?:\w+\.)?\w*Error(?:, \w+)*\)", re.MULTILINE)
SAMPLES = REPOSITORY / "resources" / "samples" / "samples.json"


MARKERS = ("tr_noop", "tr_n", "refuse", "warn", "confirm")
"""What takes a text for people beside ``tr``; so do the errors of :mod:`kochab.core.errors`."""


def markers() -> list[str]:
    """All names whose first argument is a text for people."""
    found = {name for path in SOURCE.rglob("*.py") for name in ERRORS.findall(path.read_text(encoding="utf-8"))}
    return [*MARKERS, "KochabError", *sorted(found)]


def qt_tool(name: str, *arguments: str) -> None:
    """Run a program that comes with PySide6; RuntimeError with what it says when it fails."""
    code = f"import sys; from PySide6.scripts.pyside_tool import {name}; sys.argv[0] = {name!r}; {name}()"
    done = subprocess.run([sys.executable, "-c", code, *arguments], capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{name}: {done.stdout}{done.stderr}")


THINGS = (
    *("slew rate", "change of tracking", "tracking rate", "move", "pulse", "flip", "home", "centring"),
    *("camera", "telescope", "exposure", "gain", "binning"),
)
"""What sentences of mounts and cameras are about."""


def replies() -> Iterator[str]:
    """What parsers of mounts' replies call them: the last argument of ``match`` and ``require``."""
    for path in (SOURCE / "gear" / "mounts" / "protocols").glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") in ("match", "require"):
                yield from (each.value for each in node.args[2:] if isinstance(each, ast.Constant))


def data_texts() -> Iterator[str]:
    """Texts that people read and that stand in data, or in options of methods."""
    from kochab.attitude import ESTIMATORS
    from kochab.core.mount import Ability, PierSide
    from kochab.core.registry import options_of
    from kochab.detection import DETECTORS
    from kochab.gear.mounts import DRIVERS
    from kochab.gear.mounts.protocols import lx200, skywatcher
    from kochab.identification import IDENTIFIERS

    for sample in json.loads(SAMPLES.read_text(encoding="utf-8")).values():
        yield from sample.values()
    for driver in DRIVERS.loaded().values():
        yield driver.title
    yield from (*Ability, *PierSide, *THINGS, *replies())
    for codes in (skywatcher.ERRORS, lx200.REFUSALS, lx200.ZWO_REFUSALS, lx200.TEENASTRO_REFUSALS, lx200.FAULTS):
        yield from codes.values()
    for registry in (IDENTIFIERS, DETECTORS, ESTIMATORS):
        for name in registry:
            for option in options_of(registry.load(name)):
                yield from filter(None, (option.text, option.none))


def collect(file: Path) -> None:
    """Write the ``.ts`` of a language, or bring it up to date; translations that are there stay."""
    with tempfile.TemporaryDirectory() as folder:
        data = Path(folder) / "data.py"
        texts = sorted(set(data_texts()))
        data.write_text("".join(f"tr_noop({json.dumps(text, ensure_ascii=False)})\n" for text in texts), "utf-8")
        names = Path(folder) / "files.txt"
        sources = [*sorted(SOURCE.rglob("*.py")), data]
        names.write_text("\n".join(map(str, sources)), locale.getencoding())  # as lupdate reads it
        aliases = ("-tr-function-alias", ",".join(f"tr+={name}" for name in markers()))
        language = file.stem.partition("_")[2]
        qt_tool(
            "lupdate", *aliases, "-locations", "none", "-no-obsolete", "-target-language", language, f"@{names}",
            "-ts", str(file),
        )  # fmt: skip


def release(file: Path) -> Path:
    """The ``.qm`` of a ``.ts``, beside it."""
    made = file.with_suffix(".qm")
    qt_tool("lrelease", str(file), "-qm", str(made))
    return made


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    begun = [FOLDER / f"kochab_{language}.ts" for language in sys.argv[1:]]
    for each in sorted({*begun, *FOLDER.glob("kochab_*.ts")}):
        collect(each)
        release(each)
        print(each.relative_to(REPOSITORY))
