"""Changes that mean the same, or nothing that a person could notice, each with its reason; they are not tried."""

EQUIVALENT: dict[tuple[str, str], str] = {}
"""(Module, change as it is printed) -> why no test can notice it."""
