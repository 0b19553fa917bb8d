"""From captures to channel impulse responses (CIR) and the delay-angular power spectrum (DAPS)."""
