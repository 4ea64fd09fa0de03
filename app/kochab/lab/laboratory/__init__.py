"""The Laboratory: the parts of a solve compared on the same stars, with the truth beside them."""
