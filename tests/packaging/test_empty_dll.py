"""The DLL that stands in the place of one which is linked and never used."""

import ctypes
import shutil
import subprocess
import sys

import pytest

NAMES = ("x265_cleanup", "x265_api_get_209", "b", "a")


@pytest.fixture
def dll(packaged, tmp_path):
    path = tmp_path / "libx265-209.dll"
    path.write_bytes(packaged("windows/empty_dll.py").empty_dll(path.name, NAMES))
    return path


@pytest.mark.skipif(sys.platform != "win32", reason="Windows loads DLLs")
def test_its_functions_return_nothing(dll):
    library = ctypes.CDLL(str(dll))
    assert [getattr(library, name)() for name in NAMES] == [0, 0, 0, 0]
    assert not hasattr(library, "x265_api_get_210")


@pytest.mark.skipif(not shutil.which("objdump"), reason="needs objdump, which reads what others wrote")
def test_it_has_the_names_in_order_as_a_loader_looks_for_them(dll):
    seen = subprocess.run(["objdump", "-p", "-d", str(dll)], capture_output=True, text=True, check=True).stdout
    table = seen.partition("[Ordinal/Name Pointer] Table")[2].partition("\n\n")[0]
    assert [row.split()[-1] for row in table.splitlines()[1:] if row.strip()] == sorted(NAMES)
    assert "libx265-209.dll" in seen
    assert "ret" in seen
