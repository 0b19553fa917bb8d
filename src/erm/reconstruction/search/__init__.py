"""The search for virtual anchors that many paths share."""
