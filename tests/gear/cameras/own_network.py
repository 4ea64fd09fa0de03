"""A network of our own for servers that would else listen to everybody: Linux, root only."""

import ctypes
import os
import subprocess
from contextlib import contextmanager

import pytest

CLONE_NEWNET = 0x40000000


@contextmanager
def own_network():
    """Within, this thread and all it starts have a loopback that nobody else reaches."""
    libc = ctypes.CDLL(None, use_errno=True)
    if not hasattr(libc, "unshare"):
        pytest.skip("a network of one's own needs Linux")
    outside = os.open("/proc/thread-self/ns/net", os.O_RDONLY)
    try:
        if libc.unshare(CLONE_NEWNET):
            pytest.skip("a network of one's own needs root (unshare -n): INDI's server is not run")
        try:
            if subprocess.run(["ip", "link", "set", "lo", "up"], capture_output=True).returncode:
                pytest.skip("a network of one's own cannot be set up here: INDI's server is not run")
            yield
        finally:
            assert libc.setns(outside, CLONE_NEWNET) == 0
    finally:
        os.close(outside)
