"""The house itself: who may import whom, what lies at the top, and that every name resolves."""

import ast
import importlib
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Mapping
from pathlib import Path

import pytest

import kochab
from tests import house, smoke
from tests.any_day import __main__ as any_day

TOP_LEVEL = {
    ".ci",
    ".gitignore",
    ".pre-commit-config.yaml",
    "CHANGELOG.md",
    "CONTRIBUTING.md",
    "LICENSE",
    "Makefile",
    "README.md",
    "SECURITY.md",
    "app",
    "catalogs",
    "packaging",
    "pyproject.toml",
    "resources",
    "tests",
}


def python(code, cwd, *arguments):
    """A fresh interpreter, so that nothing already imported can help or harm."""
    return subprocess.run(
        [sys.executable, "-c", code, *arguments], cwd=cwd, capture_output=True, text=True, timeout=110
    )


def check_imports(folder):
    """Run the import contract of ``folder/pyproject.toml`` on ``folder/app``."""
    code = (
        "import sys; sys.path.insert(0, 'app')\n"
        "from importlinter.cli import lint_imports\n"
        "sys.exit(lint_imports(no_cache=True, no_logo=True))"
    )
    return python(code, folder)


def test_a_room_imports_only_from_floors_below(repository):
    found = check_imports(repository)
    assert found.returncode == 0, found.stdout + found.stderr


@pytest.fixture(scope="module")
def empty_house(repository, tmp_path_factory):
    """The same rooms under the same contract, with nothing in them."""
    folder = tmp_path_factory.mktemp("house")
    shutil.copy(repository / "pyproject.toml", folder)
    settings = tomllib.loads((repository / "pyproject.toml").read_text("utf-8"))
    for contract in settings["tool"]["importlinter"]["contracts"]:
        for container in contract.get("containers", ()):
            house = folder / "app" / Path(*container.split("."))
            house.mkdir(parents=True, exist_ok=True)
            (house / "__init__.py").touch()
            for room in {room.strip() for floor in contract["layers"] for room in floor.split("|")}:
                # A room that is one file in the source is one here.
                if (repository / house.relative_to(folder) / f"{room}.py").exists():
                    (house / f"{room}.py").touch()
                else:
                    (house / room).mkdir(exist_ok=True)
                    (house / room / "__init__.py").touch()
    assert check_imports(folder).returncode == 0
    return folder


BREACHES = (
    ("core/bad.py", "import kochab.sky", "The floors of the house"),
    ("sky/bad.py", "import kochab.frames", "The floors of the house"),
    ("window/job.py", "import kochab.cli", "The floors of the house"),
    ("window/job.py", "import kochab.server", "The floors of the house"),
    ("window/polar/bad.py", "import kochab.window.mount", "The floors of the window"),
    ("window/frame/bad.py", "import kochab.window.shell", "The floors of the window"),
    ("window/devices/bad.py", "def f():\n    import kochab.window.services", "The floors of the window"),
    ("workflows/bad.py", "def f():\n    import kochab.simulate", "The window and the workflows"),
    ("window/job.py", "import kochab.simulate", "The window and the workflows"),
    ("solver/bad.py", "from PySide6.QtCore import QObject", "Qt lives in the window"),
    ("cli/bad.py", "def f():\n    import pyqtgraph", "Qt lives in the window"),
)


def test_the_contract_bites(empty_house):
    """Each forbidden import is reported under its contract; all are planted at once, as every run starts a process."""
    house = empty_house / "app" / "kochab"
    existed = {file for file, _, _ in BREACHES if (house / file).exists()}
    try:
        for file, line, _ in BREACHES:
            with (house / file).open("a") as module:
                module.write(line + "\n")
        found = check_imports(empty_house)
    finally:
        for file, _, _ in BREACHES:
            (house / file).write_text("") if file in existed else (house / file).unlink(missing_ok=True)
    assert found.returncode != 0
    whole = found.stdout.split("Broken contracts\n")[1]
    sections = dict(re.findall(r"^(.+)\n-+\n((?:(?!.+\n---).*\n?)*)", whole, re.M))
    for file, line, broken in BREACHES:
        (told,) = (body for head, body in sections.items() if head.startswith(broken))
        importer = "kochab." + file.removesuffix(".py").replace("/", ".")
        imported = line.split()[-1] if line.split()[-2] == "import" and "from" not in line else "PySide6"
        assert f"{importer} -> {imported} (" in told


@pytest.mark.parametrize("file", ["window/cellar.py", "cellar/__init__.py"])
def test_a_room_that_is_not_drawn_is_refused(empty_house, file):
    path = empty_house / "app" / "kochab" / file
    path.parent.mkdir(exist_ok=True)
    path.touch()
    try:
        found = check_imports(empty_house)
    finally:
        path.unlink()
        if path.parent.name == "cellar":
            shutil.rmtree(path.parent)
    assert found.returncode != 0
    assert "cellar" in found.stdout + found.stderr


