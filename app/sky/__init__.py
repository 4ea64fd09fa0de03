"""The catalogue, names, and where a star is tonight."""

from app.sky.catalogue import Catalogue, open_catalogue

__all__ = ["Catalogue", "open_catalogue"]
