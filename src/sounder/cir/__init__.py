"""From captures to impulse responses: calibration, averaging, matched filter, and the power spectrum."""
