"""What every room needs: errors, storage, console, pages. Nothing here knows of radio."""
