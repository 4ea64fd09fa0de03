"""What the phone's page shows of an error: words made here, so that the page only copies them."""

from typing import Any

from app.polar.error import PolarError
from app.polar.words import angle_in_words


def page_numbers(error: PolarError, words: str = "", solved: bool = True) -> dict[str, Any]:
    """The newest error as the page's words, and as numbers for whoever reads its JSON.

    Arrows hold from every side of the mount: up and down for the axis, and the sense of rotation,
    seen from above, for the azimuth.
    """
    altitude, azimuth = error.altitude_arcsec, error.azimuth_arcsec
    down, back = altitude > 0, azimuth > 0
    return {
        "total": angle_in_words(error.total_arcsec),
        "sigma": f"± {angle_in_words(error.whole.sigma_total_arcsec)}",
        "altitude": f"{'▼ lower' if down else '▲ raise'} {angle_in_words(altitude)}",
        "azimuth": f"{'↺ anticlockwise' if back else '↻ clockwise'} {angle_in_words(azimuth)}",
        "words": words,
        "solved": solved,
        "altitude_error_arcsec": altitude,
        "azimuth_error_arcsec": azimuth,
        "total_arcsec": error.total_arcsec,
        "sigma_arcsec": list(error.whole.sigma_arcsec),
    }
