"""Star catalogues shipped with Kochab, as data; README.md tells where every file comes from."""
