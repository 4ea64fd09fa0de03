"""Methods, drivers and formats of other packages, found by their entry points."""

import json
import logging
import os
import subprocess
import sys
import textwrap

import pytest

from kochab.core.errors import UsageError
from kochab.core.registry import Registry

GROUP = "kochab.test_shapes"
OWN = {"counter": "collections:Counter", "chain": "collections:ChainMap"}

PACKAGE = '''
"""A method and a mount driver that Kochab has never heard of."""

from dataclasses import dataclass, replace

from kochab.core.registry import integer
from kochab.core.solution import Identification
from kochab.gear.mounts.drivers.lx200 import Lx200
from kochab.identification import IDENTIFIERS


@dataclass(frozen=True)
class Borrowed:
    """The default method on the brightest stars alone."""

    paper = "Nobody 2026"
    stars: int = integer(40, "", 4, 500, "brightest stars used")

    def identify(self, detections, hint=None, year=2016.0):
        brightest = detections.take(slice(self.stars))
        found = yield from IDENTIFIERS.make().identify(brightest, hint, year)
        return replace(found, method="borrowed") if isinstance(found, Identification) else found


class Homemade(Lx200):
    """A home-made mount that speaks the LX200 protocol."""

    title = "Home-made equatorial"
'''
ENTRY_POINTS = """
[kochab.methods]
borrowed = stranger:Borrowed
broken = stranger_that_is_not_there:Thing

[kochab.drivers]
homemade = stranger:Homemade
"""


def install(folder, name, entry_points):
    """A package's metadata as pip writes it."""
    info = folder / f"{name}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(textwrap.dedent(entry_points))


@pytest.fixture
def stranger(tmp_path):
    """A folder for the path, with a package in it."""
    (tmp_path / "stranger.py").write_text(PACKAGE)
    install(tmp_path, "stranger", ENTRY_POINTS)
    return tmp_path


@pytest.fixture
def kochab(stranger, repository):
    """Run ``kochab`` with the package installed; what it printed, what it complained of, its exit code."""
    path = os.pathsep.join([str(stranger), str(repository / "app"), os.environ.get("PYTHONPATH", "")])

    def call(*arguments):
        command = [sys.executable, "-m", "kochab", *map(str, arguments)]
        env = {**os.environ, "PYTHONPATH": path}
        done = subprocess.run(command, capture_output=True, text=True, env=env, timeout=200)
        return done.stdout, done.stderr, done.returncode

    return call


def test_a_method_of_another_package_solves(kochab, repository):
    frame = repository / "resources" / "samples" / "orion.png"
    out, err, code = kochab("solve", frame, "--method", "borrowed", "--set", "stars=60", "--json")
    assert code == 0, err
    told = json.loads(out)
    assert (told["solved"], told["method"]) == (True, "borrowed")
    assert kochab("solve", frame, "--method", "borrowed", "--set", "stars=1")[2] == 2


def test_a_broken_package_costs_one_line_and_no_more(kochab, repository):
    out, err, code = kochab("solve", "--methods")
    assert code == 0
    assert "--method borrowed   (Nobody 2026)" in out
    assert "stars=40   brightest stars used" in out
    assert "--method broken" not in out
    (line,) = err.splitlines()
    assert "The method 'broken' (stranger_that_is_not_there:Thing) cannot be loaded" in line
    _, err, code = kochab("solve", repository / "resources/samples/orion.png", "--method", "broken")
    assert code == 2
    assert "cannot be loaded" in err
    assert "Traceback" not in err


@pytest.mark.skipif(os.name == "nt", reason="the simulated mount speaks through a pty")
def test_a_driver_of_another_package_reaches_the_mount(kochab):
    from kochab.simulate.responders import open_responder
    from tests.simulate.bench_telescope import BenchTelescope
    from tests.simulate.lines import serve_pty

    telescope = BenchTelescope(50.0, 8.0, 60.0)
    with serve_pty(open_responder("lx200", telescope)) as port:
        out, err, code = kochab("mount", "position", "--port", port, "--driver", "homemade", "--json")
        believed = telescope.believed_deg()
    assert code == 0, err
    told = json.loads(out)
    assert told["driver"] == "homemade"
    assert told["mount_dec_deg"] == pytest.approx(believed[1], abs=0.01)
    assert json.loads(kochab("mount", "list", "--json")[0])["drivers"]["homemade"] == "Home-made equatorial"


@pytest.fixture
def shapes(tmp_path, monkeypatch):
    """A registry and what must be put on the path for it."""
    monkeypatch.syspath_prepend(tmp_path)
    return lambda entry_points: (
        install(tmp_path, "extra", f"[{GROUP}]\n{entry_points}\n"),
        Registry("shape", GROUP, OWN),
    )[1]


def test_own_names_come_first_and_the_rest_is_sorted(shapes):
    registry = shapes("zebra = collections:deque\nape = collections:OrderedDict")
    assert list(registry) == ["counter", "chain", "ape", "zebra"]
    assert registry["ape"] == "collections:OrderedDict"
    assert registry.make("zebra", iterable=[1], maxlen=2).maxlen == 2
    assert registry.make() == {}


def test_the_path_is_searched_only_for_what_is_not_known(monkeypatch):
    registry = Registry("shape", GROUP, OWN)
    monkeypatch.setattr("importlib.metadata.distributions", lambda: pytest.fail("searched"))
    registry.check("chain")
    assert registry.make("counter", a=1) == {"a": 1}
    with pytest.raises(pytest.fail.Exception):
        registry.check("ape")


def test_an_unknown_name_is_told_with_those_there_are(shapes):
    registry = shapes("ape = collections:OrderedDict")
    with pytest.raises(UsageError, match="There is no shape 'bee'; choose one of counter, chain, ape"):
        registry.make("bee")


@pytest.mark.parametrize(
    ("entry_points", "complaint"),
    [
        ("counter = collections:deque", "the name is taken"),
        ("ape = collections", "is not module:Class"),
        ("ape", "cannot be read"),
    ],
)
def test_what_cannot_be_registered_is_left_out_with_one_line(shapes, caplog, entry_points, complaint):
    registry = shapes(entry_points)
    with caplog.at_level(logging.WARNING):
        assert list(registry) == ["counter", "chain"]
        assert registry["counter"] == OWN["counter"]
    (record,) = caplog.records
    assert complaint in record.message


def test_a_package_may_fail_in_any_way_when_imported(shapes, tmp_path, caplog):
    (tmp_path / "faulty.py").write_text("1 / 0\n")
    registry = shapes("ape = faulty:Ape\nbee = collections:deque")
    assert list(registry.loaded()) == ["counter", "chain", "bee"]
    (record,) = (each for each in caplog.records if each.levelname == "WARNING")
    assert "The shape 'ape' (faulty:Ape) cannot be loaded: ZeroDivisionError" in record.message


def test_the_engine_names_nothing_of_the_published_methods():
    from kochab.attitude import ESTIMATORS
    from kochab.detection import DETECTORS
    from kochab.identification import IDENTIFIERS

    for registry in (IDENTIFIERS, DETECTORS, ESTIMATORS):
        assert len(registry.own) == 1
        assert not any("lab" in target for target in registry.own.values())
        assert all(target.startswith("kochab.lab.") for target in registry.others().values())
