"""Rows of a small fleet."""

from datetime import UTC, datetime, timedelta

from armload_controller.fleet.job import Job
from armload_controller.fleet.recording_row import RowOutcome, empty_row, value_columns
from armload_controller.fleet.row_store import RowStore

FIRST = datetime(2026, 3, 1, 22, tzinfo=UTC)
NIGHTS = 10


def recorded_nights(folder):
    """Write rows of two arms; one carries 300 g more since the seventh night, and has no result in the last."""
    with RowStore(folder) as store:
        for night in range(NIGHTS):
            for arm in ("one", "two"):
                job = Job(
                    f"{arm}{night}", arm, "arms/er50.toml", {"loaded": f"{arm}/{night}.mcap"}, "", "tool", None, None
                )
                made = FIRST + timedelta(days=night)
                row = empty_row(job, "1") | {"recorded_utc": made, "identified_utc": made}
                if arm == "one" and night == NIGHTS - 1:
                    store.add(row | {"outcome": RowOutcome.REFUSED.value, "error": "cut short"})
                    continue
                mass = 2.0 + 0.001 * (-1) ** night + 0.3 * (arm == "one" and night > 5)
                row |= dict(zip(value_columns()[0], (mass, mass - 0.02, mass + 0.02), strict=True))
                row |= {"outcome": RowOutcome.IDENTIFIED.value, "robot_name": "er50", "joint_names": ["a", "b"]}
                row |= {"gain_change": [0.01, None], "gain_half_width_95": [0.02, None], "friction_nm": [3.0, 4.0]}
                store.add(row | {"residual_rms_nm": [0.2, 0.1], "noise_nm": [0.1, 0.1]})
