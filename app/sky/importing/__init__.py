"""Catalogues that people already own, read and put beside the shipped one."""
