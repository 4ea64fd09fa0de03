"""Faces for other programs and devices: sockets, HTTP."""
