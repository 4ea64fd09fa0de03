"""What stands in `packaging/`, loaded by its path: a package on the index is called `packaging`, too."""

import importlib.util
import sys

import pytest


@pytest.fixture(scope="session")
def packaged(repository):
    """A module of `packaging/`, by its path there."""

    def load(place):
        name = "kochab_packaging_" + place.replace("/", "_").removesuffix(".py")
        if name not in sys.modules:
            spec = importlib.util.spec_from_file_location(name, repository / "packaging" / place)
            sys.modules[name] = importlib.util.module_from_spec(spec)
            spec.loader.exec_module(sys.modules[name])
        return sys.modules[name]

    return load
