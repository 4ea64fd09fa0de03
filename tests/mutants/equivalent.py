"""Changes that mean the same, or nothing that a person could notice, each with its reason; they are not tried."""

NODES = "two nodes fewer of a spline that misses a planet by 3e-8 au"
DRAWN = "two points fewer of a trail that is drawn finely"
FAINT = "0.004 mag of Jupiter at its largest phase angle"

EQUIVALENT: dict[tuple[str, str], str] = {
    ("kochab.solver.track_prediction", "-1  ->  1"): "the last of two numbers",
    ("kochab.sky.orbits", "round(end - begun) + 1  ->  round(end - begun) - 1"): NODES,
    ("kochab.sky.solar_system", "0.00037  ->  0.00074"): FAINT,
    ("kochab.sky.satellites", "TRAIL + 1  ->  TRAIL - 1"): DRAWN,
}
"""(Module, change as it is printed) -> why no test can notice it."""
