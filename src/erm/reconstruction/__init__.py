"""Walls and poles from components: common images found, walls told from chains of bounces, extents measured."""
