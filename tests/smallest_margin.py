"""The smallest of a motion's margins."""

from armload_identification.excitation.limit_margins import PER_JOINT, LimitMargins


def smallest_margin(margins: LimitMargins) -> float:
    """Above 0 if the motion is strictly within all its limits."""
    named = (*margins.clearance_m.values(), *margins.speed_m_s.values())
    return min(*(float(getattr(margins, name).min()) for name in PER_JOINT), *named)
