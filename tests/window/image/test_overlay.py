from kochab.frames.sky_grid import grid_lines
from tests.frames.test_sky_grid import solution_at


def test_labels_are_as_fine_as_the_step():
    texts = {line.text for line in grid_lines(solution_at(84.0, -1.0), 0, 0, 599, 399)}
    assert "−2°" in texts
    assert "5h 40m" in texts
    fine = [line.text for line in grid_lines(solution_at(84.0, -1.0, fov=0.2), 0, 0, 599, 399)]
    assert len(set(fine)) == len(fine)
