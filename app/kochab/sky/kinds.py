"""What kinds of objects there are: how each is drawn, and how a person says it."""

from kochab.text.translation import tr, tr_noop

FAMILIES = {"G": "galaxy", "GPair": "galaxy", "GTrpl": "galaxy", "GGroup": "galaxy", "GalCl": "galaxy", "star": "star"}
FAMILIES |= {"OCl": "cluster", "GCl": "cluster", "*Ass": "cluster", "DrkN": "dark"}
FAMILIES |= dict.fromkeys(
    ("sun", "moon", "planet", "dwarf planet", "moon of a planet", "asteroid", "comet", "satellite"), "ecliptic"
)
"""What a kind of object is drawn as; all others are nebulae."""
KINDS = {
    "G": tr_noop("Galaxy"),
    "GPair": tr_noop("Pair of galaxies"),
    "GTrpl": tr_noop("Triplet of galaxies"),
    "GGroup": tr_noop("Group of galaxies"),
    "GalCl": tr_noop("Cluster of galaxies"),
    "OCl": tr_noop("Open cluster"),
    "GCl": tr_noop("Globular cluster"),
    "*Ass": tr_noop("Association of stars"),
    "Cl+N": tr_noop("Cluster with nebula"),
    "DrkN": tr_noop("Dark nebula"),
    "RfN": tr_noop("Reflection nebula"),
    "EmN": tr_noop("Emission nebula"),
    "HII": tr_noop("Emission nebula"),
    "Neb": tr_noop("Nebula"),
    "PN": tr_noop("Planetary nebula"),
    "SNR": tr_noop("Supernova remnant"),
    "star": tr_noop("Star"),
}
"""Kinds of objects as a person says them."""


def kind_in_words(kind: str) -> str:
    """A kind of the tables, or a body's, as a person says it; empty where it says nothing (``*``)."""
    return tr(KINDS.get(kind, "")) or ("" if "*" in kind else tr(kind).capitalize())
