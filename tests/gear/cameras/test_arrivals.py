"""Which files of a folder are new and finished, by a clock the test turns."""

from kochab.gear.cameras.folder import PATIENCE_S, SETTLE_S, Arrivals, Stamp

LATER = SETTLE_S + 0.01


def test_a_growing_file_is_waited_for() -> None:
    arrivals = Arrivals()
    now = 0.0
    for size in range(1, 20):
        arrivals.update({"a.fits": Stamp(size, size)}, now)
        assert arrivals.ready(now) == []
        now += SETTLE_S / 2
        assert arrivals.ready(now) == []
    arrivals.update({"a.fits": Stamp(19, 19)}, now + LATER)
    assert arrivals.ready(now + LATER) == ["a.fits"]


def test_a_file_whose_time_changes_while_its_size_stands_is_waited_for() -> None:
    arrivals = Arrivals()
    arrivals.update({"a.fits": Stamp(10, 1)}, 0.0)
    arrivals.update({"a.fits": Stamp(10, 2)}, LATER)
    assert arrivals.ready(LATER) == []
    assert arrivals.ready(2 * LATER) == ["a.fits"]


def test_newest_first_and_older_finished_ones_are_dropped() -> None:
    arrivals = Arrivals()
    arrivals.update({"a": Stamp(1, 10), "b": Stamp(1, 30), "c": Stamp(1, 20)}, 0.0)
    assert arrivals.ready(LATER) == ["b", "c", "a"]
    assert arrivals.give("b", LATER) == 2
    assert arrivals.ready(LATER) == []


def test_an_older_finished_one_is_not_held_up_by_one_being_written() -> None:
    arrivals = Arrivals()
    arrivals.update({"a": Stamp(5, 10)}, 0.0)
    arrivals.update({"a": Stamp(5, 10), "b": Stamp(1, 20)}, LATER)
    assert arrivals.ready(LATER) == ["a"]
    arrivals.give("a", LATER)
    assert arrivals.ready(2 * LATER) == ["b"]


def test_a_late_copy_with_an_old_date_is_still_new() -> None:
    arrivals = Arrivals()
    arrivals.update({"b": Stamp(1, 30)}, 0.0)
    arrivals.give("b", LATER)
    arrivals.update({"b": Stamp(1, 30), "a": Stamp(1, 10)}, 1.0)
    assert arrivals.ready(1.0 + LATER) == ["a"]


def test_written_again_is_new_again() -> None:
    arrivals = Arrivals()
    arrivals.update({"latest.jpg": Stamp(5, 10)}, 0.0)
    assert not arrivals.written_while_watched("latest.jpg")
    arrivals.give("latest.jpg", LATER)
    arrivals.update({"latest.jpg": Stamp(5, 11)}, 1.0)
    assert arrivals.ready(1.0 + LATER) == ["latest.jpg"]
    assert arrivals.written_while_watched("latest.jpg")


def test_an_unreadable_file_is_tried_until_patience_ends() -> None:
    arrivals = Arrivals()
    arrivals.update({"a": Stamp(5, 10)}, 0.0)
    now, tries = LATER, 0
    while arrivals.ready(now):
        broken = arrivals.unreadable("a", now)
        tries += 1
        if broken:
            break
        assert arrivals.ready(now) == []
        now += SETTLE_S
    assert broken
    assert now >= PATIENCE_S
    assert tries > 3
    assert arrivals.ready(now + 100) == []
    arrivals.update({"a": Stamp(6, 11)}, now + 100)
    assert arrivals.ready(now + 101) == ["a"]


def test_what_is_removed_is_forgotten() -> None:
    arrivals = Arrivals()
    for turn in range(1000):
        arrivals.update({f"{turn}.fits": Stamp(1, turn)}, float(turn))
        arrivals.give(f"{turn}.fits", turn + LATER)
    assert len(arrivals._files) == 1
