"""A hose that pulls at the wrist of an arm that carries nothing."""

from dataclasses import replace

import numpy as np
import pytest

from armload_identification.identification_errors import NothingMounted
from armload_identification.pipeline.payload_identification import identify_runs
from benchmarks.arms.sagging_panda import Effects, SaggingPanda, chain, nominal_transmission


def unlabelled(run, **changes):
    return replace(run, source=replace(run.source, attachments={}, **changes))


@pytest.mark.parametrize("joint", [5, 6])
def test_a_hose_on_an_empty_arm_is_not_taken_for_a_mistake_in_the_columns(joint):
    """Nothing that the other joints imply of a joint is above 0 here; without the check joint 7 is called exchanged."""
    panda = SaggingPanda(Effects(noise=0.2))
    first, second = (panda.pair(seed, with_phase=True)[1] for seed in (1, 2))
    drag = 2.0 * (first.position_rad[:, joint] - first.position_rad[:, joint].mean())
    dragged = first.current_a + drag[:, None] * (np.arange(7) == joint)
    dragged = unlabelled(replace(first, current_a=dragged), sha256="dragged")
    with pytest.raises(NothingMounted):
        identify_runs(dragged, unlabelled(second), chain(), nominal_transmission(exact=False))
