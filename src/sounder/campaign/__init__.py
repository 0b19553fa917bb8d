"""A campaign by one command: its description, its run, its report, and the demo."""
