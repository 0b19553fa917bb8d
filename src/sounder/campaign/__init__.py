"""Campaigns: description, run, report and demo."""
