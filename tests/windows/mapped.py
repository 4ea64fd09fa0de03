"""Windows neither writes to nor removes a file that is mapped into memory."""

import gc
import sys


def let_go() -> None:
    """Let Windows remove the files whose maps nobody holds any more; elsewhere a mapped file is no obstacle.

    Garbage is collected for it, which takes 0.7 s of processor in a process that has run thousands of tests.
    """
    if sys.platform == "win32":
        gc.collect()
