"""Verification of a sounder against known artefacts: cables, attenuators, a corner reflector, a link."""
