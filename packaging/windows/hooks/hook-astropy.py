"""The parts of astropy that Kochab and photutils use, without its tests and plots: PyInstaller's own hook takes all.

Modules are found by their files: to import every part in a process of its own takes ten minutes under Wine.
"""

from importlib.util import find_spec
from pathlib import Path

from PyInstaller.utils.hooks import collect_data_files, copy_metadata

PARTS = "config constants convolution coordinates io modeling nddata stats table time units utils wcs".split()  # noqa: SIM905
UNUSED = ["**/tests", "**/test", "visualization", "cosmology"]

folder = Path(find_spec("astropy").origin).parent
datas = [
    *collect_data_files("astropy", include_py_files=False, excludes=UNUSED),
    # astropy asks for these modules, the tables of its grammars, as files, too.
    *((str(path), str(path.parent.relative_to(folder.parent))) for path in folder.rglob("*_*tab.py")),
    *copy_metadata("astropy"),
    *copy_metadata("numpy"),
]
hiddenimports = [
    ".".join(path.relative_to(folder.parent).with_suffix("").parts).removesuffix(".__init__")
    for part in PARTS
    for path in (folder / part).rglob("*.py")
    if not {"tests", "test", "misc", "plotting"} & set(path.parts) and path.stem not in ("conftest", "setup_package")
]
