"""Options that select parts of recordings, as a choice for each."""

import pytest
import typer

from armload_controller.cli.recording_options import RecordingOptions
from armload_identification.recording.reading_options import Effort

pytestmark = pytest.mark.pure


def test_without_options_everything_is_used():
    first, second = RecordingOptions().choices(2)
    assert first == second
    assert (first.columns, first.effort, first.between_s, first.episode, first.joints) == (
        None, Effort.TORQUE, None, None, (),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("text", "joints"),
    [("1", (0,)), ("1-5,7", (0, 1, 2, 3, 4, 6)), (" 2 , 1", (1, 0)), ("3-3", (2,)), ("2-4,1", (1, 2, 3, 0))],
)
def test_joints_are_numbered_from_1_in_ranges_and_in_any_order(text, joints):
    (choice,) = RecordingOptions(joints=text).choices(1)
    assert choice.joints == joints


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"joints": "0"}, "'0' is neither a joint nor a range"),
        ({"joints": "5-1"}, "'5-1' is neither a joint nor a range"),
        ({"joints": "a"}, "neither a joint nor a range"),
        ({"joints": ""}, "neither a joint nor a range"),
        ({"joints": "1-3,2"}, "names a joint twice"),
        ({"episode": "x"}, "is not an episode number"),
        ({"episode": "1,"}, "is not an episode number"),
        ({"episode": "1,2,3"}, "3 numbers for 2 recordings"),
        ({"between": (5.0, 5.0)}, "5 s is not before 5 s"),
        ({"between": (6.0, 5.0)}, "6 s is not before 5 s"),
    ],
)
def test_what_makes_no_sense_is_refused(options, said):
    with pytest.raises(typer.BadParameter, match=said):
        RecordingOptions(**options).choices(2)


def test_one_episode_is_for_all_and_several_are_one_for_each():
    assert [choice.episode for choice in RecordingOptions(episode="3").choices(2)] == [3, 3]
    assert [choice.episode for choice in RecordingOptions(episode="3, 4").choices(2)] == [3, 4]
    assert [choice.episode for choice in RecordingOptions(episode="7").choices(1)] == [7]


def test_columns_effort_and_times_are_the_same_for_all():
    options = RecordingOptions("time=0 position=1-2 torque=3-4", Effort.CURRENT, (1.0, 2.0))
    for choice in options.choices(2):
        assert choice.columns.groups["position_rad"] == [1, 2]
        assert (choice.effort, choice.between_s) == (Effort.CURRENT, (1.0, 2.0))
