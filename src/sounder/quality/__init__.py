"""What is wrong with a recording: checks of what is known in advance, and the table of remarks."""