def test_wiring_alone_knows_nothing_of_qt_itself(repository):
    """``__main__`` is above the contract, so its own imports are read here."""
    tree = ast.parse((repository / "app" / "kochab" / "__main__.py").read_text(encoding="utf-8"))
    names = {a.name for n in ast.walk(tree) if isinstance(n, ast.Import) for a in n.names}
    names |= {n.module or "" for n in ast.walk(tree) if isinstance(n, ast.ImportFrom)}
    assert not {n for n in names if n.split(".")[0] in {"PySide6", "pyqtgraph", "shiboken6"}}


def test_the_program_asks_for_no_table_of_the_earth_s_rotation():
    """Astropy downloads one, or fails with its own once that is old; ERFA needs none."""
    told = {"astropy.coordinates", "astropy.time", "astropy.utils.iers"}
    of_astropy = list(house.trees_with("astropy"))
    assert of_astropy
    for module, tree in of_astropy:
        for node in ast.walk(tree):
            names = {a.name for a in node.names} if isinstance(node, ast.Import) else set()
            if isinstance(node, ast.ImportFrom) and node.module:
                names = {node.module, *(f"{node.module}.{a.name}" for a in node.names)}
            assert not names & told, module


@pytest.mark.parametrize("arguments", [["--help"], ["solve", "--help"]])
def test_asking_for_help_costs_no_heavy_import(repository, arguments):
    code = (
        f"import sys; sys.argv[1:] = {arguments}\n"
        "from kochab.__main__ import main\n"
        "try:\n    main()\nexcept SystemExit as end:\n    assert not end.code, end.code\n"
        "heavy = {'PySide6', 'pyqtgraph', 'photutils', 'astropy', 'rawpy', 'tifffile'}\n"
        "print('LOADED', sorted(heavy & set(sys.modules)))"
    )
    found = python(code, repository)
    assert found.stdout.strip().endswith("LOADED []"), found.stdout + found.stderr
    assert "solve" in found.stdout


def test_the_window_is_shown_before_libraries_of_numbers_are_loaded(repository):
    """They take a third of the time to its first paint; a thread loads them after it."""
    code = (
        "import sys, kochab.window.application\n"
        "heavy = {'scipy', 'astropy', 'pyqtgraph', 'photutils', 'kochab.lab'}\n"
        "print('LOADED', sorted(heavy & set(sys.modules)))"
    )
    found = python(code, repository)
    assert found.stdout.strip().endswith("LOADED []"), found.stdout + found.stderr


def test_no_modules_import_each_other_in_a_circle():
    assert not house.circles()


def test_types_of_arrays_are_named_in_one_module():
    assert not list(house.array_types_elsewhere())


def test_public_functions_of_many_parameters_say_what_each_is():
    """Their docstrings have a NumPy section that names every one: unit, shape, frame, what None means."""
    silent = [
        f"{module}.{found}"
        for module, text in house.sources().items()
        for found in house.parameters_without_a_word(text)
    ]
    assert not silent, "\n".join(silent)


@pytest.mark.parametrize(
    ("section", "silent"),
    [
        ("", ["Sky.near: a, b, c, d"]),
        (
            "Parameters\n    ----------\n    a, b : float\n        The c : of d.\n    *c\n        Rest.\n",
            ["Sky.near: d"],
        ),
        (
            "Parameters\n    ----------\n    a, b, c\n        All.\n\n    Returns\n    -------\n    d : int\n",
            ["Sky.near: d"],
        ),
        ("Parameters\n    ----------\n    a, b : float\n        Two.\n    c, d\n        Two more.\n", []),
    ],
)
def test_a_parameter_without_a_word_is_found(section, silent):
    text = f'class Sky:\n  def near(self, a, b, *c, d):\n    """One.\n\n    {section}    """\n  def _own(self, a, b, c, d): ...'
    assert list(house.parameters_without_a_word(text)) == silent


def test_nothing_reaches_into_a_mount_by_getattr():
    """What a mount can do stands in the protocol ``core.mount.Mount``; nobody finds it out by name."""
    found = []
    for module, tree in house.trees_with("getattr", "hasattr"):
        for node in ast.walk(tree):
            if (
                isinstance(node, ast.Call)
                and isinstance(node.func, ast.Name)
                and node.func.id in {"getattr", "hasattr"}
            ):
                reached = ast.unparse(node.args[0]).split(".")[-1].strip("_")
                if reached in {"mount", "driver", "guard"}:
                    found.append(f"{module}:{node.lineno}")
    assert not found


@pytest.mark.parametrize(
    ("title", "code"), [("A live frame to the overlay", house.LIVE), ("Pictures to the axis", house.AXIS)]
)
def test_a_walk_is_drawn_as_it_is_walked(repository, title, code):
    """Every file that its first sentence names is executed on the way."""
    drawing = (repository / "app" / "ARCHITECTURE.md").read_text("utf-8")
    sentence = drawing.split(f"- **{title}:**")[1].split(". ")[0]
    drawn = re.findall(r"`([\w.]+)`", sentence)
    assert len(drawn) > 5
    files = house.walked(code)
    assert not [name for name in drawn if not any(f"/{f}".endswith(f"/{name.replace('.', '/')}.py") for f in files)]


