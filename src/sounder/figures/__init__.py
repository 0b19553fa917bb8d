"""Figures of products and scores."""
