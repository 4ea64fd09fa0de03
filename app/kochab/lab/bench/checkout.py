"""Benches that only a checkout can run, because what they measure with is not shipped; they print rows of JSON."""

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from kochab.lab.bench import Report

CHECKOUT = Path(__file__).parents[4]


def rows_of(module: str, arguments: Sequence[str], report: Report) -> list[dict[str, Any]] | str:
    """What ``python -m module`` of the checkout prints, a row a line; why not, where it can't be run or fails."""
    if not (CHECKOUT / "tests").is_dir():
        return f"not measured here: python -m {module}, in a checkout"
    paths = os.environ | {"PYTHONPATH": os.pathsep.join(map(str, (CHECKOUT / "app", CHECKOUT)))}
    command = [sys.executable, "-m", module, *arguments]
    found: list[dict[str, Any]] = []
    with subprocess.Popen(command, cwd=CHECKOUT, env=paths, stdout=subprocess.PIPE, text=True) as child:
        for line in child.stdout or ():
            found.append(json.loads(line))
            report(f"  {line.strip()}")
    return f"failed: python -m {module}" if child.returncode else found
