"""What once went wrong, and a few new mutants of every input (``make fuzz`` tries many)."""

from random import Random

import pytest

from tests.fuzz.files import good
from tests.fuzz.runner import CORPUS, attempt, run, seeds_of, slug, targets

TARGETS = targets()
SLUGS = {slug(target): target for target in TARGETS.values()}
SEED = 20


@pytest.mark.parametrize("path", sorted(CORPUS.iterdir()), ids=lambda path: path.name)
def test_what_once_went_wrong(path, tmp_path) -> None:
    found = attempt(SLUGS[path.name.split(".")[0]], path.read_bytes(), tmp_path)
    assert not found


def test_every_format_is_spoilt(tmp_path) -> None:
    """SER and AVI were not: a new format's row is easily forgotten."""
    fed = {seed for name, target in TARGETS.items() if name.startswith("read ") for seed in target.seeds(tmp_path)}
    assert [name for name, data in good().items() if data not in fed] == []


@pytest.mark.parametrize("target", TARGETS.values(), ids=TARGETS)
def test_good_inputs_pass(target, tmp_path) -> None:
    for seed in seeds_of(target)[:2]:
        assert not attempt(target, seed, tmp_path)


def test_a_few_mutants_of_everything() -> None:
    tallies = list(run([(target.name, target.quick, 60.0) for target in TARGETS.values()], SEED, keep=False))
    assert [(tally.name, tally.mutants) for tally in tallies] == [(one.name, one.quick) for one in TARGETS.values()]
    assert not [fault for tally in tallies for fault in tally.faults]


# -- The runner itself notices what it is there for ---------------------------------------------


@pytest.mark.parametrize(
    ("check", "said"), [("raises", "KeyError"), ("crashes", "SIGKILL"), ("hangs", "hung"), ("grows", "grew by 1.1 GB")]
)
def test_what_must_not_be_is_a_fault_and_the_run_goes_on(check, said, monkeypatch) -> None:
    monkeypatch.setattr("tests.fuzz.runner.EXTRA", f"tests.fuzz.faulty:{check}")
    if check == "hangs":
        monkeypatch.setattr("tests.fuzz.runner.HANG_S", 0.3)
    if check == "grows":  # a busy machine takes its time for a gigabyte
        monkeypatch.setattr("tests.fuzz.runner.HANG_S", 100.0)
    (tally,) = run([("extra", 2, 200.0)], SEED, keep=False)
    assert (tally.mutants, len(tally.faults)) == (2, 2)
    assert all(said in text for _, text in tally.faults)


def test_what_was_only_kept_waiting_is_no_fault(monkeypatch) -> None:
    monkeypatch.setattr("tests.fuzz.runner.EXTRA", "tests.fuzz.faulty:waits")
    monkeypatch.setattr("tests.fuzz.runner.HANG_S", 1.0)
    (tally,) = run([("extra", 1, 60.0)], SEED, keep=False)
    assert (tally.mutants, tally.faults) == (1, [])


def test_mutants_come_again() -> None:
    for target in TARGETS.values():
        seeds = seeds_of(target)
        made = [[target.mutate(Random(f"{k}"), seeds) for k in range(5)] for _ in range(2)]
        assert made[0] == made[1]
