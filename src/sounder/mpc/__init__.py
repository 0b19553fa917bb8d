"""From impulse responses to multipath components with standard deviations."""
