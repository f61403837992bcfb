"""The short commissioning that `.ci/run` repeats on another processor."""

import pytest

from tests.moving_arm import main


@pytest.mark.long
def test_it_records_both_runs_and_finds_the_payload(capsys):
    main()
    unloaded, loaded, mass = capsys.readouterr().out.splitlines()
    assert unloaded.split()[1] == loaded.split()[1] == "279"
    assert unloaded.split()[0] != loaded.split()[0]
    assert mass == "3.02 kg"
