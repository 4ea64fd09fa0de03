"""How long something takes, as people say it."""

from kochab.text.translation import number, tr


def duration_text(seconds: float) -> str:
    """The largest unit that suits: ``40 s``, ``12 min``, ``2 h 10 min``, ``5.2 days``."""
    if seconds < 59.5:
        return tr("{n} s", n=number(seconds, ".0f"))
    minutes = round(seconds / 60.0)
    if minutes < 60:
        return tr("{minutes} min", minutes=minutes)
    if minutes < 48 * 60:
        return tr("{hours} h {minutes} min", hours=minutes // 60, minutes=minutes % 60)
    return tr("{n} days", n=number(seconds / 86400.0, ".1f"))
