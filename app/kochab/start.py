"""What the installed commands call first: it makes sure that the files beside this one are Kochab's.

The package index has another project called ``kochab``, with a module and a command of that name. Installed into the
same environment it replaces ``kochab/__init__.py`` and ``kochab/__main__.py``; this file has no namesake there.
"""

import sys


def main() -> int:
    """Run Kochab, or say in one sentence that another package stands in its place (exit code 2)."""
    import kochab
    from kochab.core import __version__

    if getattr(kochab, "__version__", None) != __version__ or "open_catalogue" not in getattr(kochab, "__all__", ()):
        print(
            "kochab: another package called kochab has replaced files of this program. Remove both with: "
            "pip uninstall kochab kochab-astro; then: pip install kochab-astro",
            file=sys.stderr,
        )
        return 2
    from kochab.__main__ import run_process

    return run_process()
