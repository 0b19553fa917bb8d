"""Which images are walls: conflicts, corners, chains of bounces, joint adjustment."""
