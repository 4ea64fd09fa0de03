"""Changes that mean the same, or nothing that a person could notice, each with its reason; they are not tried."""

NODES = "two nodes fewer of a spline that misses a planet by 3e-8 au"
DRAWN = "two points fewer of a trail that is drawn finely"
FAINT = "0.004 mag of Jupiter at its largest phase angle"
LONG = "no star has a number of ten digits; int() alone must not be given thousands of them"
ROUND = "a circle, begun at its other side"
WORK = "how much is done at once, or at most: no result of a real frame depends on it"
SHRINKS = "how fast a radius shrinks to the residuals, not where it ends"
SMALL_CONE = "a cone, which the prior holds far below the farthest place of an axis"
BEGINS = "where a search for the least begins"
WEAK = "a prior that only keeps an undetermined number finite"
MANY_LEFT = "one degree of freedom is never left: an odd number of terms is free from eight stars on"
NEVER_EQUAL = "an angle and a magnitude as measured, which are never quite at the limit"

EQUIVALENT: dict[tuple[str, ...], str] = {
    ("kochab.solver.track_prediction", "-1  ->  1"): "the last of two numbers",
    ("kochab.sky.orbits", "round(end - begun) + 1  ->  round(end - begun) - 1"): NODES,
    ("kochab.sky.solar_system", "0.00037  ->  0.00074"): FAINT,
    ("kochab.sky.satellites", "TRAIL + 1  ->  TRAIL - 1"): DRAWN,
    ("kochab.sky.names", "len(rest) < 10  ->  len(rest) <= 10"): LONG,
    ("kochab.cli.solve", "1  ->  2", "args.workers > 1"): "two workers load for themselves what is loaded before",
    ("kochab.pointing.encoders", "2.0  ->  4.0", "starts = "): BEGINS,
    ("kochab.pointing.encoders", "0.0  ->  1", "np.array([*rates"): BEGINS,
    ("kochab.window.image.overlay", "4  ->  8", "IDENTIFIED_PX + 4"): "four pixels between a mark and its name",
    ("kochab.detection.auto", "-1  ->  1", "eigvalsh"): "the last of two numbers",
    ("kochab.detection.windows", "-1  ->  1", "eigvalsh"): "the last of two numbers",
    ("kochab.identification.index_build", "len(waiting) > AT_ONCE  ->  len(waiting) >= AT_ONCE"): WORK,
    ("kochab.gear.mounts.protocols.skywatcher", "16  ->  32", "for digit in digits"): "each is one hexadecimal digit",
    ("kochab.identification.triangles", "return []  ->  return None"): "nothing to go on with, either way",
    ("kochab.identification.verification", "3.0  ->  6.0", "closer = "): SHRINKS,
    ("kochab.solver.window_ladder", "return False  ->  return None"): "either is no agreement",
    ("kochab.polar.flexure", "0.0  ->  1", "np.array([0.0, 0.0"): WEAK,
    ("kochab.polar.flexure", "50.0  ->  100.0"): "odds of e^50 are certain, and e^100 is no overflow yet",
    ("kochab.polar.report", "abs(x) > half  ->  abs(x) >= half"): "a measured place, which is never quite at the edge",
    ("kochab.pointing.encoders", "0.001  ->  0.002", "values[..., 4:]"): WEAK,
    ("kochab.pointing.disagreement", "hours > 0  ->  hours >= 0"): "no zone is 0 hours off",
    ("kochab.pointing.disagreement", "terms[4] * side  ->  terms[4] / side"): "a side is 1 or -1",
    ("kochab.pointing.disagreement", "4  ->  8", "terms[2:4]).max()"): SMALL_CONE,
    ("kochab.attitude.fit", "1  ->  2", "max(freedom, 1)"): MANY_LEFT,
    ("kochab.frames.avi", "4  ->  8", "_DEEPEST = "): "lists lie three deep in an AVI; more only ends a hostile one",
    ("kochab.lab.bench.polar_faults", "60  ->  120", "default_rng"): "another seed",
    ("kochab.lab.bench.reach", "3  ->  6", "QUICK_PICTURES"): "how many pictures a quick bench looks at",
    ("kochab.server.nova", "200  ->  400", "MOST_JOBS"): "how many answers are kept for a program that comes back",
    ("kochab.window.shell.tour", "-8  ->  8", "rect().adjusted"): "eight pixels to an edge that no card comes to",
    ("kochab.frames.stretch", "16384  ->  32768"): "a finer table than the 256 greys of a screen need",
    ("kochab.sky.frame_bodies", "2000  ->  4000", "COMPARED = "): WORK,
    ("kochab.sky.frame_bodies", "100  ->  200", "BRIGHTEST = "): WORK,
    (
        "kochab.sky.frame_bodies",
        "xy + radius * np.column_stack([np.cos(turn), np.sin(turn)])  ->  "
        "xy - radius * np.column_stack([np.cos(turn), np.sin(turn)])",
    ): ROUND,
    (
        "kochab.sky.frame_bodies",
        "directions @ catalogue.vectors(rows, year).T >= np.cos(near)[:, None]  ->  "
        "directions @ catalogue.vectors(rows, year).T > np.cos(near)[:, None]",
    ): NEVER_EQUAL,
    (
        "kochab.sky.frame_bodies",
        "catalogue.mag(rows) <= limits[:, None]  ->  catalogue.mag(rows) < limits[:, None]",
    ): NEVER_EQUAL,
}
"""(Module, change as it is printed, where it is one of several a part of its line) -> why no test can notice it."""
