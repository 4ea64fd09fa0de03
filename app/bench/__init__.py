"""Benches: each measures one thing in this machine's own run and compares it with the goals."""

from collections.abc import Callable
from importlib import import_module

from app.bench.report import BenchResult
from app.core.errors import UsageError

Report = Callable[[str], None]
Bench = Callable[[bool, Report], BenchResult]

BENCHES: dict[str, str] = {
    "detect": "app.bench.detect:run",
    "detectors": "app.bench.detectors:run",
    "identify": "app.bench.identify:run",
    "live": "app.bench.live:run",
    "mount": "app.bench.mount:run",
    "papers": "app.bench.papers:run",
    "polar": "app.bench.polar:run",
}


def load_bench(name: str) -> Bench:
    """The function ``run(quick, report) -> BenchResult`` of a bench by name."""
    if name not in BENCHES:
        raise UsageError(f"There is no bench called {name}; there are {', '.join(BENCHES)}.")
    module, function = BENCHES[name].split(":")
    found: Bench = getattr(import_module(module), function)
    return found
