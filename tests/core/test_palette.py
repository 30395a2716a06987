"""The look of trackers."""

import itertools

from hypothesis import given
from hypothesis import strategies as st

from pftrack_sim import trackers
from pftrack_sim.benchmark.asked.suite import load_suite, suite_names
from pftrack_sim.core.palette import COLOURS, GREY, SHAPES, styles_of

BUILT_IN = trackers.names()
LABELS = st.lists(st.sampled_from([*BUILT_IN, *(f"mine:make-{k}" for k in range(12))]), unique=True, max_size=20)


@given(LABELS, st.randoms(use_true_random=False))
def test_looks_do_not_depend_on_the_order_and_those_of_this_package_on_nothing(labels, random):
    shuffled = random.sample(labels, len(labels))
    styles = styles_of(labels)
    assert styles == styles_of(shuffled)
    assert all(style == styles_of([label])[label] for label, style in styles.items() if label in BUILT_IN)
    assert len(set(styles.values())) == len(labels)


def test_every_tracker_of_this_package_has_a_look_of_its_own():
    styles = styles_of(BUILT_IN)
    assert {name for name, style in styles.items() if style.colour == GREY} == {"stay", "oracle", "oracle-visible"}
    assert styles["stay"].dash == "dash"
    third_party = styles_of([f"mine:make-{k}" for k in range(len(COLOURS))]).values()
    assert {style.colour for style in third_party} == set(COLOURS)
    assert len({marker for _, marker in SHAPES}) == len({dash for dash, _ in SHAPES}) == len(SHAPES)


def test_trackers_of_a_shipped_suite_differ_in_colour_unless_there_are_too_many():
    for name in suite_names():
        given = [one for one in load_suite(name).trackers if not one.startswith(("oracle", "stay"))]
        colours = {style.colour for style in styles_of(given).values()}
        assert len(colours) == min(len(given), len(COLOURS)), name


def test_controllers_and_latency_leave_the_colour_and_parameters_have_their_own():
    styles = styles_of(
        ["ko2012+servo", "ko2012@13ms+servo", "ko2012[alpha=0.3]+servo", "mine:make", "mine:make (truth)"]
    )
    plain, late, other, *_ = styles.values()
    assert plain == styles_of(["ko2012"])["ko2012"]
    assert late.colour == plain.colour
    assert late.dash != plain.dash
    assert other.colour != plain.colour
    assert all(one != two for one, two in itertools.combinations(styles.values(), 2))
