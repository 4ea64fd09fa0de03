"""What the frozen program runs: Kochab, or one of the processes that Python starts for ``--workers``."""

import sys
from multiprocessing import freeze_support

if __name__ == "__main__":
    freeze_support()
    from kochab.start import main

    sys.exit(main())
