"""INDI and Alpaca servers, which hold cameras and mounts that programs on the network share."""
