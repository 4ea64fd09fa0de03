"""The toy sky of the pattern tests serves the published methods as well."""

from tests.identification.conftest import toy_sky

__all__ = ["toy_sky"]
