"""The instrument: its description (TOML), waveform, antenna patterns and touchstone files."""
