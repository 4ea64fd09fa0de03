"""``make fuzz``: mutants of every input against everything that reads it (``python -m tests.fuzz --help``)."""

import argparse
import os
import random
import sys
import time
from tempfile import TemporaryDirectory


def main() -> int:
    """Run the targets, print a line for each; 1 when something must be mended."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("targets", nargs="*", metavar="TARGET", help="begins of names (default: all)")
    parser.add_argument("--count", type=float, default=1.0, metavar="N", help="times the usual count (about 330,000)")
    parser.add_argument("--minutes", type=float, default=60.0, metavar="M", help="at most so long (60)")
    parser.add_argument("--seed", type=int, default=random.randrange(10**6), metavar="S", help="repeats a run")
    args = parser.parse_args()
    with TemporaryDirectory(prefix="kochab-fuzz-") as home:
        for name in ("CONFIG", "CACHE", "DATA", "STATE"):
            os.environ[f"XDG_{name}_HOME"] = home
        os.environ.pop("KOCHAB_CONFIG", None)
        os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
        return _run(args)


def _run(args: argparse.Namespace) -> int:
    from tests.fuzz.runner import cause, run, targets

    chosen = [t for t in targets().values() if not args.targets or t.name.startswith(tuple(args.targets))]
    share_s = args.minutes * 60.0 / max(1, len(chosen))
    print(f"{len(chosen)} targets, seed {args.seed}")
    print(f"{'target':22}{'mutants':>9}{'seconds':>9}{'contained':>11}{'faults':>8}")
    total = faults = 0
    begun = time.monotonic()
    jobs = [(t.name, max(1, round(t.count * args.count)), share_s) for t in chosen]
    for tally in run(jobs, args.seed):
        total, faults = total + tally.mutants, faults + len(tally.faults)
        row = f"{tally.name:22}{tally.mutants:>9,}{tally.seconds:>9.1f}{tally.contained:>11}{len(tally.faults):>8}"
        print(row, flush=True)
        causes: dict[str, list[tuple[int, str]]] = {}
        for number, text in tally.faults:
            causes.setdefault(cause(text), []).append((number, text))
        for alike in causes.values():
            number, text = alike[0]
            rows = text.strip().splitlines()
            own = [r.strip() for r in rows if "/kochab/" in r or ("/fuzz/" in r and "runner" not in r)][-3:]
            print(f"    {len(alike)} x, first {number}: {rows[-1][:300]}", *own, sep="\n        ", flush=True)
    print(f"{'all':22}{total:>9,}{time.monotonic() - begun:>9.1f}{'':11}{faults:>8}")
    return int(faults > 0)


if __name__ == "__main__":
    sys.exit(main())
