"""What was recorded: recordings and their readers, one a format."""
