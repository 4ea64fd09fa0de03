"""The parts of astropy that Kochab and photutils use, without its tests and plots: PyInstaller's own hook takes all."""

from PyInstaller.utils.hooks import collect_data_files, collect_submodules, copy_metadata

PARTS = "constants convolution coordinates io.fits modeling nddata stats table time units utils wcs".split()  # noqa: SIM905


def used(name):
    """Whether a module is more than a test or a plot."""
    return ".tests" not in name and ".plotting" not in name and not name.endswith(".conftest")


UNUSED = ["**/tests", "**/test", "visualization", "cosmology"]
datas = [
    *collect_data_files("astropy", include_py_files=False, excludes=UNUSED),
    *copy_metadata("astropy"),
    *copy_metadata("numpy"),
]
hiddenimports = [name for part in PARTS for name in collect_submodules(f"astropy.{part}", filter=used)]