def test_no_variable_is_told_said_or_wish():
    """They say nothing of what they hold; 45 of them had come back since the last were renamed."""
    found = []
    for module, tree in house.trees_with("told", "said", "wish"):
        for node in ast.walk(tree):
            name = node.arg if isinstance(node, ast.arg) else node.id if isinstance(node, ast.Name) else ""
            if name in {"told", "said", "wish"}:
                found.append(f"{module}:{node.lineno} {name}")
    assert not found


def test_the_top_level_holds_what_it_should(repository):
    if not (repository / ".git").exists():
        pytest.skip("not a git checkout")
    listed = subprocess.run(
        ["git", "ls-files"], cwd=repository, capture_output=True, text=True, check=True
    ).stdout.splitlines()
    assert {name.split("/")[0] for name in listed} == TOP_LEVEL


def modules():
    """Every module of ``app`` that can be imported without opening a window."""
    root = Path(kochab.__file__).parent
    for path in sorted(root.rglob("*.py")):
        parts = path.relative_to(root).with_suffix("").parts
        if parts[-1] != "__main__":
            yield ".".join(("kochab", *parts)).removesuffix(".__init__")


def registries():
    """The plain dicts ``NAME: name -> "module:thing"`` (or a module) at the top of a module."""
    entry = re.compile(r"kochab(\.\w+)+(:\w+)?")
    quoted = re.compile(rf'"{entry.pattern}"')
    for name in modules():
        source = Path(kochab.__file__).parent.joinpath(*name.split(".")[1:])
        file = source / "__init__.py" if source.is_dir() else source.with_suffix(".py")
        if not quoted.search(file.read_text(encoding="utf-8")):
            continue
        for key, value in vars(importlib.import_module(name)).items():
            if key.isupper() and isinstance(value, Mapping):
                for label, told in value.items():
                    for part in told if isinstance(told, tuple) else (told,):
                        if isinstance(part, str) and entry.fullmatch(part):
                            yield f"{name}.{key}", label, part


def test_every_name_in_a_registry_resolves():
    entries = list(registries())
    kinds = {registry for registry, _, _ in entries}
    assert kinds >= {
        "kochab.detection.DETECTORS",
        "kochab.identification.IDENTIFIERS",
        "kochab.lab.bench.BENCHES",
        "kochab.cli.main.COMMANDS",
    }
    broken = []
    for registry, label, target in entries:
        module, _, thing = target.partition(":")
        try:
            found = getattr(importlib.import_module(module), thing or "__name__")
        except (ImportError, AttributeError) as error:
            broken.append(f"{registry}[{label!r}]: {error}")
        else:
            if thing and not callable(found):
                broken.append(f"{registry}[{label!r}]: not callable")
    assert not broken, "\n".join(broken)


def test_the_changelog_tells_of_this_version(repository):
    told = re.findall(r"^## (\S+)", (repository / "CHANGELOG.md").read_text("utf-8"), re.M)
    assert kochab.__version__ in told


def test_the_quick_minute_touches_every_room():
    rooms = {path.parent.name for path in house.SOURCE.glob("*/__init__.py")}
    assert smoke.SMOKE.keys() == rooms
    assert not [path for path in smoke.files() if not path.exists()]


def test_the_tests_of_other_days_are_where_they_are_looked_for(repository):
    assert not [name for name in (*any_day.QUICK, *any_day.MORE) if not (repository / name.partition("::")[0]).exists()]


def test_the_makefile_and_the_hooks_run_the_same_checks(repository):
    """A check that only one of them knows is a check that someone will miss."""
    makefile = (repository / "Makefile").read_text("utf-8")
    parts = re.search(r"^lint:(.*)$", makefile, re.M)[1].split()
    recipe = "".join(makefile.split(f"\n{part}:")[1].split("\n\n")[0] for part in parts)
    hooks = (repository / ".pre-commit-config.yaml").read_text("utf-8")
    in_make = re.findall(r"\(BIN\)/([\w-]+)", recipe)
    in_hooks = re.findall(r"entry: \.venv/bin/([\w-]+)", hooks)
    assert in_make
    assert sorted(in_make) == sorted(in_hooks)


def test_what_the_readme_points_to_is_there(repository):
    text = (repository / "README.md").read_text("utf-8")
    linked = [t for t in re.findall(r"\]\(([^)#]+)\)", text) if "://" not in t]
    named = re.findall(r"`((?:app|catalogs|resources|tests)/[\w./-]+|[A-Z]+(?:\.md)?)`", text)
    assert linked
    assert named
    assert not [t for t in linked + named if not (repository / t).exists()]
