"""The gate: every file of a user is read through it. What it refuses, and why, is in docs/security.md."""
