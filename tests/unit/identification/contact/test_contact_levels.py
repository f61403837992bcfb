"""The levels of this room by what turns at them, with rows and explanations that are known by hand."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from armload_identification.contact.arm_memory import ArmMemory, RememberedState
from armload_identification.contact.force_rows import ForceRows, RowMaker
from armload_identification.contact.force_watch import Force, ForceEventKind, ForceWatch
from armload_identification.contact.load_or_push import _Fits, _means, _payloads, assess, payload_evidence
from armload_identification.contact.something_acts import ResidualNoise, acting, bounds
from armload_identification.estimation.empty_arm import known_arm_rows

pytestmark = pytest.mark.pure

ROOM = "armload_identification.contact"
N, M = 2, 10 + 3 * 2
STEP_S = 0.0201
WHITE = ResidualNoise(np.full(N, 0.01), np.zeros(N))
EXACT = RememberedState(0.0, np.zeros(M), np.zeros((M, M)))


def rows_at(time_s, residual=0.0, doubt=0.0, acceleration=0.0, inertia=0.0):
    """Rows of two joints; the residual is of joint 1."""
    count = len(time_s)
    one = np.zeros((count, N))
    parts = [one.copy() for _ in range(4)]
    for part, values in zip(parts, (residual, doubt, acceleration, inertia), strict=True):
        part[:, 0] = values
    return ForceRows(
        np.asarray(time_s, dtype=float), one, parts[0], np.zeros((count, N, M)), parts[1], parts[2], one + 1.0, parts[3]
    )


# Something acts --------------------------------------------------------------------------------------------------

BOUND = {sigmas: 2.0 * (1.0 - 1.0 / 9.0 + sigmas / 3.0) ** 3 for sigmas in (5.4, 3.7, 3.9, 3.4)}
"""Wilson and Hilferty for two joints: a third of a standard deviation is 2/18."""


@pytest.mark.parametrize(
    ("newest", "window_s", "sigmas"), [(5, 0.1, 5.4), (13, 0.25, 3.7), (25, 0.5, 3.9), (50, 1.0, 3.4)]
)
def test_a_residual_is_seen_best_in_the_window_of_its_length(newest, window_s, sigmas):
    """0.3 N m of the newest rows; 0.01 (N m)^2 are of a mean over 0.1 s."""
    assert bounds(N) == pytest.approx(list(BOUND.values()))
    found = rows_at(STEP_S * np.arange(100), np.where(np.arange(100) >= 100 - newest, 0.3, 0.0))
    ratio, joints = acting(found, EXACT, WHITE)
    assert ratio == pytest.approx(0.09 / (0.01 * 0.1 / window_s) / BOUND[sigmas])
    assert joints == pytest.approx([0.3 / np.sqrt(0.01 * 0.1 / window_s), 0.0])


def test_a_joint_that_stops_may_have_0_57_of_its_doubt_and_a_deviation_of_0_33():
    found = rows_at(STEP_S * np.arange(100), 3.0, 2.0)
    ratio, _ = acting(found, EXACT, WHITE)
    assert ratio == pytest.approx((3.0 - 0.57 * 2.0) ** 2 / (0.001 + (0.33 * 2.0) ** 2) / BOUND[3.4])


@pytest.mark.parametrize(("change", "beyond"), [(0.4, 0.0), (1.4, 1.0)])
def test_a_changing_acceleration_makes_a_fifth_of_its_inertia_uncertain(change, beyond):
    found = rows_at(STEP_S * np.arange(100), 3.0, 0.0, 0.5 * change * (-1.0) ** np.arange(100), 2.5)
    ratio, _ = acting(found, EXACT, WHITE)
    assert ratio == pytest.approx(9.0 / (0.001 + (0.2 * 2.5 * beyond) ** 2) / BOUND[3.4])


@pytest.mark.parametrize(("every", "ratio"), [(2, 0.09 / 0.01 / BOUND[5.4]), (3, 0.0)])
def test_a_window_has_rows_for_six_tenths_of_its_time(every, ratio):
    """Rows count for 0.02 s: every second one is enough in 0.1 s, where they are three, and too few in the others."""
    found = rows_at(STEP_S * np.arange(0, 100, every), 0.3)
    assert acting(found, EXACT, WHITE)[0] == pytest.approx(ratio)


def test_noise_is_white_over_a_tenth_and_coloured_over_half_a_second():
    noise = ResidualNoise(np.array([0.3]), np.array([0.7]))
    assert noise.density == pytest.approx([0.03 + 0.7])
    assert noise.of_means[2] == pytest.approx([0.3 / 5.0 + 0.7 * 2.0 * np.exp(-1.0)])


# What is remembered ----------------------------------------------------------------------------------------------


def learnt(*, at_s, weight=1.0):
    rows = rows_at(at_s, 1.0)
    rows.columns[:, 0, 0] = weight
    return rows


def test_what_was_learnt_is_a_third_after_a_minute_and_was_known_two_seconds_before():
    memory = ArmMemory(M)
    memory.add(learnt(at_s=[0.0, 0.1]), np.ones(N))
    assert memory.before(2.0999) is None
    assert memory.before(2.1).value[0] == pytest.approx(0.1 / 1.1)
    memory.add(learnt(at_s=[60.1], weight=0.0), np.ones(N))
    share = 0.1 * np.exp(-1.0)
    assert memory.before(99.0).value[0] == pytest.approx(share / (1.0 + share))


def test_states_are_kept_each_half_second_and_rows_learnt_by_fives():
    memory = ArmMemory(M)
    memory.add(learnt(at_s=[0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0]), np.ones(N))
    assert [known.time_s for known in memory._known] == [0.4, 0.9]
    memory.add(learnt(at_s=[1.39]), np.ones(N))
    memory.add(learnt(at_s=[1.41]), np.ones(N))
    assert [known.time_s for known in memory._known] == [0.4, 0.9, 1.41]


# What it is ------------------------------------------------------------------------------------------------------


def test_rows_are_averaged_over_a_tenth_of_a_second_and_the_doubt_is_the_greatest_of_two():
    time_s = 5.0 + 0.03 * np.arange(9)
    found = _means(rows_at(time_s, np.arange(9.0), [0, 1, 0, 0, 0, 0, 7, 0, 0]))
    assert found.time_s == pytest.approx([5.0, 5.12, 5.21])
    assert found.residual_nm[:, 0] == pytest.approx([1.5, 5.0, 7.5])
    assert found.doubt_nm[:, 0] == pytest.approx([1.0, 7.0, 7.0])
    assert _means(found.part(slice(0))).size == 0


def test_a_payload_rises_at_once_or_within_0_2_or_0_4_s_from_each_onset(monkeypatch):
    """Shares at the middle of each mean, for the two sizes."""
    seen = []
    monkeypatch.setattr(f"{ROOM}.load_or_push._fits", lambda columns, *rest: seen.append((columns.shape, rest[-1])))
    means = rows_at([3.0, 3.1, 3.2, 3.3, 3.4])
    _payloads(means, np.zeros(0), np.zeros(0), np.array([0, 3]), (0.0, 0.2, 0.4))
    ((shape, shares),) = seen
    assert shape == (5, N, 10)
    rises = [[1, 1, 1, 1, 1], [0.25, 0.75, 1, 1, 1], [0.125, 0.375, 0.625, 0.875, 1]]
    late = [[0, 0, 0, *rise[:2]] for rise in rises]
    expected = [size * np.array(rise) for rise in (*rises, *late) for size in (0.05, 0.0125)]
    np.testing.assert_allclose(shares, expected, atol=1e-9)


@pytest.fixture
def explanations(monkeypatch):
    """Let the payload and the push have given fits; returns what `assess` says, and what it was given."""

    def explanations(payload, push, carried=0.0):
        seen = SimpleNamespace(rises=None, shares=None, columns=None)

        def payloads(means, _, __, onsets, rises):
            seen.means, seen.onsets, seen.rises = means, onsets, rises
            return payload

        def fits(columns, _, __, shares):
            seen.columns, seen.shares = columns, shares
            return push

        monkeypatch.setattr(f"{ROOM}.load_or_push._payloads", payloads)
        monkeypatch.setattr(f"{ROOM}.load_or_push._fits", fits)
        chain = SimpleNamespace(jacobian=lambda q: np.ones((len(q), 6, N)))
        known = RememberedState(0.0, np.r_[carried, np.zeros(M - 1)], np.eye(M))
        rows = rows_at(0.1001 * np.arange(50) + 0.001)
        return assess(rows, known, ResidualNoise(np.ones(N), np.ones(N)), chain, 4.0), seen

    return explanations


def fit_of(logarithm, best, b, variance=0.0):
    b = np.array(b, dtype=float)
    return _Fits(logarithm, best, b, variance * np.eye(b.size))


def test_a_push_has_60_n_and_10_nm_and_must_be_better_by_30(explanations):
    found, seen = explanations(fit_of(5.0, 13, [1.0] * 10), fit_of(20.0, 2, [1, 2, 3, 0, 0, 0], 0.25))
    assert (found.odds, found.evidence, found.push_evidence) == (15.0, 5.0, 20.0)
    assert found.force_n == pytest.approx([60.0, 120.0, 180.0])
    assert found.force_deviation_n == pytest.approx([30.0] * 3)
    assert seen.rises == (0.0, 0.2, 0.4)
    # Rows from 2.3 s before the notice: 1.703 s on; the third onset of six fits each.
    assert seen.means.time_s[0] == pytest.approx(1.7027)
    assert found.payload_since_s == pytest.approx(1.9029)
    assert seen.onsets[-1] == 23, "up to a step after the notice"
    np.testing.assert_allclose(seen.columns[0], -np.tile([60.0] * 3 + [10.0] * 3, (N, 1)))
    # The first onset, with each end.
    assert seen.shares[0].tolist() == [1.0] + [0.0] * 32
    assert seen.shares[2].tolist() == [1.0] * 3 + [0.0] * 30
    assert found.push_s == pytest.approx((1.7027, 2.003))
    found, _ = explanations(fit_of(0.0, 0, [1.0] * 10), fit_of(0.0, 32, [0] * 6))
    assert found.push_s == (pytest.approx(1.7027), np.inf)


@pytest.mark.parametrize(
    ("best", "carried", "change", "variance", "possible"),
    [
        (0, 0.5, -10.0, 0.0, True),
        (0, 0.4749, -10.0, 0.0, False),
        (0, 0.4751, -10.0, 0.0, True),
        (1, 0.4749 / 4.0, -10.0, 0.0, False),
        (1, 0.4751 / 4.0, -10.0, 0.0, True),
        (0, 0.3251, -10.0, 1.0, True),
        (0, 0.3249, -10.0, 1.0, False),
    ],
)
def test_no_more_is_dropped_than_was_carried_but_for_3_deviations_and_5_percent(
    explanations, best, carried, change, variance, possible
):
    """A change of 10 sizes of 0.05, or of 0.0125."""
    found, _ = explanations(fit_of(0.0, best, [change] + [0.0] * 9, variance), fit_of(0.0, 0, [0] * 6), carried)
    assert found.odds == (30.0 if possible else -np.inf)


@pytest.mark.parametrize(("count", "onsets"), [(2, None), (3, 1), (40, 21)])
def test_a_look_seeks_an_onset_in_2_3_s_but_not_in_the_two_newest_means(monkeypatch, count, onsets):
    seen = []

    def payloads(means, _, __, onsets, rises):
        seen.append((onsets.size, rises))
        return fit_of(3.0, 0, [0.0])

    monkeypatch.setattr(f"{ROOM}.load_or_push._payloads", payloads)
    rows = rows_at(0.1001 * np.arange(count) + 0.001)
    found = payload_evidence(rows, EXACT, ResidualNoise(np.ones(N), np.ones(N)), rows.time_s[-1])
    assert found == (-np.inf if onsets is None else 3.0)
    assert seen == ([] if onsets is None else [(onsets, (0.0,))])


# Rows ------------------------------------------------------------------------------------------------------------


def maker():
    """A row maker without an arm, of one joint, whose rows are the windows themselves."""
    made = object.__new__(RowMaker)
    made.chain, made._from_effort = SimpleNamespace(n=1), np.array([[2.0]])
    made._gathered = made._bins = np.zeros((0, 4))
    made._count, made._row_s, made._sample_s = 0, -np.inf, np.nan
    return made


def windows_of(made, time_s):
    made._rows = lambda windows: windows
    values = np.arange(len(time_s), dtype=float)[:, None]
    return made.take(np.asarray(time_s), values, values)


@pytest.mark.parametrize(
    ("step_s", "together", "apart"), [(0.01, 1, 2), (0.002, 5, 2), (0.0094, 2, 2), (0.0191, 1, 1), (0.0189, 1, 2)]
)
def test_samples_are_averaged_over_9_5_ms_and_rows_are_19_ms_apart(step_s, together, apart):
    found = windows_of(maker(), step_s * np.arange(60 * together))
    assert found.shape[1:] == (9, 4)
    times = found[:, 4, 1]
    assert np.diff(times) == pytest.approx(together * apart * step_s)
    first = step_s * (together - 1) / 2.0
    assert found[0, :, 1] == pytest.approx(first + together * step_s * np.arange(9))
    np.testing.assert_allclose(found[0, :, 3], 2.0 * found[0, :, 2])


@pytest.mark.parametrize(("step_s", "together"), [(0.01, 1), (0.002, 5)])
def test_a_row_is_there_with_the_last_sample_of_its_last_mean(step_s, together):
    made, ends_s = maker(), {}
    for k in range(60 * together):
        found = windows_of(made, [step_s * k])
        if isinstance(found, np.ndarray):
            ends_s[k] = found[0, -1, 1]
            assert found[0, -1, 0] == k
    assert len(ends_s) >= 25
    assert all(end_s == pytest.approx(step_s * (k - (together - 1) / 2.0)) for k, end_s in ends_s.items())


@pytest.mark.parametrize(("hole_s", "longest_s"), [(0.21, 0.28), (0.24, 0.08)])
def test_a_row_spans_less_than_0_3_s(hole_s, longest_s):
    """Nine means of 10 ms are 80 ms; of those about a longer hole no row is made."""
    time_s = 0.01 * np.arange(61) + (hole_s - 0.01) * (np.arange(61) >= 30)
    assert np.ptp(windows_of(maker(), time_s)[:, :, 1], axis=1).max() == pytest.approx(longest_s)


def test_samples_that_are_not_finite_are_left_out_and_the_last_means_begin_the_next_rows():
    made = maker()
    time_s = 0.01 * np.arange(40)
    whole = windows_of(maker(), time_s)
    parts = [windows_of(made, time_s[part])[:, :, 1] for part in (slice(0, 13), slice(13, 40))]
    np.testing.assert_allclose(np.concatenate(parts), whole[:, :, 1])
    broken = time_s.copy()
    broken[7] = np.nan
    assert 0.07 not in np.round(windows_of(maker(), broken)[:, :, 1], 6)


@pytest.mark.parametrize(("speed", "slow"), [(0.0, 1.0), (3.5, 1.0 - np.tanh(1.0)), (-7.0, 1.0 - np.tanh(2.0))])
def test_a_slow_joint_is_uncertain_by_one_and_a_half_times_its_friction(monkeypatch, speed, slow):
    """Slow is 3.5 reversal speeds of 0.01 rad/s; friction of 2 N m and a tenth of 5 N m of links."""
    monkeypatch.setattr(f"{known_arm_rows.__name__}.payload_regressor", lambda _, q, *__: np.zeros((*q.shape, 10)))
    made, one = maker(), np.ones(1)
    made._units, made._weightless = (np.array([[0.3], [0.5], [0.7]]), np.ones(10)), None
    made._body = SimpleNamespace(
        torque_delay_s=0.0,
        reversal_speed_rad_s=0.01 * one,
        link_torque=lambda _, q, *__: -5.0 * np.ones_like(q),
        load_friction=0.1 * one,
        coulomb_nm=2.0 * one,
        root_nm=0.4 * one,
        viscous_nm_s_rad=3.0 * one,
        offset_nm=0.25 * one,
        rotor_mass_kg_m2=np.eye(1),
    )
    time_s = 1.0 + 0.01 * np.arange(9)
    windows = np.column_stack([np.arange(9), time_s, 0.01 * speed * time_s, np.full(9, 20.0)])[None]
    (row,) = made._rows(windows)
    assert row.number == 8
    found = row.about(np.zeros(10))
    assert found.time_s == pytest.approx([1.04])
    assert found.position_rad == pytest.approx(np.array([[0.01 * speed * 1.04]]))
    assert found.doubt_nm == pytest.approx(np.array([[1.5 * (2.0 + 0.1 * 5.0) * slow]]))
    way = np.tanh(speed)
    friction = way * (2.0 + 0.4 * np.sqrt(abs(0.01 * speed))) + 3.0 * 0.01 * speed + 0.25
    assert found.residual_nm == pytest.approx(np.array([[20.0 + 5.0 * (1.0 - 0.1 * way) - friction]]))
    assert found.columns[0, 0, 10:] == pytest.approx([0.3 * way, 0.5 * 0.01 * speed, 0.7])
    assert found.weight == pytest.approx(np.array([[(speed / 10.0) ** 2 / np.sqrt(1.0 + (speed / 10.0) ** 4)]]))


# The watch -------------------------------------------------------------------------------------------------------


class Memory:
    """Knows something of each time; records what it learns."""

    def __init__(self) -> None:
        self.learnt, self.asked, self.anew = [], [], []

    def add(self, rows, density):
        self.learnt.append(rows.size)

    def before(self, time_s):
        self.asked.append(time_s)
        return RememberedState(min(time_s, 1e9) - 2.0, np.zeros(M), np.zeros((M, M)))

    def begin_anew(self, known, *, payload):
        self.anew.append((known.time_s, payload))


def watch(seen_s=5.0, state=Force.FREE):
    """A watch that has seen the arm for some seconds; at 100 s something acted if it does not begin as free."""
    made = object.__new__(ForceWatch)
    made._chain = SimpleNamespace(n=N)
    made._know_nothing(np.full(N, 0.01))
    made._memory, made._seen_s = Memory(), seen_s
    made._noticed_s = made._evident_s = made._before_s = 0.0
    made._push_end_s, made._looked_s, made._looks = np.inf, -np.inf, []
    made._joints = np.zeros(N, dtype=bool)
    if state is not Force.FREE:
        made._begin(100.0, np.array([True, False]))
        made.state = state
    return made


def noticed(made, ratios, joints=(0.0, 0.0)):
    time_s = 50.0 + 0.02 * np.arange(len(ratios))
    events = []
    for at_s, ratio in zip(time_s, ratios, strict=True):
        events += [] if events else made._notice(rows_at([at_s]), ratio, np.array(joints))
    return events


@pytest.mark.parametrize(
    ("ratios", "at"),
    [
        ([1.1, 1.1], None),
        ([1.1, 1.1, 1.01], 2),
        ([1.1, 1.1, 0.99, 1.1, 1.1], None),
        ([0.5, 2.9, 2.9], None),
        ([0.5, 3.1], 1),
        ([1.1, 1.1, 1.1, 1.1], 2),
    ],
)
def test_three_rows_above_the_bound_are_an_event_or_one_three_times_above(ratios, at):
    made = watch()
    events = noticed(made, ratios, (3.1, -2.9))
    assert [event.time_s for event in events] == ([] if at is None else [pytest.approx(50.0 + 0.02 * at)])
    if at is not None:
        (event,) = events
        assert (event.kind, event.since_s, made.state) == (ForceEventKind.ACTING, event.time_s, Force.ACTING)
        assert event.joints.tolist() == [True, False], "beyond three standard deviations"
        assert made._memory.asked == [pytest.approx(event.time_s - 0.3)]
    assert made._memory.learnt == []


def test_rows_above_the_bound_count_over_calls_and_nothing_is_learnt_of_them():
    made = watch()
    assert (noticed(made, [0.9] * 4), made._memory.learnt) == ([], [])
    assert (noticed(made, [1.1, 1.1]), made._memory.learnt) == ([], [])
    assert (noticed(made, [0.9]), made._memory.learnt) == ([], [5])
    assert (noticed(made, [0.9]), made._memory.learnt) == ([], [5])
    assert noticed(made, [1.1, 1.1]) == []
    assert len(noticed(made, [1.1])) == 1
    assert made._unlearnt == [], "what was not learnt before an event is left out"


@pytest.mark.parametrize(("seen_s", "evidence", "event"), [(8.0, 7.1, True), (8.0, 6.9, False), (7.9, 99.0, False)])
def test_after_eight_seconds_a_payload_of_evidence_seven_is_looked_for_each_fifth_of_a_second(
    monkeypatch, seen_s, evidence, event
):
    asked = []
    monkeypatch.setattr(
        f"{ROOM}.force_watch.payload_evidence", lambda rows, known, noise, now_s: asked.append(now_s) or evidence
    )
    made = watch(seen_s)
    events = noticed(made, [0.1], (2.0, 1.0))
    assert bool(events) is event
    assert asked == ([50.0] if seen_s == 8.0 else [])
    if seen_s == 8.0:
        assert made._memory.asked[0] == pytest.approx(50.0 - 2.3 + 2.0)
    if event:
        assert events[0].joints.tolist() == [True, False], "the greatest, if none has three deviations"
    elif seen_s == 8.0:
        for later_s, looks in ((50.19, 1), (50.21, 2)):
            made._notice(rows_at([later_s]), 0.0, np.zeros(N))
            assert len(asked) == looks


def assessed(odds=0.0, evidence=0.0, push=0.0, since_s=99.5, push_s=(99.4, np.inf)):
    return SimpleNamespace(odds=odds, evidence=evidence, push_evidence=push, payload_since_s=since_s, push_s=push_s)


@pytest.fixture
def decided(monkeypatch):
    """Events of a watch some time after the notice, where the rows say what is given."""

    def decided(made, after_s, **said):
        looked = []
        monkeypatch.setattr(f"{ROOM}.force_watch.assess", lambda *_: looked.append(1) or assessed(**said))
        if made.state is Force.ACTING:
            made._evident_s = 100.0 + after_s
        events = list(made._decide(made._base, 100.0 + after_s))
        return [(event.kind.name, event.since_s) for event in events], len(looked)

    return decided


def test_it_is_looked_at_eight_times_within_three_seconds(decided):
    made = watch(state=Force.ACTING)
    looks = []
    for after_s in np.arange(0.0, 2.9, 0.01):
        _, looked = decided(made, after_s, push=99.0)
        looks += [round(float(after_s), 2)] * looked
    assert looks == pytest.approx([0.3, 0.5, 0.8, 1.1, 1.38, 2.0, 2.5], abs=0.0101)
    assert decided(made, 2.91, push=99.0) == ([("PUSH", 99.4)], 1)


@pytest.mark.parametrize(
    ("due", "odds", "evidence", "push", "kind"),
    [
        (3, 21.0, 9.0, 0.0, None),
        (4, 21.0, 9.0, 0.0, "PAYLOAD"),
        (4, 19.0, 9.0, 0.0, None),
        (4, 21.0, 7.9, 0.0, None),
        (4, 21.0, 8.1, 0.0, "PAYLOAD"),
        (7, 0.1, 9.0, 0.0, "PAYLOAD"),
        (7, -0.1, 9.0, 9.0, "PUSH"),
        (7, 0.1, 7.9, 7.9, "NOTHING"),
        (7, 0.1, 7.9, 8.1, "PUSH"),
        (0, -59.0, 0.0, 99.0, None),
        (0, -61.0, 0.0, 99.0, "PUSH"),
    ],
)
def test_a_payload_is_decided_from_1_38_s_on_a_push_at_once_and_the_rest_at_the_end(
    decided, due, odds, evidence, push, kind
):
    made = watch(state=Force.ACTING)
    del made._looks[:due]
    made._recent.rows = rows_at([99.0, 99.9, 100.1, 100.2])
    events, _ = decided(made, made._looks[0] + 1e-6, odds=odds, evidence=evidence, push=push)
    since_s = {"PAYLOAD": 99.5, "PUSH": 99.4, "NOTHING": 100.0}
    assert events == ([(kind, since_s[kind])] if kind else [])
    states = {None: Force.ACTING, "PUSH": Force.PUSHED, "PAYLOAD": Force.FREE, "NOTHING": Force.FREE}
    assert made.state is states[kind]
    base_s = 100.0 - 0.3 - 2.0
    assert made._memory.anew == ([(base_s, kind == "NOTHING")] if made.state is Force.FREE else [])
    # A new payload acts alone half a second after its onset; nothing acted since what was known.
    assert made._memory.learnt == {"PAYLOAD": [2], "NOTHING": [4]}.get(kind, [])


@pytest.mark.parametrize(
    ("quiet_s", "push_end_s", "ended_s"), [(0.29, 101.0, None), (0.31, 100.9, 100.9), (0.31, 101.5, 101.0)]
)
def test_a_push_is_over_after_0_3_s_without_evidence(decided, quiet_s, push_end_s, ended_s):
    made = watch(state=Force.PUSHED)
    made._looks, made._evident_s, made._push_end_s = [], 101.0, push_end_s
    made._recent.rows = rows_at([101.0, 101.29, 101.31])
    assert decided(made, 1.0 + quiet_s)[0] == ([] if ended_s is None else [("OVER", ended_s)])
    if ended_s is not None:
        assert (made.state, made._memory.anew[0][1], made._memory.learnt) == (Force.FREE, True, [1])


@pytest.mark.parametrize(
    ("before_s", "lasts_s", "anew"), [(4.0, 9.9, False), (4.0, 10.1, True), (15.0, 14.9, False), (15.0, 15.1, True)]
)
def test_a_push_that_lasts_ten_seconds_and_longer_than_all_before_it_is_the_rule(decided, before_s, lasts_s, anew):
    made = watch(before_s, Force.PUSHED)
    made._looks, made._evident_s = [], 100.0 + lasts_s
    assert decided(made, lasts_s)[0] == ([("PAYLOAD", 100.0)] if anew else [])
    assert made.state is (Force.FREE if anew else Force.PUSHED)
    assert (made._seen_s == 0.0) is anew


def taken(made, monkeypatch, time_s, ratio=0.0):
    monkeypatch.setattr(f"{ROOM}.force_watch.acting", lambda *_: (ratio, np.zeros(N)))
    rows = [rows_at([at_s]) for at_s in time_s]
    return [event for row in rows for event in made.take(SimpleNamespace(about=lambda _, row=row: row))]


def test_the_test_begins_after_three_seconds_of_rows_and_nine_are_kept(monkeypatch):
    made = watch(seen_s=0.0)
    for k in range(149):
        assert taken(made, monkeypatch, [10.0 + 0.02 * k], ratio=9.0) == []
    assert made._seen_s == pytest.approx(2.98)
    assert len(taken(made, monkeypatch, [10.0 + 0.02 * 150], ratio=9.0)) == 1
    one = watch()
    taken(one, monkeypatch, [10.0, 10.5])
    assert one._seen_s == pytest.approx(5.0 + 0.04), "a gap is not seen"
    taken(one, monkeypatch, [19.2, 19.21])
    assert one._seen_s == pytest.approx(5.08)
    assert one._recent.rows.time_s.tolist() == [10.5, 19.2, 19.21]


@pytest.mark.parametrize(("ratio", "evident_s"), [(0.39, 100.0), (0.41, 100.12)])
def test_what_acts_is_evident_above_four_tenths_of_the_bound(monkeypatch, ratio, evident_s):
    made = watch(state=Force.ACTING)
    taken(made, monkeypatch, [100.1, 100.12], ratio)
    assert made._evident_s == pytest.approx(evident_s)


def learn(made, rows):
    for k in range(rows.size):
        made._learn(rows.part(slice(k, k + 1)))


@pytest.mark.parametrize(("mean", "found"), [(0.1, 0.005), (9.0, 0.09)])
def test_the_white_noise_is_that_of_half_a_minute_with_jumps_to_nine_times_its_variance(mean, found):
    """Two means a tenth of a second apart; half the square of their difference."""
    made = watch()
    made._noise = ResidualNoise(np.full(N, 0.01), np.zeros(N))
    learn(made, rows_at(1.0 + 0.02 * np.arange(5)))
    assert made._noise.white_nm2[0] == 0.01
    learn(made, rows_at(1.1 + 0.02 * np.arange(5), mean))
    assert made._noise.white_nm2[0] == pytest.approx(0.01 + 0.1 / 30.0 * (found - 0.01))


def test_the_coloured_noise_explains_a_part_of_a_change_and_a_twentieth_of_it_is_white():
    made = watch()
    made._noise = ResidualNoise(np.full(N, 0.01), np.full(N, 0.04))
    learn(made, rows_at(1.0 + 0.02 * np.arange(5)))
    learn(made, rows_at(1.1 + 0.02 * np.arange(5), 0.3))
    remembered = 0.04 * (1.0 - np.exp(-0.2))
    assert made._noise.white_nm2[0] == pytest.approx(0.01 + 0.1 / 30.0 * (0.045 - remembered - 0.01))
    made._noise = ResidualNoise(np.full(N, 1e-6), np.full(N, 0.04))
    learn(made, rows_at(1.2 + 0.02 * np.arange(5), 0.3))
    assert made._noise.white_nm2[0] == pytest.approx(0.002)
