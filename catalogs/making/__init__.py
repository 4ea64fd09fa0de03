"""What makes the files of ``catalogs/`` from registry packages: ``make catalogs``. It stays out of the wheel."""
