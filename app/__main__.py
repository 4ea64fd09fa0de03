"""``python -m app`` from a checkout, also where Kochab itself is not installed."""

import sys
from pathlib import Path
from runpy import run_module

sys.path.insert(0, str(Path(__file__).resolve().parent))
run_module("kochab", run_name="__main__", alter_sys=True)
