"""A sync needs no solver: the code that moves a mount loads nothing that solves."""

import ast
import subprocess
import sys

from tests import house


def test_a_sync_imports_no_solver(repository):
    code = (
        "import sys, kochab.workflows.sync_mount, kochab.gear.mounts.guard\n"
        "heavy = ('solver', 'identification', 'detection', 'attitude', 'frames', 'simulate', 'window')\n"
        "print([m for m in sys.modules if m.startswith('kochab.') and m.split('.')[1] in heavy])"
    )
    ran = subprocess.run([sys.executable, "-c", code], cwd=repository, capture_output=True, text=True, timeout=60)
    assert ran.stdout.strip() == "[]", ran.stdout + ran.stderr


def test_what_a_mount_may_offer_stands_in_its_protocol():
    """Nobody finds out by getattr or hasattr what a driver has."""
    for module, tree in house.trees_with("getattr", "hasattr"):
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and ast.unparse(node.func) in ("getattr", "hasattr"):
                owner = ast.unparse(node.args[0]).split(".")[-1]
                assert owner not in ("mount", "guard", "source"), f"{module}:{node.lineno}"
