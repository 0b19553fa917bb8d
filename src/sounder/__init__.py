"""Radio channel sounding: from raw captures to impulse responses, DAPS and multipath components."""

__version__ = "0.1.0"
