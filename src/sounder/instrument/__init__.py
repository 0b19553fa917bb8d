"""What the sounder is: its description (TOML), waveform, antenna patterns and touchstone files."""
